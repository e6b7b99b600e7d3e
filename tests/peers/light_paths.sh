#!/usr/bin/env bash
# Pictures of mirrors, glass, textures and a sky beside path-traced ones: by how much means of blocks differ.
#
#   tests/peers/light_paths.sh [SCENE ...] [-- OPTION ...]      cornell-spheres, room, atrium-sky; all without any
#
# The options after -- go to `photoncard render` in place of `--spp 16 --photons 1000000 --gather-rays 200`. The references are
# those of tests/references; one that is not there is rendered by Mitsuba 3, which takes an hour or so, and put there. PHOTONCARD
# may name a command that is built.
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
exec "$target/peers/mitsuba/bin/python" tests/peers/mitsuba/light_paths.py --photoncard "$photoncard" \
    --folder "$target/peers/light-paths" "$@"
