#!/usr/bin/env bash
# Whole pictures beside those of Mitsuba 3: RMSE against a converged picture, over the CPU seconds that it took.
#
#   tests/peers/pictures.sh [SCENE ...]      cornell, atrium; both without any
#
# What it takes for Mitsuba goes into a virtual environment below cargo's target folder, and so do pictures. A reference is
# rendered by Mitsuba once, which takes the longest: minutes for the Cornell box, half an hour for the atrium on two cores.
# A converged picture of one's own may be put in its place: pictures/SCENE-512x512-reference.exr in that folder.
set -euo pipefail
cd "$(dirname "$0")/../.."
target=$(realpath -m "${CARGO_TARGET_DIR:-target}")
environment="$target/peers/mitsuba"

for library in /usr/lib/*/libLLVM.so.19* /usr/lib/*/libLLVM-19.so* /usr/lib/llvm-19/lib/libLLVM.so*; do
    [ ! -e "$library" ] || DRJIT_LIBLLVM_PATH=${DRJIT_LIBLLVM_PATH:-$library}
done
[ -e "${DRJIT_LIBLLVM_PATH:-}" ] || {
    echo "$0: Mitsuba needs the shared library of LLVM 19: apt-get install libllvm19, or set DRJIT_LIBLLVM_PATH to it" >&2
    exit 1
}
export DRJIT_LIBLLVM_PATH PYTHONDONTWRITEBYTECODE=1

python3 -c 'import sys, ensurepip; sys.exit(sys.version_info < (3, 11))' || {
    echo "$0: Mitsuba's environment needs Python 3.11 or later with venv: apt-get install python3-venv" >&2
    exit 1
}
[ -x "$environment/bin/pip" ] || python3 -m venv --clear "$environment"
"$environment/bin/pip" install --quiet --disable-pip-version-check -r tests/peers/mitsuba/requirements.txt
cargo build --release --quiet -p photoncard
exec "$environment/bin/python" tests/peers/mitsuba/pictures.py --photoncard "$target/release/photoncard" \
    --folder "$target/peers/pictures" "$@"
