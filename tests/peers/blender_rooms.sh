#!/usr/bin/env bash
# Furnished rooms by Blender's own glTF export (a sunlit living room, an evening room with a chandelier, a kitchen with a bath), each with Lambertian
# surfaces alone and as it is: errors of blocks of photoncard against Cycles.
#
#   tests/peers/blender_rooms.sh PHOTONCARD [--kind lambertian|whole] [--width N] [--samples N] [NAME ...] [-- OPTION ...]
#
# NAME is living-room, evening or kitchen; options after -- go to `photoncard render`. Prints the mean over that of Cycles, and the median, the 95th percentile
# and the most of the errors of blocks of 12x12 pixels and channels, of two seeds and of their mean; the noise and, by its square taken from that of the errors,
# the bias. Cycles renders two pictures of 512 samples once, in minutes to an hour. Files are in target/peers/blender-rooms, with photoncard and Cycles
# side by side in NAME-KIND.png.
set -euo pipefail
[ $# -ge 1 ] && [ -x "$1" ] || {
    echo "usage: $0 PHOTONCARD [--kind lambertian|whole] [NAME ...] [-- OPTION ...]: PHOTONCARD is the binary to render with, target/release/photoncard" >&2
    exit 2
}
photoncard=$(realpath "$1")
shift
cd "$(dirname "$0")/../.."
source tests/peers/cycles/environment.sh
target=$(realpath -m "${CARGO_TARGET_DIR:-target}")
make_cycles_environment "$target/peers/cycles"
exec "$target/peers/cycles/bin/python" tests/peers/cycles/rooms.py --photoncard "$photoncard" --folder "$target/peers/blender-rooms" "$@"
