#!/usr/bin/env bash
# The qualities of `photoncard render`, and settings around them: errors over CPU seconds, as CSV.
#
#   tests/peers/quality.sh PHOTONCARD [--sweep] [--mitsuba] [--cycles] [--peers-only] [SCENE ...]
#
# PHOTONCARD is the command. Scenes are those that ship, against the pictures of tests/references, and files of others that surfaces.sh and
# room.sh leave below cargo's target folder, against pictures of Cycles; without any, all that there are.
set -euo pipefail
photoncard=$(realpath "$1")
shift
cd "$(dirname "$0")/../.."
target=$(realpath -m "${CARGO_TARGET_DIR:-target}")
source tests/peers/mitsuba/environment.sh
source tests/peers/cycles/environment.sh
make_environment "$target/peers/mitsuba"
python=$target/peers/mitsuba/bin/python
references=$target/peers/references
# The references that are not in tests/references: half an hour on two cores each.
if [ ! -e "$references/atrium.exr" ]; then
    "$python" tests/peers/mitsuba/converge.py scenes/atrium.glb --error 0.004 --every 8 \
        --work "$references" --output "$references/atrium.exr" >&2
fi
room=$target/peers/room/room.glb
if [[ " $* " = *" --cycles "* ]] || [ -e "$room" ]; then
    make_cycles_environment "$target/peers/cycles"
fi
for half in 1 2; do
    picture=$references/blender-room-$half
    if [ -e "$room" ] && [ ! -e "$picture.exr" ]; then
        "$target/peers/cycles/bin/python" tests/peers/cycles/quality.py "$room" --built --size 192x192 --samples 4096 \
            --seeds "$half" --outputs "$picture.unfinished.exr" >&2
        mv "$picture.unfinished.exr" "$picture.exr"
    fi
done
exec "$python" tests/peers/mitsuba/quality.py --photoncard "$photoncard" --peers "$target/peers" "$@"
