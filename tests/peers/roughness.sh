#!/usr/bin/env bash
# Metals and dielectrics from smooth to rough, rendered by GGX, beside Mitsuba's path tracer.
#
#   tests/peers/roughness.sh [OPTION ...]
#
# Options go to `photoncard render`, instead of its own. The reference is rendered by Mitsuba 3 once, in some minutes.
# PHOTONCARD may name a command that is built.
set -euo pipefail
cd "$(dirname "$0")/../.."
target=$(realpath -m "${CARGO_TARGET_DIR:-target}")
source tests/peers/mitsuba/environment.sh
make_environment "$target/peers/mitsuba"
photoncard=${PHOTONCARD:-}
[ -n "$photoncard" ] || {
    cargo build --release --quiet -p photoncard
    photoncard="$target/release/photoncard"
}
exec "$target/peers/mitsuba/bin/python" tests/peers/mitsuba/roughness.py --photoncard "$photoncard" \
    --folder "$target/peers/roughness" "$@"
