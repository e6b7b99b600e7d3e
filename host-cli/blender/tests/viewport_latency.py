#!/usr/bin/env python3
"""Time from a move of a viewport's camera to its first tile and its first whole picture.

    PHOTONCARD=photoncard viewport_latency.py SCENE.glb [WIDTHxHEIGHT]

The session is that of a viewport; drawing by Blender is not in it.
"""

from __future__ import annotations

import math
import os
import statistics
import sys
import tempfile
import threading
import time
from pathlib import Path

sys.path.insert(0, str(Path(__file__).resolve().parent.parent))

from photoncard.session import Camera, Session  # noqa: E402

MOVES = 20
PATIENCE = 120


def main() -> None:
    """Prints medians and maxima over moves that each follow a picture at rest."""
    if not 2 <= len(sys.argv) <= 3:
        sys.exit(__doc__)
    width, height = map(int, (sys.argv[2] if len(sys.argv) == 3 else "480x270").split("x"))
    scene = os.path.abspath(sys.argv[1])
    changed = threading.Event()
    with tempfile.TemporaryDirectory() as folder:
        session = Session(
            [os.environ["PHOTONCARD"], "view", scene, "--quality", "draft"], folder, changed.set
        )
        try:
            session.resize(width, height)
            wait(session, changed, lambda: bool(session.state.get("settled")))
            camera = session.state["camera"]
            times = [move(session, changed, camera, step) for step in range(MOVES)]
        finally:
            session.stop()
    for name, values in zip(("first tile", "first whole picture"), zip(*times)):
        print(f"{name}: median {1e3 * statistics.median(values):.0f} ms, at most {1e3 * max(values):.0f} ms")


def move(session: Session, changed: threading.Event, camera: dict, step: int) -> tuple[float, float]:
    """Seconds to the first tile and to the first whole picture after a small move."""
    x, y, z = camera["position"]
    place = (x + 0.01 * math.cos(step), y + 0.01 * math.sin(step), z)
    begin = time.monotonic()
    number = session.look(
        Camera(place, tuple(camera["look_at"]), (0.0, 1.0, 0.0), (0.0, 0.0), fov=camera["fov"])
    )
    shown = []
    for share in (1e-9, 1.0):
        wait(session, changed, lambda: session.newest()[0] >= number and session.newest()[1] >= share)
        shown.append(time.monotonic() - begin)
    wait(session, changed, lambda: bool(session.state.get("settled")))
    return shown[0], shown[1]


def wait(session: Session, changed: threading.Event, is_right) -> None:
    """Waits until something is so."""
    end = time.monotonic() + PATIENCE
    while not is_right():
        if session.is_over or time.monotonic() > end:
            sys.exit(session.error or "the view does not go on")
        changed.wait(0.5)
        changed.clear()


if __name__ == "__main__":
    main()
