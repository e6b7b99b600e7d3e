"""Renders a scene with Mitsuba's path tracer, and prints a line of JSON: CPU seconds (user and system) of the whole process.

    race.py SCENE OUTPUT --size 960x540 --samples N [--seed N] [--environment MAP|R,G,B]

Nothing is clamped, and paths end by Russian roulette alone, so that the picture converges to the same light.
"""

import argparse
import json
import resource

import mitsuba as mi
import numpy as np

mi.set_variant("llvm_ad_rgb")

import scene as scenes  # noqa: E402: needs the variant
from converge import path_tracer  # noqa: E402: needs the variant

# Samples a pixel that are rendered at once: what memory has room for.
PASS = 4


def main():
    """See the module."""
    arguments = parse()
    width, height = (int(side) for side in arguments.size.split("x"))
    scene = scenes.load(arguments.scene, width, height, None, arguments.environment)
    integrator = path_tracer(arguments.scene, max_depth=-1)
    total = np.zeros((height, width, 3))
    for first in range(0, arguments.samples, PASS):
        samples = min(PASS, arguments.samples - first)
        picture = mi.render(scene, integrator=integrator, spp=samples, seed=arguments.seed + first)
        total += samples * np.array(picture)[..., :3]
    mi.Bitmap((total / arguments.samples).astype(np.float32)).write(arguments.output)
    used = resource.getrusage(resource.RUSAGE_SELF)
    print(json.dumps({"cpu_s": used.ru_utime + used.ru_stime}), flush=True)


def parse():
    """The command's arguments."""
    parser = argparse.ArgumentParser(description=__doc__, formatter_class=argparse.RawDescriptionHelpFormatter)
    parser.add_argument("scene", help="a glTF file, seen by its first camera")
    parser.add_argument("output", help="the EXR")
    parser.add_argument("--size", required=True)
    parser.add_argument("--samples", type=int, required=True)
    parser.add_argument("--seed", type=int, default=1)
    parser.add_argument("--environment", help="R,G,B or an equirectangular map")
    return parser.parse_args()


if __name__ == "__main__":
    main()
