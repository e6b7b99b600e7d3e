#!/usr/bin/env bash
# Counts the instructions of a gather of 100 photons and of a gather ray, in one tile of the Cornell box on the micro chip: on
# this processor by Valgrind, on the boards of QEMU by a clock that ticks once for each instruction.
set -euo pipefail
cd "$(dirname "$0")/.."
target=${CARGO_TARGET_DIR:-target}
cargo=${CARGO:-cargo}

for tool in valgrind qemu-system-arm qemu-system-riscv32; do
    command -v "$tool" >/dev/null || {
        echo "$0: $tool is missing; run: sudo apt-get install valgrind qemu-system-arm qemu-system-misc" >&2
        exit 1
    }
done
files=$(mktemp -d)
trap 'rm -rf "$files"' EXIT

# Takes lines of a work, its eye rays, gather rays, gathers and instructions; prints what one of each costs.
costs() {
    awk -v name="$1" '
        { eye[$1] = $2; rays[$1] = $3; gathers[$1] = $4; count[$1] = $5 }
        END {
            if (!rays["Rays"] || gathers["Rays"] || rays["Gathers"] != rays["Rays"]) exit 1
            ray = (count["Rays"] - count["Eye"]) / rays["Rays"]
            gather = (count["Gathers"] - count["Rays"]) / gathers["Gathers"]
            printf "%-12s %7.0f a gather, %6.0f a gather ray; %d gathers, %d rays\n",
                name, gather, ray, gathers["Gathers"], rays["Gathers"]
        }'
}

on_this_processor() {
    local work line
    for work in Eye Rays Gathers; do
        line=$(valgrind --tool=callgrind --callgrind-out-file=/dev/null --toggle-collect='*measured*' \
            "$example" render "$files/memory" "$work" 2>"$files/valgrind") || {
            cat "$files/valgrind" >&2
            return 1
        }
        echo "$line $(awk '/Collected/ { print $NF }' "$files/valgrind")"
    done
}

# A millisecond of the board's clock is a million instructions.
on_a_board() {
    local image=$1 triple=$2 address=$3
    shift 3
    "$cargo" build --quiet --locked -p photoncard-firmware --bin "$image" --features "board-$image,measure" \
        --target "$triple" --profile card
    "$@" -icount shift=0 -display none -monitor none -serial none -semihosting-config enable=on,target=native \
        -device "loader,file=$files/memory,addr=$address,force-raw=on" -kernel "$target/$triple/card/$image" 2>&1 |
        awk '/^(Eye|Rays|Gathers) / { $5 *= 1000000; print; next } { print > "/dev/stderr" }'
}

"$cargo" build --quiet --locked --release -p photoncard-tests --example instructions
example=$target/release/examples/instructions
"$example" write "$files/memory"
on_this_processor | costs "$(uname -m)"
on_a_board mps2-an386 thumbv7em-none-eabihf 0x21000000 qemu-system-arm -machine mps2-an386 | costs mps2-an386
on_a_board virt-riscv32 riscv32imafc-unknown-none-elf 0x81000000 \
    qemu-system-riscv32 -machine virt -bios none -m 64M | costs virt
