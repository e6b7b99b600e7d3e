"""Traffic of the headline renders in scenes of one's own: naive, exact reordering, all techniques. See tests/peers/courtyard.sh."""

import argparse
import csv
import re
import subprocess
import sys
from pathlib import Path

# The settings of `photoncard study scaling`, which hold for every line.
FRAME = "--quality paper --size 512x512 --filter box --spp 1 --neighbors 100 --gather-rays 100 --shadow-rays 8 --seed 0"
ONE_CHIP = "--card emulated --in-flight 1"
BARE = "--sampling brdf --irradiance-cache off"
ALL = "--order sort --photon-map lines --tile 64 --sampling combined --irradiance-cache on --ic-error 0.025"
LINES = {
    "naive": f"--order naive --photon-map jensen --tile 16 {BARE} {ONE_CHIP}",
    "`sort` alone": f"--order sort --photon-map jensen --tile 16 {BARE} {ONE_CHIP}",
    "exact reordering": f"--order sort --photon-map lines --tile 64 {BARE} {ONE_CHIP}",
    "all techniques": f"{ALL} {ONE_CHIP}",
}
LARGE_CHIP = ("all, 2 MB chip, 4 tiles in flight", f"{ALL} --card emulated-large --in-flight 4 --cache photon=128K/128/4,scene=128K/128/4")
LIMIT_S = 3600
PHOTON_MAP, SCENE, BOTH, GATHER = "photon map (GB)", "scene (GB)", "photon map and scene (GB)", "photon map (bytes a gather)"
HEADS = ("scene", "photons", "render", "photon map", "times less", "scene", "of which textures", "both", "times less")


def main():
    """See the module."""
    arguments = parse()
    print(f"GB of a frame from DRAM:\n\n| {' | '.join(HEADS)} |\n|{'---|' * len(HEADS)}", flush=True)
    lines = LINES | (dict([LARGE_CHIP]) if arguments.large_chip else {})
    for scene in arguments.scenes:
        naive = None
        for name, options in lines.items():
            points = sweep(arguments, scene, name, options)
            naive = naive or points
            for point, base in zip(points, naive, strict=True):
                print(f"| {' | '.join([scene.file.stem, *point.cells(name, base)])} |", flush=True)
        for point in naive:
            print(f"{scene.file.stem}, {point.photons} photons, naive: {point.bytes[GATHER] / 1e3:.3g} KB of the photon map a gather", flush=True)


class Point:
    """A render of a scene by a number of photons, from a sweep's tables."""

    def __init__(self, photons, row, structures):
        self.photons = photons
        self.bytes = {key: float(row[key]) for key in (PHOTON_MAP, SCENE, BOTH, GATHER)}
        self.textures = sum(float(row["from DRAM (GB)"]) for row in structures if row["structure"] == "textures")

    def cells(self, name, naive):
        """The point's row of the table."""

        def less(key):
            return naive.bytes[key] / self.bytes[key]

        numbers = [self.bytes[PHOTON_MAP], less(PHOTON_MAP), self.bytes[SCENE], self.textures, self.bytes[BOTH], less(BOTH)]
        return [str(self.photons), name, *(f"{number:.3g}" for number in numbers)]


class Scene:
    """A file, and after a comma options that it needs."""

    def __init__(self, text):
        file, _, options = text.partition(",")
        self.file, self.options = Path(file), options.split()


def parse():
    """The command's arguments."""
    parser = argparse.ArgumentParser(description=__doc__)
    parser.add_argument("--photoncard", type=Path, required=True, help="the command")
    parser.add_argument("--folder", type=Path, required=True, help="where the sweeps' reports go")
    parser.add_argument("--photons", default="500000,2000000", help="photons of the map, with commas between them [%(default)s]")
    parser.add_argument("--sample", default="1/17", help="share of the tiles that is rendered [%(default)s]")
    parser.add_argument("--large-chip", action="store_true", help="also whole frames on the large chip, minutes each")
    parser.add_argument("--scenes", type=Scene, nargs="+", required=True, metavar="FILE[,OPTIONS]")
    return parser.parse_args()


def sweep(arguments, scene, name, options):
    """The points of a line, one for each number of photons."""
    out = arguments.folder / scene.file.stem / "-".join(re.findall(r"\w+", name))
    command = [arguments.photoncard, "study", "sweep", scene.file, "--out", out, "--sample", arguments.sample, "--quiet"]
    command += [*FRAME.split(), *options.split(), *scene.options, "--vary", f"photons={arguments.photons}"]
    done = subprocess.run([str(word) for word in command], check=False, timeout=LIMIT_S, stdout=sys.stderr)
    if done.returncode != 0:
        sys.exit(f"{name} of {scene.file}: photoncard failed")
    rows, structures = table(out / "points.csv"), table(out / "structures.csv")
    numbers = arguments.photons.split(",")
    return [
        Point(photons, row, [part for part in structures if part.get("photons", photons) == photons])
        for photons, row in zip(numbers, rows, strict=True)
    ]


def table(path):
    """The rows of a CSV file."""
    with open(path, newline="") as file:
        return list(csv.DictReader(file))


if __name__ == "__main__":
    main()
