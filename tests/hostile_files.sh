#!/usr/bin/env bash
# 100,000 damaged images and 20,000 damaged scenes, read in processes of 4 GB of address space: no panic, no signal, nothing over
# 20 s. About a quarter of an hour on one core. Options go to the example `hostile`; SEED chooses other inputs.
set -euo pipefail
cd "$(dirname "$0")/.."
target=$(realpath -m "${CARGO_TARGET_DIR:-target}")
cargo build --release --quiet -p photoncard
cargo build --release --quiet -p photoncard-tests --example hostile
status=0
for run in "images 100000" "scenes 20000"; do
    read -r kind inputs <<<"$run"
    "$target/release/examples/hostile" "$kind" --inputs "$inputs" --seed "${SEED:-1}" --command "$target/release/photoncard" \
        --folder "$target/hostile/$kind" "$@" || status=1
done
exit "$status"
