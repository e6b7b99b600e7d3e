#!/usr/bin/env bash
# Renders the pictures of docs/gallery.md, the first of which is the README's, and writes that page: below each picture its command,
# and the CPU seconds that it took.
#
#   docs/gallery.sh PHOTONCARD
#
# PHOTONCARD is the command. Files of others are those that tests/peers/room.sh and tests/peers/surfaces.sh leave below cargo's target
# folder; without them the page has the scenes that ship.
set -euo pipefail
photoncard=$(realpath "$1")
cd "$(dirname "$0")/.."
peers=$(realpath -m "${CARGO_TARGET_DIR:-target}")/peers

# Title, name of the picture, scene, options.
pictures() {
    cat <<END
The court of the atrium under a sky|../atrium|scenes/atrium-open.glb|--environment scenes/sky.exr --size 1000x625 --tonemap aces
The court by panels of sky and sun|atrium|scenes/atrium.glb|--size 800x450
Its gallery|gallery|scenes/atrium.glb|--size 800x450 --camera gallery
The Cornell box|cornell|scenes/cornell.gltf|--size 720x720
With a glossy floor|cornell-glossy|scenes/cornell-glossy.gltf|--size 720x720
With a mirror and a glass ball|cornell-spheres|scenes/cornell-spheres.glb|--size 720x720
Lit from a spot of its ceiling|cornell-uplight|scenes/cornell-uplight.gltf|--size 720x720
A room of textures|room|scenes/room.glb|--size 800x600
Metals and dielectrics|roughness|scenes/roughness.glb|--size 800x400
A room made in Blender, by its exporter|blender-room|$peers/room/room.glb|--size 512x512
Flight Helmet, Microsoft, CC0|flight-helmet|$peers/surfaces/flight-helmet.glb|--size 512x512 --environment 0.2,0.2,0.2
END
}

page=docs/gallery.md
{
    echo "# Gallery"
    echo
    echo "For those who want to see what it renders, and how long that takes: pictures by the default quality, written by"
    echo "[\`docs/gallery.sh\`](gallery.sh) with $("$photoncard" --version | head -n 1) on $(nproc) cores. CPU seconds are of all threads, from reading the scene to"
    echo "the picture's file."
} >"$page.partial"
while IFS='|' read -r title name scene options; do
    [ -e "$scene" ] || {
        echo "$0: $scene is missing: left out" >&2
        continue
    }
    # shellcheck disable=SC2086 # options are words
    seconds=$({ TIMEFORMAT='%U %S' && time "$photoncard" render "$scene" -o "docs/gallery/$name.png" $options --quiet; } 2>&1)
    {
        printf '\n## %s\n\n![%s](gallery/%s.png)\n\n' "$title" "$title" "$name" | sed 's|gallery/\.\./||'
        # Files of others are not there when the commands of documents are tested.
        kind='sh slow'
        [ "$scene" = "${scene#"$peers"}" ] || kind='sh network'
        printf '```%s\nphotoncard render %s -o %s.png %s\n```\n\n' "$kind" "${scene#"$peers"/*/}" "${name##*/}" "$options" | sed 's/ *$//'
        awk '{ printf "%.0f CPU seconds.\n", $1 + $2 }' <<<"$seconds"
    } >>"$page.partial"
done < <(pictures)
mv "$page.partial" "$page"
