#!/usr/bin/env bash
# A job of Open Job Description by two workers, of which a tenth of the tasks is killed: the picture is that of one process. See common.sh.
# OPENJD=FILE is the command of the PyPI package openjd-cli.
#
# `openjd run` is one worker, and ends with the first task that fails. As a scheduler would, each worker runs the tasks of its half one by one, and a task that
# has failed again.
. "$(dirname "$0")/common.sh"
openjd=${OPENJD:-openjd}
"$openjd" --version >/dev/null || { echo "openjd.sh: openjd is missing; run: pip install openjd-cli" >&2; exit 1; }
whole
job openjd >job.json
export PATH="$work/bin:$PATH"
run() { "$openjd" run job.json -p Home="$work" --step "$@" >>"$log" 2>&1; }

# Tasks of one worker: ranges of consecutive parts, each in a session of its own.
worker() {
    local first=$1 last=$2 tries task frame
    log=worker.$first.log
    while [ "$first" -le "$last" ]; do
        task=$((first + ${CHUNK:-10} - 1))
        [ "$task" -le "$last" ] || task=$last
        for frame in "${frames[@]}"; do
            tries=0
            until run render --task-param "Part=$first-$task" ${frame:+--task-param "$frame"}; do
                tries=$((tries + 1))
                [ "$tries" -lt 10 ] || return 1
            done
        done
        first=$((task + 1))
    done
}

# Frames as parameters, or one empty word.
frames=("")
[ -z "${FRAMES:-}" ] || mapfile -t frames < <(seq "${FRAMES%-*}" "${FRAMES#*-}" | sed 's/.*/Frame=&-&/')

log=steps.log
run prepare
worker 1 $((parts / 2)) &
first=$!
worker $((parts / 2 + 1)) "$parts" &
wait $! && wait $first || { tail -n 40 worker.*.log >&2; exit 1; }
log=steps.log
run merge || { tail -n 40 steps.log >&2; exit 1; }
check openjd
