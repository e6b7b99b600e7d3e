#!/usr/bin/env bash
# Rooms that others made (Benedikt Bitterli's collection, in Mitsuba's XML) beside Mitsuba's path tracer: errors
# of means over blocks of 12x12 pixels.
#
#   tests/peers/rooms.sh PHOTONCARD [--whole | --map | --furnace] [--seeds N] [NAME ..] [-- OPTION ..]
#
# All surfaces but glass are made Lambertian, so that both programs have the same; --whole keeps gloss and
# metals, as glTF has them. --map looks at the photon
# map's estimate directly, --furnace at that in a room whose surfaces are white, under an even sky: it is 1, and
# needs no reference. References are rendered once, in minutes each. ROOMS may name the folder of the rooms;
# without it they are fetched. PNGs are left in target/peers/rooms: reference, picture, errors of blocks.
set -euo pipefail
[ $# -ge 1 ] && [ -x "$1" ] || {
    echo "usage: $0 PHOTONCARD [--whole | --map | --furnace] [NAME ..] [-- OPTION ..]" >&2
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
    git -C "$target/peers/dppm-scenes" sparse-checkout set \
        scenes/{living-room{,-2},staircase,classroom,dining-room}
}
exec "$target/peers/mitsuba/bin/python" tests/peers/rooms/compare.py --photoncard "$photoncard" \
    --rooms "$rooms" --folder "$target/peers/rooms" "$@"
