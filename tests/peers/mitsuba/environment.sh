# Sourced by the scripts that need Mitsuba.

# Makes the virtual environment in the folder given, with Mitsuba in it, and names LLVM's library to it.
make_environment() {
    local folder=$1 library
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
    [ -x "$folder/bin/pip" ] || python3 -m venv --clear "$folder"
    "$folder/bin/pip" install --quiet --disable-pip-version-check -r tests/peers/mitsuba/requirements.txt
}
