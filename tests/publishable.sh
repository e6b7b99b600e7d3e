#!/usr/bin/env bash
# Packs the crates as crates.io takes them, and rehearses their publication. Works on a copy in which `publish` is true: the
# owner's switch in Cargo.toml stays as it is. Exit status 75: the packages are sound, and the index of crates.io cannot be had.
set -euo pipefail
cd "$(dirname "$0")/.."
crates=(photoncard-{shared,firmware,picture,denoise,scene,map,cards,render,study,driver} photoncard)
max_kilobytes=1024

fail() {
    printf '%s: %s\n' "$0" "$*" >&2
    exit 1
}

copy=$(mktemp -d)
trap 'rm -rf "$copy"' EXIT
tar --exclude=./target --exclude=./.git --exclude=./dist -cf - . | tar -xf - -C "$copy"
cd "$copy"
sed -i.before 's/^publish = false$/publish = true/' Cargo.toml && rm Cargo.toml.before
grep -q '^publish = true$' Cargo.toml || fail "Cargo.toml has no line 'publish = false' to switch"
export CARGO_TARGET_DIR=$copy/target
options=(--no-verify --allow-dirty --locked)
# Tests and benchmarks need the repository; cargo names each that a package is without.
quieted() { grep -v '^warning: ignoring \(test\|benchmark\|example\) ' >&2 || true; }

cargo package "${crates[@]/#/--package=}" "${options[@]}" --offline 2> >(quieted)
for crate in "${crates[@]}"; do
    package=(target/package/"$crate"-[0-9]*.crate)
    [ "${#package[@]}" = 1 ] && [ -s "${package[0]}" ] || fail "$crate has not been packed"
    folder=$(basename "${package[0]}" .crate)
    contents=$(tar -tzf "${package[0]}")
    for file in Cargo.toml LICENSE-APACHE LICENSE-MIT README.md src/; do
        grep -q "^$folder/$file" <<<"$contents" || fail "the package of $crate lacks $file"
    done
    manifest=$(tar -xzOf "${package[0]}" "$folder/Cargo.toml")
    for field in description readme keywords categories license documentation rust-version; do
        grep -q "^$field = " <<<"$manifest" || fail "the package of $crate states no $field"
    done
    kilobytes=$((($(wc -c <"${package[0]}") + 1023) / 1024))
    [ "$kilobytes" -le "$max_kilobytes" ] || fail "the package of $crate has $kilobytes KB: see its 'include'"
    printf '%s: %d files, %d KB\n' "$folder" "$(wc -l <<<"$contents")" "$kilobytes"
done

if ! cargo publish --workspace --dry-run "${options[@]}" 2>said; then
    cat said >&2
    ! grep -q 'network error' said || exit 75
    fail "the crates cannot be published"
fi
