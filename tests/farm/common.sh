# For the scripts of this folder: a picture of many tasks, of which a tenth is killed at random, against one undisturbed process.
#
# The efficiency is the CPU time of the undisturbed process by that of the commands that were completed: preparation, tasks and merge. What killed tasks and the
# engine have cost is told apart.
#
# PARTS=1000      parts of a picture, a task each
# SCENE=FILE      the scene (scenes/atrium.glb)
# OPTIONS="..."   options of photoncard render (--quality draft --size 1024x1024)
# FRAMES=A-B      frames of the scene's animations, each in PARTS parts; without it a picture
# KILLED=10       one of so many renders is killed
# WITHIN=1000     milliseconds within which it is
# WHOLE=FOLDER    folder that keeps the pictures of one process, and their CPU time, for further scripts of equal settings
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
daemons=()
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
    kill -KILL \$! 2>/dev/null || true
fi
wait \$!
status=\$?
end=killed
[ \$status != 0 ] || end=\$1
times >"\$(mktemp "$work/times/XXXXXXXX.\$end")"
exit \$status
END
chmod +x bin/photoncard

# Sum of what was noted of commands that ended so, seconds.
seconds() {
    # The second line is of the processes that a shell has waited for.
    find times -name "*.$1" -exec cat {} + | awk -F '[ms ]+' 'NR % 2 == 0 { sum += 60 * $1 + $2 + 60 * $3 + $4 } END { printf "%.2f", sum }'
}

# CPU time of this script, and of all processes of it that have ended, seconds.
spent() {
    local ticks=$(($(cut -d ' ' -f 14-17 "/proc/$$/stat" | tr ' ' +)))
    awk "BEGIN { printf \"%.2f\", $ticks / $(getconf CLK_TCK) }"
}

# Two undisturbed processes at once, as tasks are; their mean counts.
whole() {
    local frames=() number= name processes=()
    if [ -n "${WHOLE:-}" ] && [ -e "$WHOLE/seconds" ]; then
        cp "$WHOLE"/whole*.exr .
        undisturbed=$(cat "$WHOLE/seconds")
        before=$(spent)
        return
    fi
    [ -z "${FRAMES:-}" ] || { frames=(--frames "$FRAMES"); number=.######; }
    for name in whole other; do
        (
            "$PHOTONCARD" render "$scene" "${options[@]}" "${frames[@]}" -o "$name$number.exr"
            times >"times/undisturbed.$name"
        ) &
        processes+=($!)
    done
    for name in "${processes[@]}"; do wait "$name"; done
    undisturbed=$(awk "BEGIN { printf \"%.2f\", ($(seconds whole) + $(seconds other)) / 2 }")
    rm times/*
    [ -z "${WHOLE:-}" ] || { mkdir -p "$WHOLE" && cp whole*.exr "$WHOLE" && echo "$undisturbed" >"$WHOLE/seconds"; }
    before=$(spent)
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
    local killed done all
    killed=$(find times -name "*.killed" | wc -l)
    done=$(awk "BEGIN { print $(seconds prepare) + $(seconds render) + $(seconds merge) }")
    all=$(awk "BEGIN { print $done + $(seconds killed) }")
    echo "$1: $parts parts${FRAMES:+ of the frames $FRAMES}, $(find times -name "*.render" | wc -l) tasks done, $killed killed: the pictures are those of one process"
    echo "$1: CPU time of one process $undisturbed s; prepare $(seconds prepare) s, tasks $(seconds render) s, merge $(seconds merge) s; of killed tasks $(seconds killed) s"
    awk "BEGIN { printf \"$1: efficiency %.3f, with killed tasks %.3f\n\", $undisturbed / $done, $undisturbed / $all }"
    # Daemons are no processes of this script.
    [ ${#daemons[@]} = 0 ] || return 0
    awk "BEGIN { printf \"$1: %.2f s of CPU time are the engine's, its shells' and this script's\n\", $(spent) - $before - $all }"
}
