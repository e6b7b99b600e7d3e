#!/usr/bin/env bash
# DRAM of one chip by the simulator DRAMsim3: bandwidth, open rows and energy of a frame for every order of the gathers.
#
#   tests/peers/dram.sh [SCENE] [-- OPTION ...]      scenes/cornell.gltf without any
#
# The options after -- go to `photoncard render` in place of `--quality paper --size 64x64`. CONFIG names a memory of DRAMsim3's folder `configs`,
# by default LPDDR4_8Gb_x16_2400, whose burst is a line of card memory; another burst is refused. IN_FLIGHT is the number of reads that the chip
# may wait for, by default 32. The sources of DRAMsim3 are fetched once, at a fixed commit, from DRAMSIM3, an address or a folder for git.
# PHOTONCARD may name a command that is built.
set -euo pipefail
cd "$(dirname "$0")/../.."
commit=29817593b3389f1337235d63cac515024ab8fd6e
origin=${DRAMSIM3:-https://github.com/umd-memsys/DRAMsim3}
config=${CONFIG:-LPDDR4_8Gb_x16_2400}
in_flight=${IN_FLIGHT:-32}
line_bytes=128
target=$(realpath -m "${CARGO_TARGET_DIR:-target}")
folder=$target/peers/dramsim3
sources=$folder/sources
orders=(naive tiled dirbin hash sort buckets)

fail() {
    echo "$0: $*" >&2
    exit 1
}

for tool in git g++ gzip awk jq; do
    command -v "$tool" >/dev/null || fail "$tool is missing; install it with the system's package manager"
done

fetch_sources() {
    [ -d "$sources" ] && return
    rm -rf "$sources.partial"
    git init --quiet "$sources.partial"
    git -C "$sources.partial" fetch --quiet --depth 1 "$origin" "$commit" ||
        fail "the sources of DRAMsim3 cannot be had from $origin; set DRAMSIM3 to a folder or an address that has commit $commit"
    git -C "$sources.partial" checkout --quiet FETCH_HEAD
    mv "$sources.partial" "$sources"
}

build() {
    local files=(bankstate channel_state command_queue common configuration controller dram_system hmc refresh simple_stats timing memory_system)
    local replay=tests/peers/dramsim3/replay.cc
    [ "$folder/replay" -nt "$replay" ] && return
    local units=("${files[@]/#/$sources/src/}")
    units=("${units[@]/%/.cc}")
    # DRAMsim3 warns; the standard is the one it was written for.
    g++ -O2 -std=c++11 -w -DFMT_HEADER_ONLY=1 -I "$sources/src" -I "$sources/ext/headers" -I "$sources/ext/fmt/include" \
        "${units[@]}" "$replay" -o "$folder/replay"
}

# Renders an order, replays the lines that it fetched, and prints a row.
measure() {
    local order=$1 row lines fetched
    "$photoncard" render "$scene" "${options[@]}" --order "$order" --card emulated:1 --counters --stats "$files/stats.json" \
        --trace "$files/trace.gz" --trace-format dramsim3 -o "$files/out.exr" --quiet
    row=$(gzip -dc "$files/trace.gz" | "$folder/replay" "$configuration" "$files" "$in_flight")
    fetched=$(jq '.memory | .photon_map.dram_bytes + .scene.dram_bytes + .waiting.dram_bytes + .tile_written_bytes' "$files/stats.json")
    lines=${row%% *}
    [ $((lines * line_bytes)) = "$fetched" ] || fail "$order: $lines lines were replayed, but $fetched bytes were counted"
    awk -v order="$order" -v bytes="$fetched" '{
        printf "%-7s %9.1f MB %7.2f ms %6.2f GB/s %5.1f %% open rows %8.3f mJ\n",
            order, bytes / 1e6, $2 / 1e6, bytes / $2, 100 * $3 / $1, $4 / 1e9
    }' <<<"$row"
}

scene=scenes/cornell.gltf
[ "${1:---}" = -- ] || {
    scene=$1
    shift
}
options=(--quality paper --size 64x64)
[ "${1:-}" != -- ] || options=("${@:2}")
mkdir -p "$folder"
fetch_sources
configuration=$sources/configs/$config.ini
[ -f "$configuration" ] || fail "DRAMsim3 has no memory $config; see $sources/configs"
burst=$(awk -F ' *= *' '$1 == "BL" { length_ = $2 } $1 == "bus_width" { width = $2 } END { print length_ * width / 8 }' "$configuration")
[ "$burst" = "$line_bytes" ] || fail "a burst of $config has $burst bytes, and a line of the trace $line_bytes"
build
photoncard=${PHOTONCARD:-}
[ -n "$photoncard" ] || {
    cargo build --release --quiet -p photoncard
    photoncard=$target/release/photoncard
}
files=$(mktemp -d)
trap 'rm -rf "$files"' EXIT
echo "$scene ${options[*]}: $config, $in_flight reads in flight"
for order in "${orders[@]}"; do
    measure "$order"
done
