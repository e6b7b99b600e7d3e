#!/usr/bin/env bash
# Measures latency and rate of `photoncard view` in a headless Chromium, by the page's own clock, and prints them beside their goals:
# milliseconds, and pictures a second. Takes about three minutes after the build.
set -euo pipefail
[ $# = 0 ] || {
    echo "usage: $0" >&2
    exit 2
}
cd "$(dirname "$0")/.."
"${CARGO:-cargo}" test --quiet --locked --release -p photoncard --test it -- --ignored --exact view_browser::latency::latency --nocapture
