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

# row SCENE RAYS CARD SIDE ORDER OPTION...: bytes from DRAM of the photon map and of the scene, and bytes read and written for what waits in card memory, of a
# square picture.
row() {
    local scene=$1 rays=$2 card=$3 side=$4 order=$5
    shift 5
    "$photoncard" render "scenes/$scene" -o "$scratch/out.exr" --quality paper --size "${side}x$side" --aov none \
        --gather-rays "$rays" --counters --card "$card:1" --order "$order" --stats "$scratch/stats.json" "$@" 2>"$scratch/messages" || {
        cat "$scratch/messages" >&2
        return 1
    }
    python3 - "$scratch/stats.json" "$scene,$rays,$card,$side,$order" "$version" <<'PYTHON'
import json, sys
memory = json.load(open(sys.argv[1]))["memory"]
waiting = memory["waiting"]["dram_bytes"] + memory["tile_written_bytes"]
print(sys.argv[2], *(memory[part]["dram_bytes"] for part in ("photon_map", "scene")), waiting, sys.argv[3], sep=",")
PYTHON
}
# naive_row SCENE: the naive frame of 512x512 pixels by 32 of its rows, which share nothing: a tile is a row of 16 pixels.
naive_row() {
    local first
    for first in 30 94 158 222 286 350 414 478; do
        row "$1" 100 emulated 512 naive --crop "0,512,$first,$((first + 4))" "${naive[@]}"
    done | awk -F, '{ photons += $6; scene += $7 }
        END { printf "%s,%s,%s,%s,naive,%.0f,%.0f,0,%s\n", $1, $2, $3, $4, 16 * photons, 16 * scene, $9 }'
}
all_techniques=(--irradiance-cache on --ic-error 0.025)
naive=(--photon-map jensen --sampling brdf)

{
    echo "scene,gather_rays,card,side,order,photon_map_bytes,scene_bytes,waiting_bytes,program"
    row cornell.gltf 21 emulated 48 buckets "${all_techniques[@]}"
    for scene in cornell.gltf atrium.glb; do
        naive_row "$scene"
    done
    for of_rows in "cornell.gltf 21" "cornell.gltf 50" "cornell.gltf 100" "atrium.glb 78"; do
        read -r scene rays <<<"$of_rows"
        for of_card in "emulated sort" "emulated buckets" "emulated-large sort" "emulated-large buckets"; do
            read -r card order <<<"$of_card"
            row "$scene" "$rays" "$card" 512 "$order" "${all_techniques[@]}"
        done
    done
} >"$scratch/figures.csv"
cp "$scratch/figures.csv" "$csv"
UPDATE_DOCS=1 cargo test -q -p photoncard-tests --locked --test it measured_tables::memory
