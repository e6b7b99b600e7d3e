#!/usr/bin/env bash
# Measures what the command takes besides rendering: bytes of the release program, and the median time of 50 runs each of its
# start and of a render of 16x16 pixels. Builds the program, unless one is given.
set -euo pipefail
export LC_ALL=C
[ $# -le 1 ] || {
    echo "usage: $0 [PHOTONCARD]" >&2
    exit 2
}
program=${1:+$(realpath "$1")}
cd "$(dirname "$0")/.."
if [ -z "$program" ]; then
    "${CARGO:-cargo}" build --quiet --locked --release -p photoncard
    program=${CARGO_TARGET_DIR:-target}/release/photoncard
fi
runs=50
files=$(mktemp -d)
trap 'rm -rf "$files"' EXIT

strip -o "$files/photoncard" "$program"
printf '%-16s %12d bytes, %d stripped\n' program "$(stat -c %s "$program")" "$(stat -c %s "$files/photoncard")"

# Prints the medians of the seconds that a command takes, by the clock and by its processors.
TIMEFORMAT='%3R %3U %3S'
measure() {
    local name=$1 run seconds wall processors
    shift
    for ((run = 0; run <= runs; run++)); do
        seconds=$({ time "$@" >/dev/null 2>"$files/said"; } 2>&1) || {
            cat "$files/said" >&2
            exit 1
        }
        # The first run fills the caches of files.
        [ "$run" = 0 ] || echo "$seconds"
    done >"$files/seconds"
    wall=$(cut -d ' ' -f 1 "$files/seconds" | median)
    processors=$(awk '{ print $2 + $3 }' "$files/seconds" | median)
    printf '%-16s %12s s, %s s of processors\n' "$name" "$wall" "$processors"
}
# The median of numbers, the lower one of two.
median() { sort -n | sed -n "$(((runs + 1) / 2))p"; }

measure start "$program" --version
measure "render of 16x16" "$program" render scenes/furnace.gltf --quality draft --spp 4 --size 16x16 --quiet -o "$files/furnace.exr"
