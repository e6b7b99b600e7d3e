#!/usr/bin/env bash
# The ray caster beside Embree 3: the same incoherent rays in the same scene, taken in turns on one thread, by the processor's
# time. Prints rays a second, the median of some rounds. Embree's triangles are told apart less exactly than photoncard's, which
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
"$target/release/examples/rays" "$scene" --write "$folder" --repeat 1 | sed -n 1p
for _ in $(seq "$rounds"); do
    "$target/release/examples/rays" "$scene" --repeat 3 | tail -n +2
    "$folder/embree" "$folder" 3 fast
    "$folder/embree" "$folder" 3 watertight
done >"$folder/rounds"

# The median of the rays a second of a program, to the first triangle or any.
median() {
    awk -v who="$1" -v which="$2:" '$1 == who && $2 == which { print $3 }' "$folder/rounds" |
        sort -n | sed -n "$(((rounds + 1) / 2))p"
}
for which in closest any; do
    ours=$(median photoncard $which)
    for peer in embree-fast embree-watertight; do
        awk -v which="$which" -v peer="$peer" -v ours="$ours" -v theirs="$(median "$peer" $which)" \
            'BEGIN { printf "%s: photoncard %d, %s %d rays a second: %.2f times\n", which, ours, peer, theirs, ours / theirs }'
    done
done
# All meet as many triangles, and as far away, but for the last digits.
awk '{ hits[$2] = hits[$2] " " $7 } $2 == "closest:" { sub(";", "", $14); if (!first) first = $14; d = $14 / first - 1; if (d * d > 1e-10) exit 1 }
    END { for (which in hits) { n = split(hits[which], all, " "); for (i in all) if (all[i] != all[1]) exit 1 } }' "$folder/rounds" || {
    echo "$0: what was met differs" >&2
    awk '{ $3 = ""; print }' "$folder/rounds" | sort -u >&2
    exit 1
}
