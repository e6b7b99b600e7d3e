#!/usr/bin/env bash
# A job of Open Job Description by two workers, of which a tenth of the tasks is killed: the picture is that of one process. See common.sh.
# OPENJD=FILE is the command of the PyPI package openjd-cli.
#
# `openjd run` is one worker, and ends with the first task that fails. As a scheduler would, each worker runs sessions one by one, and one that has failed
# again.
. "$(dirname "$0")/common.sh"
openjd=${OPENJD:-openjd}
"$openjd" --version >/dev/null || { echo "openjd.sh: openjd is missing; run: pip install openjd-cli" >&2; exit 1; }
whole
job openjd >job.json
export PATH="$work/bin:$PATH"
run() { "$openjd" run job.json -p Home="$work" --step "$@" >>"$log" 2>&1 </dev/null; }

# Task parameters of each session: a chunk of parts, or a part of a chunk of frames.
sessions() {
    local first=1 last=$parts chunk=${CHUNK:-10} part
    [ -z "${FRAMES:-}" ] || { first=${FRAMES%-*}; last=${FRAMES#*-}; }
    for ((; first <= last; first += chunk)); do
        local range=$first-$((first + chunk - 1 < last ? first + chunk - 1 : last))
        if [ -z "${FRAMES:-}" ]; then
            echo "--task-param Part=$range"
        else
            for part in $(seq "$parts"); do echo "--task-param Frame=$range --task-param Part=$part"; done
        fi
    done
}

# A worker does every second session.
worker() {
    local tries session
    log=worker.$1.log
    while read -ra session; do
        tries=0
        until run render "${session[@]}"; do
            tries=$((tries + 1))
            [ "$tries" -lt 10 ] || return 1
        done
    done < <(sessions | sed -n "$1~2p")
}

log=steps.log
run prepare
worker 1 &
first=$!
worker 2 &
wait $! && wait $first || { tail -n 40 worker.*.log >&2; exit 1; }
log=steps.log
run merge || { tail -n 40 steps.log >&2; exit 1; }
check openjd
