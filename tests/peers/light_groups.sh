#!/usr/bin/env bash
# Light groups of photoncard beside those of Cycles, in a room by Blender's own export (light_groups.py).
#
#   tests/peers/light_groups.sh PHOTONCARD [PYTHON] [-- OPTION ..]
#
# PYTHON has the packages bpy 5.0, numpy and OpenEXR.
set -euo pipefail
photoncard=$(realpath "$1")
shift
python=python3
[ $# -eq 0 ] || [ "$1" = -- ] || { python=$1 && shift; }
[ "${1:-}" != -- ] || shift
cd "$(dirname "$0")/../.."
folder=${FOLDER:-$(mktemp -d)}
mkdir -p "$folder"
"$python" tests/peers/light_groups.py make "$folder"
for cache in on off; do
    "$photoncard" render "$folder/room.glb" --light-groups file --light-groups sky=environment --size 320x240 --environment 0.3,0.45,0.8 --irradiance-cache "$cache" \
        --aov none --quiet -o "$folder/room-$cache.exr" "$@"
    "$photoncard" mix "$folder/room-$cache.exr" -o "$folder/same.exr"
    cmp "$folder/room-$cache.exr" "$folder/same.exr"
    echo "irradiance cache $cache: a mix without gains has the bytes of the picture"
    "$python" tests/peers/light_groups.py compare "$folder" "$folder/room-$cache.exr"
done
