#!/usr/bin/env bash
# Makes a card of its own from a template, in a folder outside of the workspace and by the commands of its README.md, and runs a command of
# cargo there: `check` compiles and lints it, `run` starts it in QEMU, which prints the path of its pty.
# Usage: tests/template.sh polled|embassy check|run
set -euo pipefail
root=$(realpath "$(dirname "$0")/..")

usage() {
    echo "usage: $0 polled|embassy check|run" >&2
    exit 2
}
[ $# = 2 ] || usage
case "$1" in
polled) target=thumbv8m.main-none-eabi feature=embedded-io ;;
embassy) target=riscv32imac-unknown-none-elf feature=embedded-io-async ;;
*) usage ;;
esac
case "$2" in
check | run) ;;
*) usage ;;
esac
rustup target add "$target" >&2 || {
    echo "$0: the target $target is missing; run: rustup target add $target" >&2
    exit 1
}

kept=${CARGO_TARGET_DIR:-$root/target}/templates
mkdir -p "$kept"
kept=$(realpath "$kept")
export CARGO_TARGET_DIR=$kept
# Optimised as one program, as the template has it, each takes two minutes.
[ "$2" = check ] || export CARGO_PROFILE_RELEASE_LTO=off CARGO_PROFILE_RELEASE_CODEGEN_UNITS=16
folder=$(mktemp -d)
trap 'rm -r "$folder"' EXIT
cp -r "$root/firmware/templates/$1" "$folder/my-card"
cd "$folder/my-card"
{
    cargo add --quiet photoncard-firmware --features "$feature" --path "$root/firmware"
    cargo add --quiet photoncard-shared --path "$root/shared"
    if [ "$2" = check ]; then
        cargo fmt --check
        cargo clippy --quiet --release -- -D warnings
    else
        cargo build --quiet --release
    fi
} >&2
[ "$2" = check ] || cargo run --quiet --release
