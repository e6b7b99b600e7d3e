#!/usr/bin/env bash
# Builds the program and packs it for machines of the same kind: dist/photoncard-VERSION-TARGET.tar.gz, with --deb a Debian package as
# well. Equal programs make equal archives: names are sorted, and times are those of the last commit, or SOURCE_DATE_EPOCH.
set -euo pipefail
export LC_ALL=C

usage() {
    cat >&2 <<EOF
usage: $0 [--deb] [--binary FILE] [--out DIR]
  --deb          make a Debian package as well; it takes cargo-deb
  --binary FILE  pack this program instead of building one
  --out DIR      the folder for the packages, by default dist
EOF
    exit 2
}

fail() {
    printf '%s: %s\n' "$0" "$*" >&2
    exit 1
}

deb="" binary="" out=""
while [ $# -gt 0 ]; do
    case $1 in
    --deb)
        deb=yes
        shift
        ;;
    --binary | --out)
        [ $# -ge 2 ] && [ -n "$2" ] || usage
        [ "${2#/}" != "$2" ] || set -- "$1" "$PWD/$2" "${@:3}"
        [ "$1" = --out ] && out=$2 || binary=$2
        shift 2
        ;;
    *) usage ;;
    esac
done
[ -z "$binary" ] || [ -x "$binary" ] || fail "$binary is no program"
cd "$(dirname "$0")/.."
out=${out:-$PWD/dist}
cargo=${CARGO:-cargo}
target=$(rustc -vV | sed -n 's/^host: //p')

[[ $(tar --version 2>/dev/null) == *GNU* ]] || fail "GNU tar is missing; it sorts the names in an archive"
command -v strip >/dev/null || fail "strip is missing; on Debian: sudo apt-get install binutils"
[ -z "$deb" ] || "$cargo" deb --version >/dev/null 2>&1 || fail "cargo-deb is missing; run: cargo install cargo-deb --locked"
if [ -z "$binary" ]; then
    "$cargo" build --release --locked -p photoncard --features study
    binary=${CARGO_TARGET_DIR:-target}/release/photoncard
fi
version=$("$binary" -V) || fail "$binary states no version"
version=${version#photoncard }
time=${SOURCE_DATE_EPOCH:-$(git log -1 --format=%ct)} || fail "outside of git SOURCE_DATE_EPOCH states the time of the files"
name=photoncard-$version-$target

# Licences of the crates that are in the program, with their texts, and where the sources are, as the MPL asks.
third_party() {
    local crates=${CARGO_HOME:-$HOME/.cargo}/registry/src crate version licence folder texts text
    "$cargo" tree --locked -p photoncard --features study -e normal --target "$target" --prefix none --format '{p} {l}' |
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

work=$(mktemp -d)
trap 'rm -rf "$work"' EXIT
files=$work/$name
mkdir -p "$files"/{bin,completions,scenes,share/man/man1}
install -m 755 "$binary" "$files/bin/photoncard"
strip "$files/bin/photoncard"
"$files/bin/photoncard" man "$files/share/man/man1"
for shell in bash elvish fish powershell zsh; do
    "$files/bin/photoncard" completions "$shell" >"$files/completions/photoncard.$shell"
done
cp LICENSE-APACHE LICENSE-MIT README.md CHANGELOG.md "$files"
cp -r docs "$files/docs"
cp scenes/README.md scenes/cornell.gltf "$files/scenes"
third_party >"$files/LICENSES-OF-CRATES.txt"
cp driver/scene/src/sky/hosek_wilkie_license.txt "$files/LICENSE-OF-SKY-DATA.txt"

mkdir -p "$out"
tar --sort=name --mtime="@$time" --owner=0 --group=0 --numeric-owner --mode=u+rw,go=u-w --format=ustar -C "$work" -cf - "$name" |
    gzip -9n >"$work/archive"

# The archive as its user has it: unpacked elsewhere, it renders.
mkdir "$work/unpacked"
tar -C "$work/unpacked" -xzf "$work/archive"
(
    cd "$work/unpacked/$name"
    [ "$(bin/photoncard -V)" = "photoncard $version" ] || fail "the packed program does not state its version"
    bin/photoncard render scenes/cornell.gltf --quiet --quality paper --size 16x16 --photons 1000 -o "$work/cornell.png" ||
        fail "the packed program does not render the packed scene"
)
mv "$work/archive" "$out/$name.tar.gz"
echo "$out/$name.tar.gz"

if [ -n "$deb" ]; then
    staged=${CARGO_TARGET_DIR:-target}/release/deb
    rm -rf "$staged"
    mkdir -p "${staged%/*}"
    cp -r "$files" "$staged"
    SOURCE_DATE_EPOCH=$time "$cargo" deb -p photoncard --no-build --no-strip --output "$out/"
fi
