#!/usr/bin/env bash
# Writes the figures of docs/bring-up.md that come out of builds, or checks those that it has.
#
# sizes: builds the image of each board and writes their sizes. instructions: runs tests/instructions.sh and writes its counts.
# check: builds the images and compares their sizes with the page's; they must fit the flash of a board, without initial values of data. Another compiler gives other sizes: a figure may be off by
# 5 %, and anything above is a failure.
set -euo pipefail
cd "$(dirname "$0")/.."
page=docs/bring-up.md
tolerance=5
# Flash that docs/bring-up.md asks of a board, bytes: with an Arm processor, and with RISC-V.
flash=$((512 * 1024))
flash_of_riscv=$((544 * 1024))

images=(mps2-an386 mps2-an386-tcp virt-riscv32 stm32h747i-disco)
declare -A target_of=(
    [mps2-an386]=thumbv7em-none-eabihf
    [mps2-an386-tcp]=thumbv7em-none-eabihf
    [stm32h747i-disco]=thumbv7em-none-eabihf
    [virt-riscv32]=riscv32imafc-unknown-none-elf
)

# Replaces the text between the marks of a block by standard input.
replace_block() {
    local new
    new=$(mktemp)
    awk -v name="$1" '
        FNR == NR { text = text $0 "\n"; next }
        index($0, "<!-- end of " name " -->") { inside = 0; ends = 1 }
        !inside
        index($0, "<!-- " name ":") { printf "%s", text; inside = 1 }
        END { exit !ends }' - "$page" >"$new" || {
        echo "$0: $page has no block $1" >&2
        return 1
    }
    cat "$new" >"$page"
    rm "$new"
}

# Lines of the table in a block of the page.
block() {
    awk -v name="$1" '
        index($0, "<!-- end of " name " -->") { inside = 0 }
        inside && /^\|/
        index($0, "<!-- " name ":") { inside = 1 }' "$page"
}

build() {
    local image
    for image in "${images[@]}"; do
        echo "$0: building the image of $image" >&2
        "${CARGO:-cargo}" build --quiet --locked -p photoncard-firmware --bin "$image" --features "board-$image" \
            --target "${target_of[$image]}" --profile card
    done
}

# Name, code, constants, initialised data, zeroed data, stack and flash of an image. Flash holds everything that is loaded: code,
# constants, tables, and the initial values of data.
sizes_of() {
    local image=$1 elf="${CARGO_TARGET_DIR:-target}/${target_of[$1]}/card/$1"
    "$(rustc --print target-libdir)/../bin/llvm-size" -A "$elf" | awk -v image="$image" '
        $1 ~ /^\.(vector_table|text|init|rodata|eh_frame|data)/ { flash += $2 }
        $1 == ".text" { code = $2 }
        $1 == ".rodata" { constants = $2 }
        $1 == ".data" { data = $2 }
        $1 == ".bss" { zeroed = $2 }
        END { print image, code, constants, data, zeroed, flash; exit !(code && constants && zeroed) }'
}

# 12345 as 12,345.
grouped='function grouped(n,  text) {
    for (text = ""; n >= 1000; n = int(n / 1000)) text = sprintf(",%03d", n % 1000) text
    return n text
}'

sizes_table() {
    local image
    for image in "${images[@]}"; do sizes_of "$image"; done | awk "$grouped"'
        BEGIN { split("code|constants|initialised data|zeroed data|flash: code, constants, tables, initial values", names, "|") }
        { head = head " `" $1 "` |"; for (i = 1; i <= 5; i++) row[i] = row[i] " " grouped($(i + 1)) " |"; rule = rule "---|" }
        END { print "| bytes |" head; print "|---|" rule; for (i = 1; i <= 5; i++) print "| " names[i] " |" row[i] }'
}

case "${1:-}" in
sizes)
    build
    sizes_table | replace_block sizes
    stack=$(sed -nE 's/^ *STACK *:.*LENGTH = ([0-9]+)K.*/\1/p' firmware/boards/mps2_an386/memory.x)
    sizes_of mps2-an386 | awk -v stack="$((stack * 1024))" '{
        print "   ```text"
        printf "   photoncard on %s: code %d, constants %d, data %d, zeroed data %d, stack %d bytes\n", $1, $2, $3, $4, $5, stack
        print "   ready"
        print "   ```" }' | replace_block ready
    ;;
instructions)
    counts=$(tests/instructions.sh)
    awk "$grouped"'
        BEGIN { print "| instructions | of a gather | of a gather ray |"; print "|---|---|---|" }
        { print "| `" $1 "` | " grouped($2) " | " grouped($5) " |" }' <<<"$counts" | replace_block instructions
    ;;
check)
    build
    for image in "${images[@]}"; do sizes_of "$image"; done | awk -v arm="$flash" -v riscv="$flash_of_riscv" '
        { most = $1 ~ /riscv/ ? riscv : arm }
        $4 > 0 { print $1 ": " $4 " bytes of data have initial values, which take flash"; bad = 1 }
        $6 > most { print $1 ": flash of " $6 " bytes, above " most; bad = 1 }
        END { exit bad }'
    paste -d '\n' <(block sizes | tr -d ',') <(sizes_table | tr -d ',') | awk -F '|' -v tolerance="$tolerance" '
        NR % 2 { page = $0; next }
        {
            columns = split(page, stated, "|")
            if (columns != NF || stated[2] != $2 || NR <= 2 && page != $0) { print "the tables differ: " page " and " $0; bad = 1; next }
            for (i = 3; i < NF && NR > 4; i++) {
                drift = $i ? 100 * (stated[i] - $i) / $i : (stated[i] ? 100 : 0)
                if (drift != 0) printf "%s: the page states%s, the image has%s (%+.1f %%)\n", $2, stated[i], $i, drift
                if (drift > tolerance || drift < -tolerance) bad = 1
            }
        }
        END { exit bad || NR != 14 }' || {
        echo "$0: sizes of $page are off by more than $tolerance %; run: $0 sizes" >&2
        exit 1
    }
    ;;
*)
    echo "usage: $0 sizes|instructions|check" >&2
    exit 2
    ;;
esac
