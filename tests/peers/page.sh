#!/usr/bin/env bash
# The Flight Helmet (Khronos' sample, of a package of crates.io) by a page that has its own host, beside the native program: the EXR that the page
# saves is the command's, byte for byte, or this fails.
#
#   tests/peers/page.sh PHOTONCARD MODULE
#
# It needs Chromium, Node.js 20 with npm, and the network. The status is 75 if the network fails.
set -euo pipefail
[ $# = 2 ] && [ -x "$1" ] && [ -f "$2" ] || {
    echo "usage: $0 PHOTONCARD MODULE, such as target/release/photoncard and a module by host-cli/module.sh" >&2
    exit 2
}
photoncard=$(realpath "$1")
module=$(realpath "$2")
cd "$(dirname "$0")/../.."
source tests/peers/packages.sh
folder=$(realpath -m "${CARGO_TARGET_DIR:-target}")/peers/page
mkdir -p "$folder"
make_helmet() {
    local source
    source=$(package_file bevy_webgl2 bevy_webgl2-0.4.0/assets/models/FlightHelmet/FlightHelmet.gltf) || return
    npm install --silent --prefix "$folder" gltf-pipeline@4.3.1 >&2 || return 75
    "$folder/node_modules/.bin/gltf-pipeline" -i "$source" -o "$folder/partial.glb" >&2
    mv "$folder/partial.glb" "$folder/flight-helmet.glb"
}
command -v npm >/dev/null || {
    echo "$0: npm is missing; install Node.js 20 or later" >&2
    exit 1
}
[ -f "$folder/flight-helmet.glb" ] || make_helmet
"$photoncard" page "$folder/site" --scene "$folder/flight-helmet.glb" --module "$module" >&2
exec node --experimental-websocket tests/peers/page.mjs "$photoncard" "$folder/site" "scenes/flight-helmet.glb --environment 0.5,0.5,0.5"
