"""Renders a glTF scene with Mitsuba's path tracer: one picture for each number of samples.

Prints for each a line of JSON: samples a pixel, CPU seconds (user and system, of all threads) of the call that renders, and
seconds of everything before it: reading the scene, building, and a first picture of the same kind, for which the kernels
are compiled.
"""

import argparse
import json
import resource

import drjit as dr
import mitsuba as mi

VARIANT = "llvm_ad_rgb"
mi.set_variant(VARIANT)

import scene as scenes  # noqa: E402: needs the variant


def main():
    """See the module."""
    arguments = parse()
    width, height = (int(side) for side in arguments.size.split("x"))
    scene = scenes.load(arguments.scene, width, height, arguments.camera, arguments.environment)
    integrator = mi.load_dict({"type": "path"})
    # The kernels do not depend on the number of samples.
    render(scene, integrator, 1, seed=0)
    prepared = cpu_seconds()
    for samples, output in zip(arguments.spp, arguments.output, strict=True):
        before = cpu_seconds()
        picture = passes(scene, integrator, samples, arguments)
        seconds = cpu_seconds() - before
        mi.Bitmap(picture).write(output)
        print(json.dumps({"spp": samples, "cpu_s": seconds, "prepare_s": prepared}), flush=True)


def parse():
    """The command's arguments."""
    parser = argparse.ArgumentParser(description=__doc__)
    parser.add_argument("scene")
    parser.add_argument("--size", default="512x512")
    parser.add_argument("--camera")
    parser.add_argument("--environment", help="an equirectangular map")
    parser.add_argument("--seed", type=int, default=1)
    parser.add_argument("--spp", type=int, nargs="+", required=True)
    parser.add_argument("--output", nargs="+", required=True, help="an EXR for each number of samples")
    parser.add_argument("--per-pass", type=int, default=256, help="samples a pixel that are rendered at a time")
    return parser.parse_args()


def passes(scene, integrator, samples, arguments):
    """The mean of as many passes as the samples need."""
    total, done = None, 0
    while done < samples:
        now = min(samples - done, arguments.per_pass)
        picture = render(scene, integrator, now, arguments.seed + done) * now
        total = picture if total is None else total + picture
        dr.eval(total)
        done += now
    picture = total / samples
    dr.eval(picture)
    dr.sync_thread()
    return picture


def render(scene, integrator, samples, seed, sensor=0):
    """A picture, computed; by the scene's own camera unless another is given."""
    picture = mi.render(scene, sensor=sensor, integrator=integrator, spp=samples, seed=seed)
    dr.eval(picture)
    dr.sync_thread()
    return picture


def cpu_seconds():
    """CPU seconds of this process so far."""
    usage = resource.getrusage(resource.RUSAGE_SELF)
    return usage.ru_utime + usage.ru_stime


if __name__ == "__main__":
    main()
