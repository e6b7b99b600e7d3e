#!/usr/bin/env bash
# Light in corners, in a shelf, under a chair and beside a slot, beside Mitsuba's path tracer: errors by the
# distance from the nearest other surface.
#
#   tests/peers/corners.sh PHOTONCARD [--seeds N] [NAME ..] [-- OPTION ..]
#
# Options go to `photoncard prepare`. References are rendered once.
set -euo pipefail
[ $# -ge 1 ] && [ -x "$1" ] || {
    echo "usage: $0 PHOTONCARD [--seeds N] [NAME ..] [-- OPTION ..]" >&2
    exit 2
}
photoncard=$(realpath "$1")
shift
cd "$(dirname "$0")/../.."
target=$(realpath -m "${CARGO_TARGET_DIR:-target}")
source tests/peers/mitsuba/environment.sh
make_environment "$target/peers/mitsuba"
exec "$target/peers/mitsuba/bin/python" tests/peers/corners/compare.py --photoncard "$photoncard" \
    --folder "$target/peers/corners" "$@"
