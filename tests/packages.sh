#!/usr/bin/env bash
# Installs the wheel, the Debian package and the archive of a folder, each in a clean root without Rust, renders a picture by each, and
# prints the seconds from nothing to the picture: tests/packages.sh DIST. It takes root, and a mirror of Debian or PHOTONCARD_ROOT, a
# folder with a root of Debian that has python3-venv. Exit status 75: there is no clean root.
set -euo pipefail
cd "$(dirname "$0")/.."
[ $# = 1 ] && [ -d "$1" ] || {
    echo "usage: $0 DIST" >&2
    exit 2
}
dist=$(realpath "$1")
suite=bookworm
mirror=${PHOTONCARD_MIRROR:-http://deb.debian.org/debian}

fail() {
    printf '%s: %s\n' "$0" "$*" >&2
    exit 1
}
skip() {
    printf '%s: SKIPPED: %s\n' "$0" "$*" >&2
    exit 75
}

[ "$(id -u)" = 0 ] || skip "a root is made by root alone"
work=$(mktemp -d)
trap 'rm -rf "$work"' EXIT
base=${PHOTONCARD_ROOT:-}
if [ -z "$base" ]; then
    command -v debootstrap >/dev/null || skip "debootstrap is missing; run: apt-get install debootstrap"
    base=$work/base
    debootstrap --variant=minbase --include=ca-certificates,python3-venv "$suite" "$base" "$mirror" >"$work/said" 2>&1 || {
        tail -5 "$work/said" >&2
        skip "debootstrap cannot make a root from $mirror"
    }
fi

# in_root COMMAND: runs it in the root, with its own processes and mounts.
in_root() {
    unshare --mount --pid --fork chroot "$root" /usr/bin/env -i HOME=/root PATH=/usr/sbin:/usr/bin:/sbin:/bin \
        PIP_CERT=/etc/ssl/certs/ca-certificates.crt https_proxy="${https_proxy:-}" sh -euc "$1"
}
render="render /cornell.gltf --size 160x120 --quality draft --quiet -o /picture.png"
# try NAME COMMAND: a root of its own, in which the command installs a package and renders.
try() {
    local name=$1 start seconds
    root=$work/$name
    cp -a "$base" "$root"
    cp -L /etc/resolv.conf "$root/etc/" 2>/dev/null || true
    # The root reaches the index of packages as this machine does.
    cp -L "${PIP_CERT:-/etc/ssl/certs/ca-certificates.crt}" "$root/etc/ssl/certs/ca-certificates.crt"
    cp "$dist"/*.tar.gz "$dist"/*.deb "$dist"/*.whl scenes/cornell.gltf "$root/"
    ! in_root "command -v cargo || command -v rustc" >/dev/null || fail "the root has Rust"
    start=$(date +%s.%N)
    in_root "$2" >"$work/said" 2>&1 || {
        cat "$work/said" >&2
        fail "$name: no picture"
    }
    seconds=$(awk -v start="$start" -v end="$(date +%s.%N)" 'BEGIN { printf "%.1f", end - start }')
    [ "$(head -c 4 "$root/picture.png" | tail -c 3)" = PNG ] || fail "$name: the picture is no PNG"
    echo "$name: $seconds s from nothing to the picture"
    rm -rf "$root"
}

try tar "tar -xzf /photoncard-*.tar.gz -C /opt; /opt/photoncard-*/bin/photoncard $render"
try deb "dpkg -i /photoncard_*.deb; photoncard $render"
try wheel "python3 -m venv /venv; /venv/bin/pip install --quiet /photoncard-*.whl; /venv/bin/python -c '
import photoncard as pc
picture = pc.load(\"/cornell.gltf\").render(size=(160, 120), quality=\"draft\")
assert picture.image.mean() > 0
picture.to_png(\"/picture.png\")'"
