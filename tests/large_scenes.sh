#!/usr/bin/env bash
# How the time and memory of a render grow with triangles and texels: landscapes of an eighth to twice 300,000 triangles and 64 MB
# of decoded textures. Options go to large_scenes/measure.py. PHOTONCARD may name a command that is built, PYTHON a Python with NumPy.
set -euo pipefail
cd "$(dirname "$0")/.."
target=$(realpath -m "${CARGO_TARGET_DIR:-target}")
python=${PYTHON:-python3}
"$python" -c 'import numpy' || {
    echo "$0: NumPy is missing; run: sudo apt-get install python3-numpy, or set PYTHON" >&2
    exit 1
}
photoncard=${PHOTONCARD:-}
[ -n "$photoncard" ] || {
    cargo build --release --quiet -p photoncard
    photoncard="$target/release/photoncard"
}
export PYTHONDONTWRITEBYTECODE=1
exec "$python" tests/large_scenes/measure.py --photoncard "$photoncard" --folder "$target/large-scenes" "$@"
