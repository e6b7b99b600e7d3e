#!/usr/bin/env bash
# Compares the poses of animated glTF files, of packages and of this project, with an independent evaluation (poses.py): docs/animation.md.
#
#   tests/peers/poses.sh
#
# It needs curl, tar, Python 3 and 0.4 MB of packages (packages.sh), which are kept below cargo's target folder.
set -euo pipefail
cd "$(dirname "$0")/../.."
source tests/peers/packages.sh
cargo build --quiet --package photoncard-tests --example poses
poses=${CARGO_TARGET_DIR:-target}/debug/examples/poses

# Package or "-", path, animation, and moments in seconds.
scenes() {
    local outline=bevy_mod_outline-0.13.0/assets
    cat <<END
bevy_mod_outline $outline/Fox.glb Survey 0 0.1 0.37 1.1 2.9 7
bevy_mod_outline $outline/Fox.glb Walk 0 0.1 0.37 0.7083 7
bevy_mod_outline $outline/Fox.glb Run 0 0.1 0.37 1.1 7
bevy_mod_outline $outline/MorphStressTest.gltf Individuals 0 0.37 2.9 7
bevy_mod_outline $outline/MorphStressTest.gltf Pulse 0 0.37 2.9 6
bevy_mod_outline $outline/MorphStressTest.gltf TheWave 0 0.37 1.1 1.9
- scenes/cornell-moving.glb play 0 0.1 0.3 0.6 0.9 1.7 3
END
}

while read -r package path animation moments; do
    file=$path
    [ "$package" = - ] || file=$(package_file "$package" "$path")
    for moment in $moments; do
        "$poses" "$file" "$moment" "$animation" | python3 tests/peers/poses.py "$file" "$moment" "$animation"
    done
done < <(scenes)
