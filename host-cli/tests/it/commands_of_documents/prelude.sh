# Runs before each script: renders get these options, as far as a command does not state them, and few photons in any case, so that a
# test has time for them.
small=("--size 16x16" "--quality paper" "--photons 2000" "--gather-rays 8" "--irradiance-cache on")

trap 'kill $(jobs -p) 2>/dev/null || true' EXIT

photoncard() {
    local option word words=()
    case ${1:-} in
    emulate)
        # A card in the background, which says its address when it listens.
        exec "$PHOTONCARD" "$@" >listening
        ;;
    render)
        while [ -n "$(jobs -rp)" ] && [ ! -s listening ]; do sleep 0.02; done
        for option in "${small[@]}"; do
            # shellcheck disable=SC2086 # an option and its value
            [[ " $* " == *" ${option% *} "* ]] || set -- "$@" $option
        done
        for word; do
            [[ ${words[*]: -1} != --photons || ! $word =~ ^[0-9]+$ ]] || word=2000
            words+=("$word")
        done
        set -- "${words[@]}"
        ;;
    esac
    "$PHOTONCARD" "$@"
}

target/release/photoncard() { photoncard "$@"; }

cargo() {
    [[ "$*" == "run --release -p photoncard -- "* ]] || {
        echo "cargo $*: a block with this command is 'sh slow'" >&2
        return 1
    }
    photoncard "${@:6}"
}
