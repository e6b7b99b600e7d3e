#!/usr/bin/env bash
# Cameras in a room that others made (Benedikt Bitterli's collection) beside Mitsuba's path tracer: pinhole, lens
# shift, thin lens, orthographic, panorama. Errors of means over blocks of 12x12 pixels.
#
#   tests/peers/cameras.sh PHOTONCARD [--seeds N] [--passes N] [--camera CAMERA] [NAME ..] [-- OPTION ..]
#
# Surfaces are made Lambertian, so that both programs have the same. References take minutes each. ROOMS may name
# the folder of the rooms; without it they are fetched. PNGs are left in target/peers/rooms: reference, picture.
set -euo pipefail
[ $# -ge 1 ] && [ -x "$1" ] || {
    echo "usage: $0 PHOTONCARD [--seeds N] [--passes N] [--camera CAMERA] [NAME ..] [-- OPTION ..]" >&2
    exit 2
}
photoncard=$(realpath "$1")
shift
cd "$(dirname "$0")/../.."
target=$(realpath -m "${CARGO_TARGET_DIR:-target}")
source tests/peers/mitsuba/environment.sh
make_environment "$target/peers/mitsuba"
rooms=${ROOMS:-$target/peers/dppm-scenes/scenes}
[ -e "$rooms" ] || {
    source=https://github.com/hchoi405/dppm-scenes
    git clone --quiet --depth 1 --filter=blob:none --sparse "$source" "$target/peers/dppm-scenes"
    git -C "$target/peers/dppm-scenes" sparse-checkout set scenes/{living-room{,-2},staircase,dining-room}
}
exec "$target/peers/mitsuba/bin/python" tests/peers/rooms/cameras.py --photoncard "$photoncard" \
    --rooms "$rooms" --folder "$target/peers/rooms" "$@"
