#!/usr/bin/env bash
# 100,000 damaged images, 20,000 damaged scenes, and 50,000 damaged files that the command keeps, half of them damaged while it works, read
# in processes of 4 GB of address space: no panic, no signal, nothing over 20 s, and of kept files no other picture. About an hour on one core. Options go to the example `hostile`; SEED chooses other inputs.
set -euo pipefail
cd "$(dirname "$0")/.."
target=$(realpath -m "${CARGO_TARGET_DIR:-target}")
cargo build --release --quiet -p photoncard
cargo build --release --quiet -p photoncard-tests --example hostile
status=0
for run in "images 100000" "scenes 20000" "cards 12500" "parts 12500" "partials 12500" "frames 12500"; do
    read -r kind inputs <<<"$run"
    "$target/release/examples/hostile" "$kind" --inputs "$inputs" --seed "${SEED:-1}" --command "$target/release/photoncard" \
        --folder "$target/hostile/$kind" "$@" || status=1
done
exit "$status"
