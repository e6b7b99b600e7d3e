#!/usr/bin/env bash
# A room as a user of Blender makes it (sun through a window, a point light, glass, gold, steel, a floor with a texture), by Blender's own glTF export with
# its defaults, cameras and lights ticked: fireflies and errors of photoncard beside Cycles in the same CPU time.
#
#   tests/peers/room.sh PHOTONCARD [-- OPTION ...]
#
# Options go to `photoncard render`, instead of 16 samples with the irradiance cache, and 8 without. The converged picture is Cycles's, denoised;
# it is rendered once, in minutes. The pictures are in target/peers/room, side by side in room.png.
set -euo pipefail
[ $# -ge 1 ] && [ -x "$1" ] || {
    echo "usage: $0 PHOTONCARD [-- OPTION ...]: PHOTONCARD is the binary to render with, target/release/photoncard" >&2
    exit 2
}
photoncard=$(realpath "$1")
shift
cd "$(dirname "$0")/../.."
source tests/peers/cycles/environment.sh
target=$(realpath -m "${CARGO_TARGET_DIR:-target}")
make_cycles_environment "$target/peers/cycles"
exec "$target/peers/cycles/bin/python" tests/peers/cycles/room.py --photoncard "$photoncard" --folder "$target/peers/room" "$@"
