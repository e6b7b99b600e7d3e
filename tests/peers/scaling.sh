#!/usr/bin/env bash
# How cost grows with the scene and the picture, beside Blender's Cycles: CPU seconds, memory and card image over triangles, instances,
# photons, pixels and textures.
#
#   tests/peers/scaling.sh PHOTONCARD [--most N] [--memory GB] [--limit S] [--folder FOLDER] [--without-cycles] [TABLE ..]
#
# Tables are triangles, instances, photons, pixels and textures [default: all] (see scaling/tables.py). --most leaves out the sizes above N, in
# the unit of a table's first column. A run that needs more than --memory [default: 0.7 of the free memory] or --limit seconds of wall time is stopped,
# and is a row with the reason, as is a run that its program refuses. Both programs have one thread; CPU seconds are higher on a machine with
# other work. CYCLES_PYTHON may name a Python with Blender's module and numpy; without it an environment is made. The whole takes about half an
# hour and 1 GB in target/peers/scaling.
set -euo pipefail
[ $# -ge 1 ] && [ -x "$1" ] || {
    echo "usage: $0 PHOTONCARD [--most N] [--memory GB] [--limit S] [--folder FOLDER] [--without-cycles] [TABLE ..]" >&2
    exit 2
}
photoncard=$(realpath "$1")
shift
here=$PWD
cd "$(dirname "$0")/../.."
target=$(realpath -m "${CARGO_TARGET_DIR:-target}")
if [ -z "${CYCLES_PYTHON:-}" ]; then
    source tests/peers/cycles/environment.sh
    make_cycles_environment "$target/peers/cycles"
    CYCLES_PYTHON=$target/peers/cycles/bin/python
fi
export PYTHONDONTWRITEBYTECODE=1
scripts=$PWD/tests/peers/scaling
cd "$here"
exec "$CYCLES_PYTHON" "$scripts/tables.py" --photoncard "$photoncard" --folder "$target/peers/scaling" "$@"
