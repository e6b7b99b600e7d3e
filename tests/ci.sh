#!/usr/bin/env bash
# The test command: prepares the machine, then checks format, lints, tests, docs and the firmware's builds.
# A tool that is missing and cannot be installed is a failure or, where said so, a loud skip: never a silent pass.
set -euo pipefail
cd "$(dirname "$0")/.."
export CARGO_TERM_COLOR=${CARGO_TERM_COLOR:-never}

targets=(thumbv7em-none-eabihf riscv32imafc-unknown-none-elf)

step() { printf '\n== %s\n' "$*"; }

fail() {
    printf 'ci: %s\n' "$*" >&2
    exit 1
}

step "tools"
command -v cargo >/dev/null || fail "cargo is missing; install Rust 1.90 or later with rustup (https://rustup.rs)"
command -v rustup >/dev/null || fail "rustup is missing; install it to add the bare-metal targets"
command -v cc >/dev/null || {
    [ "$(id -u)" = 0 ] || fail "a C linker is missing; run: sudo apt-get install build-essential"
    apt-get update -qq && apt-get install -y -qq build-essential
}
rustup component add rustfmt clippy
rustup target add "${targets[@]}"

step "format"
cargo fmt --all --check

step "lints"
cargo clippy --workspace --all-targets --locked -- -D warnings

step "tests"
cargo test --workspace --locked

step "documentation"
RUSTDOCFLAGS="-D warnings" cargo doc --workspace --no-deps --locked

for target in "${targets[@]}"; do
    step "firmware for $target"
    cargo build -p photoncard-firmware --release --locked --target "$target"
done

step "done"
