#!/usr/bin/env bash
# Worth of the noise that `photoncard render --noise` estimates: for five scenes the true root mean square error over the mean, as a share
# of the noise that was asked for, of the default settings and of those without irradiance records. The reference has 16384 samples without
# records, 4,000,000 photons and another seed, photons included.
#
# usage: tests/noise.sh PHOTONCARD [NOISE] [SIZE]
#
# With NOISE 0.01 and SIZE 32x32, the defaults, some fifteen minutes on two processors. The reference has a noise of its own, of 0.3 % in the Cornell box.
set -euo pipefail
photoncard=$(realpath "${1:?usage: tests/noise.sh PHOTONCARD [NOISE] [SIZE]}")
noise=${2:-0.01}
size=${3:-32x32}
cd "$(dirname "$0")/.."
work=$(mktemp -d)
trap 'rm -rf "$work"' EXIT

report() {
    python3 - "$@" <<'END'
import json, sys
scene, settings, samples, estimated, noise, path = sys.argv[1:]
found = json.load(open(path))
error = found["pixels"]["rmse"] / found["mean_reference"]
print(f"{scene:20} {settings:12} {samples:>8} {float(estimated):9.2f} % {100 * error:9.2f} % {error / float(noise):8.2f}", flush=True)
END
}

printf '%-20s %-12s %8s %11s %11s %8s\n' scene settings samples estimated error "of asked"
for scene in cornell.gltf cornell-glossy.gltf room.glb atrium.glb roughness.glb; do
    plain=(--irradiance-cache off --gather-rays 8 --shadow-rays 1)
    "$photoncard" render "scenes/$scene" --size "$size" "${plain[@]}" --photons 4000000 --seed 9 --spp 16384 --quiet -o "$work/reference.exr"
    for settings in default "no records"; do
        options=()
        [ "$settings" = default ] || options=("${plain[@]}")
        "$photoncard" render "scenes/$scene" --size "$size" "${options[@]}" --noise "$noise" -o "$work/picture.exr" 2>"$work/said"
        samples=$(grep -o '[0-9]* samples a pixel' "$work/said" | tail -1 | cut -d' ' -f1)
        estimated=$(grep -o 'noise [0-9.]* %' "$work/said" | cut -d' ' -f2)
        "$photoncard" diff "$work/picture.exr" "$work/reference.exr" >"$work/diff.json"
        report "$scene" "$settings" "$samples" "$estimated" "$noise" "$work/diff.json"
    done
done
