#!/bin/sh
# Builds the WebAssembly module of the page whose host runs in the browser, into the file that the argument names.
set -eu
[ $# -eq 1 ] || {
    echo "usage: host-cli/module.sh FILE.wasm" >&2
    exit 2
}
root=$(dirname "$0")/..
rustup target add wasm32-wasip1
# Every browser since 2021, Safari since 2023, has the vector instructions.
RUSTFLAGS="-C target-feature=+simd128" cargo build --manifest-path "$root/Cargo.toml" --locked \
    -p photoncard-browser --target wasm32-wasip1 --profile page
mkdir -p "$(dirname "$1")"
cp "${CARGO_TARGET_DIR:-$root/target}/wasm32-wasip1/page/photoncard_browser.wasm" "$1"
