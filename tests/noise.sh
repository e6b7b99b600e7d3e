#!/usr/bin/env bash
# Worth of the noise that `photoncard render --noise` estimates: for five scenes the true root mean square error over the mean, against
# a picture of the maximum number of samples and another seed (photons included), as a share of the noise that was asked for.
#
# usage: tests/noise.sh PHOTONCARD [NOISE] [SIZE]
#
# With NOISE 0.01 and SIZE 64x64, the defaults, some ten minutes on two processors. The reference has noise of its own, a few tenths of NOISE.
set -euo pipefail
photoncard=$(realpath "${1:?usage: tests/noise.sh PHOTONCARD [NOISE] [SIZE]}")
noise=${2:-0.01}
size=${3:-64x64}
cd "$(dirname "$0")/.."
work=$(mktemp -d)
trap 'rm -rf "$work"' EXIT

printf '%-16s %8s %12s %12s %8s\n' scene samples estimated error "of asked"
for scene in cornell.gltf cornell-glossy.gltf room.glb atrium.glb roughness.glb; do
    options=(--size "$size" --irradiance-cache off --gather-rays 8 --shadow-rays 1 --photons 500000)
    "$photoncard" render "scenes/$scene" "${options[@]}" --seed 9 --spp 4096 --quiet -o "$work/reference.exr"
    "$photoncard" render "scenes/$scene" "${options[@]}" --noise "$noise" -o "$work/picture.exr" 2>"$work/said"
    samples=$(grep -o '[0-9]* samples a pixel' "$work/said" | tail -1 | cut -d' ' -f1)
    estimated=$(grep -o 'noise [0-9.]* %' "$work/said" | cut -d' ' -f2)
    "$photoncard" diff "$work/picture.exr" "$work/reference.exr" >"$work/diff.json"
    python3 - "$scene" "$samples" "$estimated" "$noise" "$work/diff.json" <<'END'
import json, sys
scene, samples, estimated, noise, path = sys.argv[1:]
found = json.load(open(path))
error = found["pixels"]["rmse"] / found["mean_reference"]
print(f"{scene:16} {samples:>8} {float(estimated):10.3f} % {100 * error:10.3f} % {error / float(noise):8.2f}")
END
done
