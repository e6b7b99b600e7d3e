"""Renders landscapes of an eighth to twice 300,000 triangles and 64 MB of texels, and prints what each phase took.

Times are the least of some rounds, with one thread for the host and one chip."""

import argparse
import json
import resource
import subprocess
import sys
from pathlib import Path

import scene

TRIANGLES = 300_000
TEXEL_BYTES = 64 << 20
# What is measured: times in seconds as `--stats` names them.
PHASES = ["scene", "hierarchy", "photons", "photon_map", "discs", "load", "render"]
SETTINGS = "--size 256x256 --gather-rays 16 --photons 200000 --card emulated:1 --threads 1 --quiet".split()


def main():
    """See the module."""
    arguments = parse()
    arguments.folder.mkdir(parents=True, exist_ok=True)
    print("| triangles | texels, MB | file, MB | " + " | ".join(PHASES) + " | CPU s | image, MB | memory, MB |")
    print("|---" * (len(PHASES) + 6) + "|")
    for halvings in arguments.halvings:
        path = arguments.folder / f"landscape-{halvings}.glb"
        if not path.exists():
            path.write_bytes(scene.landscape(int(TRIANGLES * 0.5**halvings), halvings))
        rounds = [render(arguments, path) for _ in range(arguments.rounds)]
        times = [min(statistics["time_s"][phase] for statistics in rounds) for phase in PHASES]
        cells = [TRIANGLES * 0.5**halvings, megabytes(TEXEL_BYTES * 0.5**halvings), megabytes(path.stat().st_size)]
        cells = [f"{cell:,.0f}" for cell in cells] + [f"{seconds:.3f}" for seconds in times]
        cells.append(f"{min(statistics['cpu_s'] for statistics in rounds):.2f}")
        cells += [f"{megabytes(rounds[0][key]):,.0f}" for key in ("image_bytes", "peak_memory_bytes")]
        print("| " + " | ".join(cells) + " |", flush=True)


def parse():
    """The command's arguments."""
    parser = argparse.ArgumentParser(description=__doc__)
    parser.add_argument("--photoncard", type=Path, required=True, help="the command")
    parser.add_argument("--folder", type=Path, required=True, help="where scenes and pictures go")
    parser.add_argument("--rounds", type=int, default=3)
    parser.add_argument("--halvings", type=int, nargs="+", default=[3, 2, 1, 0, -1], help="of triangles and texels")
    return parser.parse_args()


def render(arguments, path):
    """The statistics of a render."""
    output, statistics = path.with_suffix(".exr"), path.with_suffix(".json")
    before = cpu_seconds()
    command = [arguments.photoncard, "render", path, "--quality", "paper", "-o", output, "--stats", statistics, *SETTINGS]
    if subprocess.run(command, check=False).returncode != 0:
        sys.exit(f"failed: {' '.join(map(str, command))}")
    return json.loads(statistics.read_text()) | {"cpu_s": cpu_seconds() - before}


def cpu_seconds():
    """Seconds of processors that commands have taken so far."""
    usage = resource.getrusage(resource.RUSAGE_CHILDREN)
    return usage.ru_utime + usage.ru_stime


def megabytes(count):
    """Bytes in MB of 2^20."""
    return count / (1 << 20)


if __name__ == "__main__":
    main()
