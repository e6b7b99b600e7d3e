#!/usr/bin/env bash
# Packs the page's modules that render, the WebAssembly module and this folder's files for npm. Equal files make equal packages.
set -euo pipefail
[ $# -ge 2 ] || {
    echo "usage: $0 MODULE.wasm OUTDIR [LICENCE ...]" >&2
    exit 2
}
module=$1
mkdir -p "$2"
out=$(cd "$2" && pwd)
shift 2
here=$(cd "$(dirname "$0")" && pwd)
work=$(mktemp -d)
trap 'rm -rf "$work"' EXIT

cp "$here"/{package.json,index.js,index.d.ts,session.js,README.md} "$work"
cp "$here"/../page/{chip,host,instance,link,local,picture,soon,tiles,wasi}.js "$work"
cp "$here"/../../LICENSE-{APACHE,MIT} "$@" "$work"
install -m 644 "$module" "$work/photoncard.wasm"
cd "$work"
npm pkg set "version=$(sed -n 's/^version = "\(.*\)"/\1/p' "$here/../../Cargo.toml" | head -n 1)"
name=$(npm pack --silent --pack-destination "$out")
echo "$out/$name"
