#!/usr/bin/env bash
# The qualities of `photoncard render`, and a grid of settings: errors over CPU seconds, as CSV.
#
#   tests/peers/quality.sh PHOTONCARD [--sweep] [--mitsuba] [--cycles] [--peers-only] [SCENE ...]
#
# PHOTONCARD is the command. Scenes are those that ship, against the pictures of tests/references, and files of others that surfaces.sh and
# room.sh leave below cargo's target folder, against pictures of Cycles, which are rendered once: half an hour for the room, ten minutes for the
# other files. Without any scene, all that there are.
set -euo pipefail
photoncard=$(realpath "$1")
shift
cd "$(dirname "$0")/../.."
target=$(realpath -m "${CARGO_TARGET_DIR:-target}")
source tests/peers/mitsuba/environment.sh
source tests/peers/cycles/environment.sh
make_environment "$target/peers/mitsuba"
python=$target/peers/mitsuba/bin/python
if [[ " $* " = *" --cycles "* ]] || [ -e "$target/peers/surfaces" ] || [ -e "$target/peers/room" ]; then
    make_cycles_environment "$target/peers/cycles"
fi
# The reference that is not in tests/references: half an hour on two cores.
if [ ! -e "$target/peers/references/atrium.exr" ]; then
    "$python" tests/peers/mitsuba/converge.py scenes/atrium.glb --error 0.004 --every 8 \
        --work "$target/peers/references" --output "$target/peers/references/atrium.exr" >&2
fi
exec "$python" tests/peers/mitsuba/quality.py --photoncard "$photoncard" --peers "$target/peers" "$@"
