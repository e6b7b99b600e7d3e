"""Cost over size: photoncard beside Blender's Cycles, each on one thread. Tables:

- triangles: a terrain, a mesh that is not instanced, and three boxes, under an even sky;
- instances: a tree of 4,000 triangles, placed by nodes that share its mesh;
- photons: those of the map, in scenes/room.glb, 64x64 pixels; Cycles has none;
- pixels: of a picture of scenes/room.glb, one sample each;
- textures: of 4096x4096 texels, on as many squares.

photoncard has fixed settings, so that no pilot chooses them, and Cycles a sample of as many pixels, without adaptive sampling, by
cycles/race.py. Columns:

- scene, photons, pack, hierarchy, map, discs, render: wall seconds of `--stats`; pack contains the next three; total: all phases;
- CPU s: of the whole process. On a machine with other work it is less than the total, and phases are longer in the same ratio;
- RSS: peak memory of the process; per triangle (photon, pixel, texture): this, divided by the size;
- exponent: of CPU s, log of its ratio to the row before over log of the sizes' ratio;
- Cycles: CPU s of the file's import, and of the call that renders, which builds the hierarchy; RSS with Python and Blender.
"""

import argparse
import json
import math
import sys
from pathlib import Path

import process

HERE = Path(__file__).resolve().parent
ROOM = HERE.parents[2] / "scenes" / "room.glb"
SETTINGS = "--card emulated:1 --threads 1 --spp 1 --gather-rays 1 --shadow-rays 1 --irradiance-cache off --adaptive off --aov none --quiet"
PHOTONS, SIDE, LEAVES = 20_000, 64, 4000
SKY = ["--environment", "1,1,1"]
PHASES = ("scene", "photons", "pack", "hierarchy", "photon_map", "discs", "render", "total")
PHASE_HEADS = ("scene", "photons", "pack", "hierarchy", "map", "discs", "render", "total")
PEER_HEADS = ("Cycles import", "render", "exponent", "RSS (GB)")


class Run:
    """A render: its size, the scene, the picture's side and the number of photons."""

    def __init__(self, size, scene=None, side=SIDE, photons=PHOTONS):
        self.size, self.scene, self.side, self.photons = size, scene, side, photons


# By table: the unit of its sizes, and its runs; a scene is a number that scenes.py has, or the room.
TABLES = {
    "triangles": ("triangle", [Run(size, size) for size in (10_000, 100_000, 1_000_000, 4_000_000, 16_000_000)]),
    "instances": ("triangle", [Run(LEAVES * trees, trees) for trees in (10, 100, 1000, 10_000)]),
    "photons": ("photon", [Run(count, photons=count) for count in (10_000, 100_000, 1_000_000, 10_000_000)]),
    "pixels": ("pixel", [Run(side * side, side=side) for side in (256, 512, 1024, 2048, 4096)]),
    "textures": ("texture", [Run(count, count) for count in (1, 4, 16, 32)]),
}


def main():
    """See the module."""
    arguments = parse()
    for name in arguments.tables or TABLES:
        table(arguments, name)


def parse():
    """The command's arguments."""
    parser = argparse.ArgumentParser(description=__doc__, formatter_class=argparse.RawDescriptionHelpFormatter)
    parser.add_argument("tables", nargs="*", metavar="TABLE", help=f"of {', '.join(TABLES)} [default: all]")
    parser.add_argument("--photoncard", type=Path, required=True, help="the command")
    parser.add_argument("--folder", type=Path, required=True, help="where files go")
    parser.add_argument("--most", type=float, default=math.inf, help="leave out sizes above this one")
    parser.add_argument("--memory", type=float, default=0.7e-9 * process.free(), help="stop a program above this memory, GB [default: 0.7 of the free]")
    parser.add_argument("--limit", type=float, default=3600.0, help="stop a program after these seconds of wall time [default: 3600]")
    parser.add_argument("--without-cycles", action="store_true", help="photoncard alone")
    arguments = parser.parse_args()
    unknown = set(arguments.tables) - set(TABLES)
    if unknown:
        parser.error(f"there is no table {', '.join(sorted(unknown))}; there are: {', '.join(TABLES)}")
    arguments.folder.mkdir(parents=True, exist_ok=True)
    return arguments


