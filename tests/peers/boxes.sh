#!/usr/bin/env bash
# Rooms of wall boxes, 0.1 mm to 0.2 m thick, beside Mitsuba's path tracer, and closed rooms with and without a
# sun outside.
#
#   tests/peers/boxes.sh PHOTONCARD
#
# The reference is rendered once. Files are in target/peers/boxes.
set -euo pipefail
[ $# -ge 1 ] && [ -x "$1" ] || {
    echo "usage: $0 PHOTONCARD" >&2
    exit 2
}
photoncard=$(realpath "$1")
shift
cd "$(dirname "$0")/../.."
target=$(realpath -m "${CARGO_TARGET_DIR:-target}")
source tests/peers/mitsuba/environment.sh
make_environment "$target/peers/mitsuba"
exec "$target/peers/mitsuba/bin/python" tests/peers/boxes/compare.py --photoncard "$photoncard" \
    --folder "$target/peers/boxes" "$@"
