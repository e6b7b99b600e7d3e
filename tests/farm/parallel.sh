#!/usr/bin/env bash
# A job by GNU parallel, two tasks at once, of which a tenth is killed: the picture is that of one process. See common.sh.
. "$(dirname "$0")/common.sh"
command -v parallel >/dev/null || { echo "parallel.sh: GNU parallel is missing; run: sudo apt-get install parallel" >&2; exit 1; }
whole
job parallel >job.sh
export JOBS=2 PATH="$work/bin:$PATH"
# A task that is killed three times ends a run of the script; the next one goes on.
for _ in 1 2 3; do
    if sh job.sh 2>job.log; then
        check parallel
        exit
    fi
done
cat job.log >&2
exit 1
