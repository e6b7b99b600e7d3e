#!/usr/bin/env bash
# Runs a test program within a limit of time, as a runner of `cargo test`. What hangs is a failure that names the tests which were
# still running: the test harness says of each when it has run for a minute.
set -uo pipefail
limit=${PHOTONCARD_TEST_LIMIT:-2400}

said=$(mktemp)
trap 'rm -f "$said"' EXIT
timeout --kill-after=10 "$limit" "$@" > >(tee "$said") 2>&1
status=$?
if [ "$status" != 0 ] && [ "$SECONDS" -ge "$limit" ]; then
    hanging=$(sed -nE 's/^test (.*) has been running for over .*/\1/p' "$said" |
        grep -vxFf <(sed -nE 's/^test (.*) \.\.\. .*/\1/p' "$said") | paste -sd ' ')
    printf 'error: stopped after %s s: %s: still running: %s\n' "$limit" "${1##*/}" "${hanging:-not known}" >&2
    printf 'test result: FAILED. 0 passed; 1 failed\n'
fi
exit "$status"
