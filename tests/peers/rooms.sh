#!/usr/bin/env bash
# Rooms that others made (Benedikt Bitterli's collection, in Mitsuba's XML) beside Mitsuba's path tracer: errors
# of means over blocks of 12x12 pixels.
#
#   tests/peers/rooms.sh PHOTONCARD [--whole | --map | --furnace] [--seeds N] [NAME ..] [-- OPTION ..]
#   tests/peers/rooms.sh PHOTONCARD --denoised [--long PIXELS] [--seconds S,..] [--samples N] [NAME ..]
#
# --denoised races photoncard and Blender's Cycles, each with and without Open Image Denoise, and Mitsuba in equal
# CPU time (see rooms/denoised.py). References are rendered once, at 960x540 in hours; --long 320 --seconds 3,10
# is short.
#
# All surfaces but glass are made Lambertian, so that both programs have the same; --whole keeps gloss and
# metals, as glTF has them. --map looks at the photon
# map's estimate directly, --furnace at that in a room whose surfaces are white, under an even sky: it is 1, and
# needs no reference. References are rendered once, in minutes each. ROOMS may name the folder of the rooms;
# without it they are fetched. --skip-missing leaves out shapes whose files are absent. PNGs are left in
# target/peers/rooms: reference, picture, errors of blocks.
set -euo pipefail
[ $# -ge 1 ] && [ -x "$1" ] || {
    echo "usage: $0 PHOTONCARD [--whole | --map | --furnace | --denoised] [NAME ..] [-- OPTION ..]" >&2
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
        scenes/{living-room{,-2},staircase,classroom,dining-room,veach-lamp}
}
if [ "${1:-}" = --denoised ]; then
    shift
    source tests/peers/cycles/environment.sh
    make_cycles_environment "$target/peers/cycles"
    "$target/peers/mitsuba/bin/pip" install --quiet --disable-pip-version-check -r tests/peers/rooms/requirements.txt
    PHOTONCARD_OIDN=$(find "$target/peers/mitsuba" -name libOpenImageDenoise.so.2 | head -n 1)
    export PHOTONCARD_OIDN
    exec "$target/peers/mitsuba/bin/python" tests/peers/rooms/denoised.py --photoncard "$photoncard" \
        --cycles "$target/peers/cycles/bin/python" --rooms "$rooms" --folder "$target/peers/rooms" "$@"
fi
exec "$target/peers/mitsuba/bin/python" tests/peers/rooms/compare.py --photoncard "$photoncard" \
    --rooms "$rooms" --folder "$target/peers/rooms" "$@"
