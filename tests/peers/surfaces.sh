#!/usr/bin/env bash
# Surfaces beside Blender's Cycles: glTF files of others, and balls with one feature of glTF's materials each, in the same surroundings.
#
#   tests/peers/surfaces.sh PHOTONCARD [NAME | FILE ...] [-- OPTION ...]
#
# renders files by their names in tests/peers/packages.sh, probes (probe-metal, ...), or files of one's own, .gltf or .glb, with the binary
# PHOTONCARD and with Cycles: one lamp, a dim sky and a camera are put around the model. Without names: all of the default list.
# It prints the mean over that of Cycles, and the median and the 95th percentile of the errors of blocks of 16x16 pixels;
# the noise of both programs in the last two; and CPU seconds. Beside each staged scene in target/peers/surfaces is a PNG: photoncard, the
# absolute difference, Cycles. Options:
#
#   --without FEATURE,..   takes features from the materials: normal, clearcoat, blend, gloss (Lambertian), ...
#   --each                 renders each file also without each feature that it has
#   --model principled     Blender's own reflection model instead of glTF's (cycles/gltf.osl)
#   --samples N            samples a pixel of Cycles [512]; its pictures are kept
#   --options "..."        options of photoncard
set -euo pipefail
[ $# -ge 1 ] && [ -x "$1" ] || {
    echo "usage: $0 PHOTONCARD [NAME | FILE ...] [-- OPTION ...]: PHOTONCARD is the binary to render with, target/release/photoncard" >&2
    exit 2
}
photoncard=$(realpath "$1")
shift
names=()
while [ $# != 0 ] && [ "$1" != -- ]; do
    case $1 in
        *.gltf | *.glb) names+=("$(realpath "$1")") ;;
        *) names+=("$1") ;;
    esac
    shift
done
[ $# = 0 ] || shift
cd "$(dirname "$0")/../.."
source tests/peers/packages.sh
source tests/peers/cycles/environment.sh
target=$(realpath -m "${CARGO_TARGET_DIR:-target}")
folder=$target/peers/surfaces
make_cycles_environment "$target/peers/cycles"
python=$target/peers/cycles/bin/python
"$python" tests/peers/cycles/probes.py "$folder/probes"
[ ${#names[@]} != 0 ] || {
    names=(flight-helmet duck head camera valve-index galaxy-xr magicleap trigger hand scenes/roughness.glb)
    for probe in "$folder"/probes/*.glb; do names+=("$(basename "$probe" .glb)"); done
}
files=()
for name in "${names[@]}"; do
    case $name in
        *.gltf | *.glb) files+=("$name") ;;
        probe-*) files+=("$folder/probes/$name.glb") ;;
        *)
            read -r _ package path _ < <(files | grep "^$name ") || {
                echo "$0: there is no file $name; there are: $(files | cut -d' ' -f1 | tr '\n' ' ')" >&2
                exit 2
            }
            files+=("$name=$(package_file "$package" "$path")")
            ;;
    esac
done
exec "$python" tests/peers/cycles/surfaces.py --photoncard "$photoncard" --folder "$folder" "${files[@]}" "$@"
