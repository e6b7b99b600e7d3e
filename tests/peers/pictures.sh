#!/usr/bin/env bash
# Whole pictures beside those of Mitsuba 3: RMSE against a converged picture, over the CPU seconds that it took.
#
#   tests/peers/pictures.sh [SCENE ...]      cornell, atrium; both without any
#
# What it takes for Mitsuba goes into a virtual environment below cargo's target folder, and so do pictures. A reference is
# rendered by Mitsuba once, which takes the longest: minutes for the Cornell box, half an hour for the atrium on two cores.
# A converged picture of one's own may be put in its place: pictures/SCENE-512x512-reference.exr in that folder.
set -euo pipefail
cd "$(dirname "$0")/../.."
target=$(realpath -m "${CARGO_TARGET_DIR:-target}")
source tests/peers/mitsuba/environment.sh
make_environment "$target/peers/mitsuba"
cargo build --release --quiet -p photoncard
exec "$target/peers/mitsuba/bin/python" tests/peers/mitsuba/pictures.py --photoncard "$target/release/photoncard" \
    --folder "$target/peers/pictures" "$@"
