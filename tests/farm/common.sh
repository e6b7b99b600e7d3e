# For the scripts of this folder: a picture of many tasks, of which a tenth is killed at random, against one undisturbed process.
#
# PARTS=1000      parts of a picture, a task each
# SCENE=FILE      the scene (scenes/atrium.glb)
# OPTIONS="..."   options of photoncard render (--quality draft --size 1024x1024)
# FRAMES=A-B      frames of the scene's animations, each in PARTS parts; without it a picture
# KILLED=10       one of so many renders is killed
# WITHIN=1000     milliseconds within which it is
# PHOTONCARD=FILE the program; by default it is built
set -euo pipefail
root=$(cd "$(dirname "${BASH_SOURCE[0]}")/../.." && pwd)
parts=${PARTS:-1000}
scene=$(realpath "${SCENE:-$root/scenes/atrium.glb}")
read -ra options <<<"${OPTIONS:---quality draft --size 1024x1024}"
options+=(--card emulated:1 --threads 1 --quiet)
job_options=("${options[@]}" --parts "$parts" -o out.exr)
[ -z "${FRAMES:-}" ] || job_options=("${options[@]}" --parts "$parts" --frames "$FRAMES" -o out.######.exr)
if [ -z "${PHOTONCARD:-}" ]; then
    cargo build --release --locked -p photoncard --manifest-path "$root/Cargo.toml"
    PHOTONCARD=${CARGO_TARGET_DIR:-$root/target}/release/photoncard
fi
work=$(mktemp -d)
clean() { rm -rf "$work"; }
trap clean EXIT
cd "$work"

# The program that tasks find: it notes its CPU time, and one of $KILLED renders ends within a moment.
mkdir bin times
cat >bin/photoncard <<END
#!/usr/bin/env bash
"$(realpath "$PHOTONCARD")" "\$@" &
if [ "\$1" = render ] && [ \$((RANDOM % ${KILLED:-10})) = 0 ]; then
    sleep "0.\$(printf %03d \$((RANDOM % ${WITHIN:-1000})))"
    kill -KILL \$! 2>/dev/null && : >"$work/times/\$\$.killed"
fi
wait \$!
status=\$?
times >"$work/times/\$\$"
exit \$status
END
chmod +x bin/photoncard

# Sum of what was noted, seconds.
seconds() {
    # The second line is of the processes that a shell has waited for.
    awk -F '[ms ]+' 'FNR == 2 { sum += 60 * $1 + $2 + 60 * $3 + $4 } END { printf "%.2f", sum }' times/*
}

# One undisturbed process.
whole() {
    local frames=() output=whole.exr
    [ -z "${FRAMES:-}" ] || { frames=(--frames "$FRAMES"); output=whole.######.exr; }
    KILLED=0 "$PHOTONCARD" render "$scene" "${options[@]}" "${frames[@]}" -o "$output" &
    wait $!
    times >times/whole
    undisturbed=$(seconds)
    rm times/whole
}

# The job of an engine.
job() { "$PHOTONCARD" farm "$1" "$scene" "${job_options[@]}"; }

# Compares the pictures, and says what the job has cost.
check() {
    local picture other
    for picture in whole*.exr; do
        other=out${picture#whole}
        cmp "$picture" "$other" || { echo "$1: $other is not the picture of one process" >&2; exit 1; }
    done
    echo "$1: $parts parts${FRAMES:+ of the frames $FRAMES}, $(find times -name "*.killed" | wc -l) renders killed: the pictures are those of one process"
    echo "$1: CPU time $(seconds) s, of one process $undisturbed s"
}
