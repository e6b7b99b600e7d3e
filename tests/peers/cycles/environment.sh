# Sourced by the scripts that need Blender.

# Makes the virtual environment in the folder given, with Blender's Python module `bpy` in it.
make_cycles_environment() {
    local folder=$1
    export PYTHONDONTWRITEBYTECODE=1
    if [ ! -x "$folder/bin/python" ]; then
        if python3.11 -c 'import ensurepip' 2>/dev/null; then
            python3.11 -m venv --clear "$folder"
        elif command -v uv >/dev/null; then
            uv venv --quiet --seed --python 3.11 "$folder"
        else
            echo "$0: bpy 5.0 needs Python 3.11 with venv, or uv, which fetches it: https://docs.astral.sh/uv" >&2
            exit 1
        fi
    fi
    "$folder/bin/python" -m pip install --quiet --disable-pip-version-check -r tests/peers/cycles/requirements.txt
    "$folder/bin/python" -c 'import bpy' || {
        echo "$0: bpy does not load; it needs libraries of X11: apt-get install libxrender1 libxxf86vm1 libxfixes3 libxi6 libxkbcommon0 libsm6 libgl1" >&2
        exit 1
    }
}
