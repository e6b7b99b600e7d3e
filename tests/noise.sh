#!/usr/bin/env bash
# Worth of the noise that `photoncard render --noise` estimates: for five scenes the true root mean square error over the mean, as a share
# of the noise that was asked for, of the default settings and of those without irradiance records. The references are two pictures of 1024
# samples without records, 2,000,000 photons and other seeds, photons included; half of their squared difference is the squared noise of one,
# which is subtracted.
#
# usage: tests/noise.sh PHOTONCARD [NOISE] [SIZE]
#
# With NOISE 0.01 and SIZE 64x64, the defaults, some twenty minutes on two processors.
set -euo pipefail
photoncard=$(realpath "${1:?usage: tests/noise.sh PHOTONCARD [NOISE] [SIZE]}")
noise=${2:-0.01}
size=${3:-64x64}
cd "$(dirname "$0")/.."
work=$(mktemp -d)
trap 'rm -rf "$work"' EXIT

report() {
    python3 - "$@" <<'END'
import json, sys
scene, settings, samples, estimated, noise, *paths = sys.argv[1:]
found = [json.load(open(path)) for path in paths]
first, second, both = [(one["pixels"]["rmse"] / one["mean_reference"]) ** 2 for one in found]
error = max((first + second - both) / 2, 0) ** 0.5
print(f"{scene:20} {settings:12} {samples:>8} {float(estimated):9.2f} % {100 * error:9.2f} % {error / float(noise):8.2f}", flush=True)
END
}

printf '%-20s %-12s %8s %11s %11s %8s\n' scene settings samples estimated error "of asked"
for scene in cornell.gltf cornell-glossy.gltf room.glb atrium.glb roughness.glb; do
    plain=(--irradiance-cache off --gather-rays 8 --shadow-rays 1)
    for seed in 8 9; do
        "$photoncard" render "scenes/$scene" --size "$size" "${plain[@]}" --photons 2000000 --seed $seed --spp 1024 --quiet -o "$work/$seed.exr"
    done
    "$photoncard" diff "$work/8.exr" "$work/9.exr" >"$work/both.json"
    for settings in default "no records"; do
        options=()
        [ "$settings" = default ] || options=("${plain[@]}")
        "$photoncard" render "scenes/$scene" --size "$size" "${options[@]}" --noise "$noise" -o "$work/picture.exr" 2>"$work/said"
        samples=$(grep -o '[0-9]* samples a pixel' "$work/said" | tail -1 | cut -d' ' -f1)
        estimated=$(grep -o 'noise [0-9.]* %' "$work/said" | cut -d' ' -f2)
        for seed in 8 9; do
            "$photoncard" diff "$work/picture.exr" "$work/$seed.exr" >"$work/$seed.json"
        done
        report "$scene" "$settings" "$samples" "$estimated" "$noise" "$work"/{8,9,both}.json
    done
done
