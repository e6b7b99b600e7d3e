#!/usr/bin/env bash
# Flicker of frames: a walk through the atrium, with photoncard and with Mitsuba 3 in the same CPU time.
#
#   tests/peers/flicker.sh PHOTONCARD [--frames FIRST-LAST] [--within X0,Y0,Z0,X1,Y1,Z1] [--options OPTIONS ...]
#
# prints the root mean square of the relative differences of frames, after reprojection, in a box of places on static walls (docs/animation.md).
# --options are settings of photoncard, may be repeated and replace the irradiance cache on and off; the first ones decide what
# time Mitsuba has. Pictures are in target/peers/flicker.
set -euo pipefail
[ $# -ge 1 ] && [ -x "$1" ] || {
    echo "usage: $0 PHOTONCARD [--frames FIRST-LAST] [--within X0,Y0,Z0,X1,Y1,Z1] [--options OPTIONS ...]: PHOTONCARD is the binary to render with, target/release/photoncard" >&2
    exit 2
}
photoncard=$(realpath "$1")
shift
cd "$(dirname "$0")/../.."
target=$(realpath -m "${CARGO_TARGET_DIR:-target}")
source tests/peers/mitsuba/environment.sh
make_environment "$target/peers/mitsuba"
cargo build --quiet --package photoncard-tests --example flicker
exec "$target/peers/mitsuba/bin/python" tests/peers/mitsuba/flicker.py --photoncard "$photoncard" \
    --flicker "$target/debug/examples/flicker" --folder "$target/peers/flicker" "$@"
