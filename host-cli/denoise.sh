#!/usr/bin/env bash
# Denoises a picture of `photoncard render` by Open Image Denoise.
#
#   host-cli/denoise.sh IN.exr OUT.exr
#
# IN.exr has the layers `albedo` and `N`, as by default. OUT.exr has the same channels, R G B denoised. What it takes (pyoidn, NumPy and OpenEXR
# from PyPI, 130 MB, Linux on x86-64) goes into a virtual environment in the user's cache folder, once.
set -euo pipefail
if [ $# -ne 2 ] || [ ! -f "$1" ]; then
    echo "usage: $0 IN.exr OUT.exr: IN.exr is a picture of \`photoncard render\` with the layers albedo and N" >&2
    exit 2
fi
python3 -c 'import sys, ensurepip; sys.exit(sys.version_info < (3, 10))' || {
    echo "$0: Python 3.10 or later with venv is missing: apt-get install python3-venv" >&2
    exit 1
}
here=$(dirname "$(realpath "$0")")
environment=${XDG_CACHE_HOME:-$HOME/.cache}/photoncard/denoise
[ -x "$environment/bin/pip" ] || python3 -m venv --clear "$environment"
"$environment/bin/pip" install --quiet --disable-pip-version-check -r "$here/denoise-requirements.txt"
exec "$environment/bin/python" "$here/denoise.py" "$1" "$2"
