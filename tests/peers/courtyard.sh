#!/usr/bin/env bash
# Memory traffic in a courtyard of the size and kind of the Sponza atrium, by Blender's modifiers and its own glTF export, beside scenes/atrium.glb.
#
#   tests/peers/courtyard.sh PHOTONCARD [--photons N,..] [--sample SHARE] [--large-chip]
#
# prints the GB of a frame from DRAM, photon map and scene, by the settings of `photoncard study scaling`: naive with Jensen's tree, `sort` alone,
# exact reordering (lines, tiles of 64x64), all techniques, and the times that each reads less than naive; by default at 500,000 and 2,000,000
# photons, of sampled tiles. --large-chip adds the large chip with 4 tiles in flight, in whole frames on one thread.
#
# The courtyard has some 267,000 triangles of very uneven size, 41 images (colour, metallic-roughness, normals), alpha-masked leaves, curtains
# with two sides, shared and mirrored meshes, lanterns, a sun, and light of a sky (--environment). courtyard-plain has no images but the leaves':
# the difference is what textures cost. Files and reports are in target/peers/courtyard. Finished points are kept there, by the content of
# the scene: remove the folder after a change of photoncard.
set -euo pipefail
[ $# -ge 1 ] && [ -x "$1" ] || {
    echo "usage: $0 PHOTONCARD [--photons N,..] [--sample SHARE] [--large-chip]: PHOTONCARD is the binary to measure, target/release/photoncard" >&2
    exit 2
}
photoncard=$(realpath "$1")
shift
cd "$(dirname "$0")/../.."
source tests/peers/cycles/environment.sh
target=$(realpath -m "${CARGO_TARGET_DIR:-target}")
folder=$target/peers/courtyard
make_cycles_environment "$target/peers/cycles"
python=$target/peers/cycles/bin/python
mkdir -p "$folder"

# Makes a scene. Blender's exporter reports on the standard error at length.
model() {
    local file=$folder/$1.glb log=$folder/$1.log
    "$python" tests/peers/courtyard/courtyard.py "$file" "${@:2}" 2>"$log" || {
        cat "$log" >&2
        exit 1
    }
}

model courtyard
model courtyard-plain --plain
sky="--environment 0.8,1.1,1.6"
exec "$python" tests/peers/courtyard/measure.py --photoncard "$photoncard" --folder "$folder/sweeps" "$@" \
    --scenes "$folder/courtyard.glb,$sky" "$folder/courtyard-plain.glb,$sky" scenes/atrium.glb