def table(arguments, name):
    """Prints a table."""
    unit, runs = TABLES[name]
    peers = PEER_HEADS if has_peer(arguments, name) else ()
    heads = (f"{unit}s", *PHASE_HEADS, "CPU s", "exponent", "RSS (GB)", f"bytes per {unit}", "card image (bytes)", *peers)
    print(f"\n{name}:\n\n| {' | '.join(heads)} |\n|{'---:|' * len(heads)}", flush=True)
    before = [None, None]
    for run in runs:
        if run.size <= arguments.most:
            cells, before = row(arguments, name, run, before)
            print(f"| {' | '.join(cells)} |", flush=True)


def has_peer(arguments, name):
    """If a table has columns of Cycles."""
    return name != "photons" and not arguments.without_cycles


def row(arguments, name, run, before):
    """The cells of a run, and the sizes and CPU seconds of both programs, for the exponents of the next one."""
    scene = stage(arguments, name, run)
    sky = [] if scene == ROOM else SKY
    ours, cpu = photoncard(arguments, run, scene, sky, before[0])
    theirs, peer_cpu = cycles(arguments, run, scene, sky, before[1]) if has_peer(arguments, name) else ([], None)
    after = [spent and (run.size, spent) for spent in (cpu, peer_cpu)]
    return [f"{run.size:,}", *ours, *theirs], after


def stage(arguments, name, run):
    """The scene of a run, which is written if it is none of the shipped ones."""
    if run.scene is None:
        return ROOM
    path = arguments.folder / f"{name}-{run.scene}.glb"
    process.run([sys.executable, HERE / "scenes.py", name, run.scene, path], math.inf, math.inf)
    return path


def photoncard(arguments, run, scene, sky, before):
    """The cells of photoncard's render, and its CPU seconds, or None."""
    statistics = arguments.folder / "statistics.json"
    command = [arguments.photoncard, "render", scene, "-o", arguments.folder / "photoncard.exr", "--stats", statistics, *SETTINGS.split()]
    command += ["--size", f"{run.side}x{run.side}", "--photons", run.photons, *sky]
    try:
        used = process.run(command, 1e9 * arguments.memory, arguments.limit)
    except process.Failure as failure:
        return [tidy(failure), *[""] * (len(PHASES) + 4)], None
    found = json.loads(statistics.read_text())
    cells = [f"{found['time_s'][phase]:.2f}" for phase in PHASES]
    cells += [f"{used.cpu:.2f}", exponent(before, run.size, used.cpu), f"{used.memory / 1e9:.3f}"]
    return [*cells, f"{used.memory / run.size:,.0f}", f"{found['image_bytes']:,}"], used.cpu


def cycles(arguments, run, scene, sky, before):
    """The cells of Cycles's render, and its CPU seconds, or None."""
    command = [sys.executable, HERE.parent / "cycles" / "race.py", scene, arguments.folder / "cycles.exr"]
    command += ["--size", f"{run.side}x{run.side}", "--samples", 1, "--reference", *sky]
    try:
        used = process.run(command, 1e9 * arguments.memory, arguments.limit)
    except process.Failure as failure:
        return [tidy(failure), *[""] * (len(PEER_HEADS) - 1)], None
    found = json.loads(used.output.splitlines()[-1])
    spent = found["import_s"] + found["render_s"]
    cells = [f"{found['import_s']:.2f}", f"{found['render_s']:.2f}", exponent(before, run.size, spent)]
    return [*cells, f"{used.memory / 1e9:.3f}"], spent


def exponent(before, size, cpu):
    """The exponent of CPU seconds over size from the row before, or nothing."""
    if before is None:
        return ""
    return f"{math.log(cpu / before[1]) / math.log(size / before[0]):.2f}"


def tidy(failure):
    """A failure's text as a cell of a table."""
    return str(failure).replace("|", "/")


if __name__ == "__main__":
    sys.exit(main())
