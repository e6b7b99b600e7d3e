#!/usr/bin/env bash
# Builds the program and packs it for machines of the same kind. Equal programs make equal packages: names are sorted, and times are those
# of the last commit, or SOURCE_DATE_EPOCH.
set -euo pipefail
export LC_ALL=C

usage() {
    cat >&2 <<EOF
usage: $0 [--binary FILE] [--out DIR] [--check] [FORMAT ...]
  --binary FILE  pack this program instead of building one
  --out DIR      the folder for the packages, by default dist
  --check        pack twice, compare, and keep the packages if they are equal
formats, by default all:
  tar        photoncard-VERSION-TARGET.tar.gz: program, manual pages, completions, documents, licences
  deb        a Debian package; it takes dpkg-deb
  wheel      a wheel of Python: program and package
  blender    the extension of Blender with the program
  npm        a package of npm
  container  Containerfile, which builds an image from the archive
  sbom       photoncard-VERSION.cdx.json: the crates in the program, CycloneDX
The variable PHOTONCARD_MODULE names the module that host-cli/module.sh has built: archive, Debian package and package of npm have it; without the
variable there is no package of npm.
EOF
    exit 2
}

fail() {
    printf '%s: %s\n' "$0" "$*" >&2
    exit 1
}

all=(tar deb wheel blender container sbom)
# What host-cli/module.sh has built.
if [ -n "${PHOTONCARD_MODULE:-}" ]; then
    PHOTONCARD_MODULE=$(realpath "$PHOTONCARD_MODULE")
    export PHOTONCARD_MODULE
    all+=(npm)
fi
formats=() binary="" out="" check=""
while [ $# -gt 0 ]; do
    case $1 in
    --binary | --out)
        [ $# -ge 2 ] && [ -n "$2" ] || usage
        [ "${2#/}" != "$2" ] || set -- "$1" "$PWD/$2" "${@:3}"
        [ "$1" = --out ] && out=$2 || binary=$2
        shift 2
        ;;
    --check)
        check=yes
        shift
        ;;
    *)
        [[ " ${all[*]} " == *" $1 "* ]] || usage
        formats+=("$1")
        shift
        ;;
    esac
done
[ "${#formats[@]}" -gt 0 ] || formats=("${all[@]}")
wants() { [[ " ${formats[*]} " == *" $1 "* ]]; }

[ -z "$binary" ] || [ -x "$binary" ] || fail "$binary is no program"
cd "$(dirname "$0")/.."
out=${out:-$PWD/dist}
cargo=${CARGO:-cargo}

[[ $(tar --version 2>/dev/null) == *GNU* ]] || fail "GNU tar is missing; it sorts the names in an archive"
command -v strip >/dev/null || fail "strip is missing; on Debian: sudo apt-get install binutils"
! wants deb || command -v dpkg-deb >/dev/null || fail "dpkg-deb is missing; on Debian: sudo apt-get install dpkg; or name other formats"
! wants npm || command -v npm >/dev/null || fail "npm is missing; on Debian: sudo apt-get install npm; or name other formats"
if wants deb || wants wheel || wants blender || wants sbom; then
    command -v python3 >/dev/null || fail "python3 is missing; on Debian: sudo apt-get install python3; or name other formats"
fi
export PYTHONDONTWRITEBYTECODE=1
host=$(rustc -vV | sed -n 's/^host: //p')

