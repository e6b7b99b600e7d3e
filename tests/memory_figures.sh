#!/usr/bin/env bash
# Writes docs/memory.csv and the table of docs/memory.md from the command that the page names, some 15 minutes of one core.
#
# Each row has the version of the program. The first row of the CSV is a small picture, which a test renders again: figures of another program do not stay unnoticed.
# Usage: tests/memory_figures.sh [PHOTONCARD]
set -euo pipefail
cd "$(dirname "$0")/.."
photoncard=${1:-target/release/photoncard}
csv=docs/memory.csv
version=$("$photoncard" --version | head -n 1)
scratch=$(mktemp -d)
trap 'rm -r "$scratch"' EXIT

# row SCENE RAYS CARD SIDE OPTION...: bytes from DRAM of the photon map and of the scene, of a square picture.
row() {
    local scene=$1 rays=$2 card=$3 side=$4
    shift 4
    "$photoncard" render "scenes/$scene" -o "$scratch/out.exr" --quality paper --size "${side}x$side" --aov none \
        --gather-rays "$rays" --counters --card "$card:1" --stats "$scratch/stats.json" "$@" 2>"$scratch/messages" || {
        cat "$scratch/messages" >&2
        return 1
    }
    python3 - "$scratch/stats.json" "$scene,$rays,$card,$side" "$version" <<'PYTHON'
import json, sys
memory = json.load(open(sys.argv[1]))["memory"]
print(sys.argv[2], *(memory[part]["dram_bytes"] for part in ("photon_map", "scene")), sys.argv[3], sep=",")
PYTHON
}
# naive_row SCENE: the naive frame of 512x512 pixels by 32 of its rows, which share nothing: a tile is a row of 16 pixels.
naive_row() {
    local first
    for first in 30 94 158 222 286 350 414 478; do
        row "$1" 100 emulated 512 --crop "0,512,$first,$((first + 4))" "${naive[@]}"
    done | awk -F, '{ photons += $5; scene += $6 }
        END { printf "%s,%s,naive,%s,%.0f,%.0f,%s\n", $1, $2, $4, 16 * photons, 16 * scene, $7 }'
}
all_techniques=(--irradiance-cache on --ic-error 0.025)
naive=(--order naive --photon-map jensen --sampling brdf)

{
    echo "scene,gather_rays,card,side,photon_map_bytes,scene_bytes,program"
    row cornell.gltf 21 emulated 48 "${all_techniques[@]}"
    for scene in cornell.gltf atrium.glb; do
        naive_row "$scene"
    done
    for of_rows in "cornell.gltf 21" "cornell.gltf 100" "atrium.glb 78"; do
        for card in emulated emulated-large; do
            read -r scene rays <<<"$of_rows"
            row "$scene" "$rays" "$card" 512 "${all_techniques[@]}"
        done
    done
} >"$scratch/figures.csv"
cp "$scratch/figures.csv" "$csv"
UPDATE_DOCS=1 cargo test -q -p photoncard-tests --locked --test it measured_tables::memory
