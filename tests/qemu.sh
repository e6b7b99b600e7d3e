#!/usr/bin/env bash
# Builds the image of a board and starts it in QEMU, until it is interrupted.
# On a pty, QEMU prints the path to be used as --card serial:PATH; a card on a network is --card tcp:localhost:PORT, by default 7000. What
# the image tells of itself goes to standard error, and so does what this script does.
set -euo pipefail
cd "$(dirname "$0")/.."

usage() {
    echo "usage: $0 mps2-an386|virt [pty|unix:PATH]" >&2
    echo "       $0 mps2-an386-tcp [PORT]" >&2
    exit 2
}

case "${1:-}" in
mps2-an386 | mps2-an386-tcp)
    image=$1 target=thumbv7em-none-eabihf package=qemu-system-arm
    qemu=(qemu-system-arm -machine mps2-an386)
    ;;
virt)
    image=virt-riscv32 target=riscv32imafc-unknown-none-elf package=qemu-system-misc
    qemu=(qemu-system-riscv32 -machine virt -bios none -m 64M)
    ;;
*) usage ;;
esac
case "${1#mps2-an386}:${2:-}" in
-tcp:*[!0-9]*) usage ;;
# Nothing but this machine reaches the card, at the card's port 7000.
-tcp:*) link=(-serial none -nic "user,model=lan9118,restrict=on,hostfwd=tcp:127.0.0.1:${2:-7000}-:7000") ;;
*: | *:pty) link=(-serial pty) ;;
*:unix:?*) link=(-serial "$2,server=on,wait=off") ;;
*) usage ;;
esac

command -v "${qemu[0]}" >/dev/null || {
    echo "$0: ${qemu[0]} is missing; run: sudo apt-get install $package" >&2
    exit 1
}
cargo=${CARGO:-cargo}
command -v "$cargo" >/dev/null || {
    echo "$0: cargo is missing; install Rust 1.90 or later with rustup (https://rustup.rs)" >&2
    exit 1
}
# Checked before the build, which would fail only after it has compiled for this machine.
has_target() { [ -d "$(rustc --print target-libdir --target "$target" 2>/dev/null)" ]; }
has_target || {
    echo "$0: adding the target $target to the toolchain" >&2
    rustup target add "$target" >&2 && has_target
} || {
    echo "$0: the target $target is missing; run: rustup target add $target" >&2
    exit 1
}
echo "$0: building the image of $image, which takes some minutes at first" >&2
"$cargo" build --quiet --locked -p photoncard-firmware --bin "$image" --features "board-$image" \
    --target "$target" --profile card
echo "$0: built in $SECONDS s; starting ${qemu[0]}" >&2
exec "${qemu[@]}" -display none -monitor none "${link[@]}" \
    -semihosting-config enable=on,target=native \
    -kernel "${CARGO_TARGET_DIR:-target}/$target/card/$image"