# With cargo-zigbuild the program runs on systems with this glibc and later ones, else with that of this machine.
glibc=2.28
build() {
    local folder options=(--release --locked -p photoncard --features study)
    folder=$(realpath -m "${CARGO_TARGET_DIR:-target}")
    if "$cargo" zigbuild --version >/dev/null 2>&1; then
        "$cargo" zigbuild "${options[@]}" --target "$host.$glibc"
        folder+=/$host
    else
        echo "$0: the program needs this machine's glibc; for older systems: pip install cargo-zigbuild ziglang" >&2
        "$cargo" build "${options[@]}"
    fi
    binary=$folder/release/photoncard
}
[ -n "$binary" ] || build
version=$("$binary" -V) || fail "$binary states no version"
version=${version#photoncard }
SOURCE_DATE_EPOCH=${SOURCE_DATE_EPOCH:-$(git log -1 --format=%ct)} || fail "outside of git SOURCE_DATE_EPOCH states the time of the files"
export SOURCE_DATE_EPOCH
name=photoncard-$version-$host

work=$(mktemp -d)
trap 'rm -rf "$work"' EXIT

if [ -n "$check" ]; then
    for folder in first second; do
        host-cli/package.sh --binary "$binary" --out "$work/$folder" "${formats[@]}" >"$work/said"
    done
    diff -r "$work/first" "$work/second" || fail "two runs made different packages"
    mkdir -p "$out"
    cp "$work"/first/* "$out"
    sed "s|^$work/second|$out|" "$work/said"
    exit
fi

# Licences of the crates that are in the program, with their texts, and where the sources are, as the MPL asks.
third_party() {
    local crates=${CARGO_HOME:-$HOME/.cargo}/registry/src crate version licence folder texts text
    "$cargo" tree --locked -p photoncard --features study -e normal --target "$host" --prefix none --format '{p} {l}' |
        grep -v ' (/.*)' | sed 's/ (\*)$//; s/ (proc-macro)//' | sort -u |
        while read -r crate version licence; do
            folder=$(find "$crates" -maxdepth 2 -name "$crate-${version#v}" -type d -print -quit)
            [ -n "$folder" ] || fail "the sources of $crate are not in $crates"
            printf '==== %s %s: %s; https://crates.io/crates/%s\n\n' "$crate" "$version" "$licence" "$crate"
            texts=$(find "$folder" -maxdepth 1 -type f \( -iname 'licen[cs]e*' -o -iname 'copying*' -o -iname 'notice*' \) | sort)
            [ -n "$texts" ] || echo "Its package has no text of the licence."
            while read -r text; do [ -z "$text" ] || cat "$text"; done <<<"$texts"
            echo
        done
}

# The files of the program, from which the packages are made.
files=$work/$name
stage_files() {
    mkdir -p "$files"/{bin,completions,scenes,share/man/man1}
    install -m 755 "$binary" "$files/bin/photoncard"
    strip "$files/bin/photoncard"
    "$files/bin/photoncard" man "$files/share/man/man1"
    local shell
    for shell in bash elvish fish powershell zsh; do
        "$files/bin/photoncard" completions "$shell" >"$files/completions/photoncard.$shell"
    done
    cp LICENSE-APACHE LICENSE-MIT README.md CHANGELOG.md "$files"
    # Where `photoncard page` looks for it.
    [ -z "${PHOTONCARD_MODULE:-}" ] || install -D -m 644 "$PHOTONCARD_MODULE" "$files/share/photoncard/photoncard.wasm"
    cp -r docs "$files/docs"
    cp scenes/README.md scenes/cornell.gltf "$files/scenes"
    third_party >"$files/LICENSES-OF-CRATES.txt"
    cp driver/scene/src/sky/hosek_wilkie_license.txt "$files/LICENSE-OF-SKY-DATA.txt"
}

# The archive as its user has it: unpacked elsewhere, it renders.
try_archive() {
    mkdir "$work/unpacked"
    tar -C "$work/unpacked" -xzf "$1"
    cd "$work/unpacked/$name"
    [ "$(bin/photoncard -V)" = "photoncard $version" ] || fail "the packed program does not state its version"
    bin/photoncard render scenes/cornell.gltf --quiet --quality paper --size 16x16 --photons 1000 -o "$work/cornell.png" ||
        fail "the packed program does not render the packed scene"
}

pack_tar() {
    tar --sort=name --mtime="@$SOURCE_DATE_EPOCH" --owner=0 --group=0 --numeric-owner --mode=u+rw,go=u-w --format=ustar \
        -C "$work" -cf - "$name" | gzip -9n >"$packages/$name.tar.gz"
    (try_archive "$packages/$name.tar.gz")
}

pack_deb() {
    local root=$work/deb documents=usr/share/doc/photoncard architecture glibc_of
    architecture=$(dpkg --print-architecture)
    glibc_of='import sys; sys.path.insert(0, "host-cli/python"); import elf; print(*elf.needs_of(sys.argv[1]).glibc, sep=".")'
    mkdir -p "$root"/{DEBIAN,usr/bin,usr/share/man/man1,usr/share/bash-completion/completions,usr/share/fish/vendor_completions.d}
    mkdir -p "$root"/{usr/share/zsh/vendor-completions,$documents/scenes}
    install -m 755 "$files/bin/photoncard" "$root/usr/bin"
    install -m 644 "$files"/share/man/man1/* "$root/usr/share/man/man1"
    [ -z "${PHOTONCARD_MODULE:-}" ] || install -D -m 644 "$files/share/photoncard/photoncard.wasm" "$root/usr/share/photoncard/photoncard.wasm"
    gzip -9n "$root"/usr/share/man/man1/*
    install -m 644 "$files/completions/photoncard.bash" "$root/usr/share/bash-completion/completions/photoncard"
    install -m 644 "$files/completions/photoncard.fish" "$root/usr/share/fish/vendor_completions.d"
    install -m 644 "$files/completions/photoncard.zsh" "$root/usr/share/zsh/vendor-completions/_photoncard"
    install -m 644 "$files"/*.md "$files"/LICENSE* "$root/$documents"
    install -m 644 LICENSE-MIT "$root/$documents/copyright"
    install -m 644 "$files"/scenes/* "$root/$documents/scenes"
    cat >"$root/DEBIAN/control" <<EOF
Package: photoncard
Version: $version-1
Section: graphics
Priority: optional
Architecture: $architecture
Maintainer: The photoncard authors
Depends: libc6 (>= $(python3 -c "$glibc_of" "$files/bin/photoncard")), libgcc-s1
Installed-Size: $(find "$root/usr" -type f -printf '%s\n' | awk '{ sum += int(($1 + 1023) / 1024) } END { print sum }')
Description: Global illumination by photon mapping on small rendering chips
 Renders glTF scenes with global illumination, by photon mapping on emulated or
 real rendering chips.
EOF
    chmod -R u+rwX,go+rX,go-w "$root"
    dpkg-deb --root-owner-group -Zxz --build "$root" "$packages/photoncard_$version-1_$architecture.deb" >/dev/null
}

pack_wheel() {
    python3 host-cli/python/build.py --licences "$files/LICENSES-OF-CRATES.txt" "$files/bin/photoncard" "$packages" >/dev/null
}

pack_blender() {
    python3 host-cli/blender/build.py "$files/bin/photoncard" "$packages" "$files"/LICENSE*-OF-* >/dev/null
}

pack_npm() {
    host-cli/npm/pack.sh "$PHOTONCARD_MODULE" "$packages" "$files"/LICENSE*-OF-* >/dev/null
}

pack_container() {
    sed "s/@NAME@/$name/g" host-cli/Containerfile >"$packages/Containerfile"
    [ -f "$packages/$name.tar.gz" ] || pack_tar
}

pack_sbom() {
    CARGO=$cargo python3 host-cli/sbom.py "$host" >"$packages/photoncard-$version.cdx.json"
}

packages=$work/packages
mkdir "$packages"
stage_files
for format in "${formats[@]}"; do
    "pack_$format"
done
mkdir -p "$out"
for file in "$packages"/*; do
    mv "$file" "$out/"
    echo "$out/${file##*/}"
done
# Also of packages of other formats that are there.
(cd "$out" && find . -maxdepth 1 -type f ! -name SHA256SUMS -printf '%f\0' | sort -z | xargs -0 sha256sum -- >"$work/sums")
mv "$work/sums" "$out/SHA256SUMS"
