#!/usr/bin/env python3
"""Compares the bytes from DRAM of a render with those of pycachesim, an independent simulator of caches.

    python3 -m venv venv && venv/bin/pip install pycachesim
    photoncard render ... --counters --card emulated:1 --trace T.din.gz --trace-labels --stats S.json
    venv/bin/python tests/peers/pycachesim.py T.din.gz S.json

Reads the caches from the statistics. They must replace the least recently used line, without a hashed index.
"""
import gzip
import json
import re
import sys

from cachesim import Cache, CacheSimulator, MainMemory

PHOTON_MAP = {"photon_nodes", "photons", "irradiance_nodes", "irradiance_points", "caustic_nodes", "caustic_photons"}
# What waits in card memory and what passes keep bypass the caches.
BYPASS = {"waiting", "kept_records"}


class Simulated:
    """A cache of pycachesim that can be emptied; misses are counted over all its fillings."""

    def __init__(self, size, line, ways):
        self.shape = (size // line // ways, ways, line)
        self.before = 0
        self.empty()

    def empty(self):
        memory, self.cache = MainMemory(), Cache("L1", *self.shape, "LRU")
        memory.load_to(self.cache)
        memory.store_from(self.cache)
        self.simulator = CacheSimulator(self.cache, memory)

    def flush(self):
        self.before = self.bytes()
        self.empty()

    def bytes(self):
        return self.before + self.cache.stats()["MISS_count"] * self.shape[2]


def caches_of(text):
    """Caches by name, from the text of `--cache`."""
    parts = re.findall(r"(\w+)=(\d+)(K?)/(\d+)/(\d+)", text)
    return {name: Simulated(int(size) << (10 if kilo else 0), int(line), int(ways)) for name, size, kilo, line, ways in parts}


def simulate(trace, caches):
    work, bypassed = None, 0
    with gzip.open(trace, "rt") as lines:
        for fields in map(str.split, lines):
            if fields[0] == "4":
                work = fields[2] if len(fields) > 2 else None
                for cache in caches.values():
                    cache.flush()
            elif fields[0] == "0":
                address, structure, size = int(fields[1], 16), fields[2], int(fields[-1])
                part = "photon" if structure in PHOTON_MAP else "scene"
                if structure in BYPASS:
                    bypassed += 128
                else:
                    cache = caches.get("unified") or caches.get(work) or caches[part]
                    cache.simulator.load(address, length=size)
    return bypassed + sum(cache.bytes() for cache in caches.values())


def main(trace, stats):
    with open(stats, encoding="utf-8") as file:
        memory = json.load(file)["memory"]
    counted = sum(structure["dram_bytes"] for structure in memory["structures"].values())
    simulated = simulate(trace, caches_of(memory["caches"]))
    print(f"{memory['caches']}: counted {counted} bytes, pycachesim {simulated}")
    return counted != simulated


if __name__ == "__main__":
    if len(sys.argv) != 3:
        sys.exit(__doc__)
    sys.exit(main(*sys.argv[1:]))
