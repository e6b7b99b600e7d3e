#!/usr/bin/env bash
# The search for the nearest photons beside that of kiddo: the same million points, the same searches, taken in turns on one
# thread. Prints searches a second, the median of some rounds, and the sum of what was found, which is the same for both.
set -euo pipefail
cd "$(dirname "$0")/../.."
rounds=${1:-5}
target=${CARGO_TARGET_DIR:-target}
folder=$(mktemp -d)
trap 'rm -rf "$folder"' EXIT

# The median of the searches a second of a program, in an order.
median() {
    awk -v who="$1" -v order="$2:" '$1 == who && $2 == order { print $3 }' "$folder/rounds" |
        sort -n | sed -n "$(((rounds + 1) / 2))p"
}

cargo build --release --quiet -p photoncard-tests --example nearest
# A processor's own instructions are chosen when kiddo is compiled.
RUSTFLAGS="-C target-cpu=native" cargo build --release --quiet --manifest-path tests/peers/kiddo/Cargo.toml \
    --target-dir "$target/peers"
"$target/release/examples/nearest" --write "$folder" --repeat 1 >/dev/null
for _ in $(seq "$rounds"); do
    "$target/release/examples/nearest" --repeat 3
    "$target/peers/release/photoncard-peer-kiddo" "$folder" 3
done >"$folder/rounds"
for order in random hilbert; do
    awk -v order="$order" -v ours="$(median photoncard $order)" -v theirs="$(median kiddo $order)" \
        'BEGIN { printf "%s: photoncard %d, kiddo %d searches a second: %.2f times\n", order, ours, theirs, ours / theirs }'
done
[ "$(awk '{ print $NF }' "$folder/rounds" | sort -u | wc -l)" = 1 ] || {
    echo "$0: what was found differs" >&2
    exit 1
}
