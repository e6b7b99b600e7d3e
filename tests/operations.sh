#!/usr/bin/env bash
# Counts the floating-point operations of the firmware: runs it without floating-point instructions, where each operation is a call.
#
#   tests/operations.sh report     operations of each unit for a ray and for a gather of several scenes, counted and by the table
#   tests/operations.sh table      writes the operations of a step, driver/render/src/cost_model/arithmetic/table.rs
#
# It takes about a minute on Linux and x86-64, and the target x86_64-unknown-none. tests/tests/it/operations.rs checks the table.
set -euo pipefail
cd "$(dirname "$0")/.."
table=driver/render/src/cost_model/arithmetic/table.rs
case ${1:-} in
    report) cargo run --quiet -p photoncard-tests --example operations report ;;
    table)
        written=$(mktemp)
        trap 'rm -f "$written"' EXIT
        cargo run --quiet -p photoncard-tests --example operations table >"$written"
        cp "$written" "$table"
        ;;
    *)
        echo "usage: $0 report | table" >&2
        exit 2
        ;;
esac
