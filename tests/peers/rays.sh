#!/usr/bin/env bash
# The ray caster beside Embree 3: the same rays in the same scene, taken in turns on one thread, by the processor's time. Incoherent rays
# are cast one at a time; rays of which sixteen have a place and a cell of the hemisphere in common also in bundles, and by Embree in
# packets. Prints rays a second, the median of some rounds. Embree's triangles are told apart less exactly than photoncard's, which
# loses no ray at an edge: Embree's own watertight mode is measured as well.
set -euo pipefail
cd "$(dirname "$0")/../.."
scene=${1:-scenes/atrium.glb}
rounds=${2:-5}
target=${CARGO_TARGET_DIR:-target}
folder=$(mktemp -d)
trap 'rm -rf "$folder"' EXIT

command -v g++ >/dev/null && [ -e /usr/include/embree3/rtcore.h ] || {
    echo "$0: Embree 3 or a compiler is missing; run: sudo apt-get install g++ libembree-dev" >&2
    exit 1
}
cargo build --release --quiet -p photoncard-tests --example rays
g++ -O3 -o "$folder/embree" tests/peers/embree/rays.cpp -lembree3
rays() { "$target/release/examples/rays" "$scene" --bundle "$1" --repeat 3 "${@:2}"; }
rays 1 --repeat 1 | sed -n 1p

# The median of the rays a second of a program, to the first triangle or any.
median() {
    awk -v who="$1" -v which="$2:" '$1 == who && $2 == which { print $3 }' "$folder/rounds" |
        sort -n | sed -n "$(((rounds + 1) / 2))p"
}
# Compares what photoncard casts in a way with the peers given.
compare() {
    local ours=$1 which peer
    shift
    for which in closest any; do
        for peer in "$@"; do
            awk -v which="$which" -v who="$ours" -v peer="$peer" -v ours="$(median "$ours" $which)" -v theirs="$(median "$peer" $which)" \
                'BEGIN { printf "%s: %s %d, %s %d rays a second: %.2f times\n", which, who, ours, peer, theirs, ours / theirs }'
        done
    done
}
# All meet as many triangles, but for one ray in a hundred thousand at an edge, and as far away, but for the last digits.
check() {
    awk '$2 == "closest:" { sub(";", "", $14); if (!first) first = $14; d = $14 / first - 1; if (d * d > 1e-10) exit 1 }
        { if (!($2 in hits)) hits[$2] = $7; d = $7 / hits[$2] - 1; if (d * d > 1e-10) exit 1 }' "$folder/rounds" || {
        echo "$0: what was met differs" >&2
        awk '{ $3 = ""; print }' "$folder/rounds" | sort -u >&2
        exit 1
    }
}

# Casts rays of which so many have a place in common, photoncard and Embree in turns: alone, or by packets of the sizes given as well.
cast() {
    local bundle=$1 mode packet
    shift
    rays "$bundle" --write "$folder" --repeat 1 >/dev/null
    for _ in $(seq "$rounds"); do
        rays "$bundle" | tail -n +2
        for mode in fast watertight; do
            for packet in "$@"; do "$folder/embree" "$folder" 3 $mode "$packet"; done
        done
    done >"$folder/rounds"
    check
}

echo "incoherent rays:"
cast 1 1
compare photoncard embree-fast embree-watertight
echo "sixteen rays of a place and a cell:"
cast 16 1 16
compare photoncard-bundles photoncard embree-fast embree-watertight embree-fast-packets embree-watertight-packets
