"""Tests of a viewport's session with the program that the environment's PHOTONCARD names, without Blender."""

from __future__ import annotations

import json
import os
import shutil
import sys
import tempfile
import threading
import time
import unittest
from collections.abc import Callable
from pathlib import Path

import numpy as np

FOLDER = Path(__file__).resolve().parent.parent
sys.path.insert(0, str(FOLDER))

from photoncard.session import Camera, Session  # noqa: E402

SCENES = FOLDER.parent.parent / "scenes"
PROGRAM = os.environ.get("PHOTONCARD", "")
QUICK = [
    "--size",
    "24x24",
    "--quality",
    "paper",
    "--photons",
    "2000",
    "--gather-rays",
    "8",
    "--card",
    "emulated:1",
]
PATIENCE = 120
"""Seconds of a wait, long enough for a busy machine."""
FRONT = Camera((0.0, 0.0, 2.8), (0.0, 0.0, 1.8), (0.0, 1.0, 0.0), (0.0, 0.0), fov=40.0)


@unittest.skipUnless(PROGRAM, "PHOTONCARD names no program")
class Sessions(unittest.TestCase):
    def setUp(self) -> None:
        self.folder = tempfile.TemporaryDirectory()
        self.addCleanup(self.folder.cleanup)
        for name in ("cornell.gltf", "cornell.bin"):
            if (SCENES / name).exists():
                shutil.copy(SCENES / name, self.folder.name)
        self.scene = Path(self.folder.name, "cornell.gltf")
        self.has_changed = threading.Event()

    def start(self, scene: str = "cornell.gltf") -> Session:
        session = Session([PROGRAM, "view", scene, *QUICK], self.folder.name, self.has_changed.set)
        self.addCleanup(session.stop)
        return session

    def wait(self, is_right: Callable[[], bool]) -> None:
        end = time.monotonic() + PATIENCE
        while not is_right():
            self.assertLess(time.monotonic(), end, "nothing happens")
            self.has_changed.wait(0.1)
            self.has_changed.clear()

    def settle(self, session: Session, number: int) -> np.ndarray:
        self.wait(lambda: session.newest()[0] >= number and bool(session.state.get("settled")))
        picture = session.picture()
        assert picture is not None
        return picture

    def test_a_picture_follows_camera_and_size(self) -> None:
        session = self.start()
        session.resize(40, 24)
        first = self.settle(session, session.look(FRONT))
        self.assertEqual(first.shape, (24, 40, 4))
        self.assertGreater(first[..., :3].mean(), 0)
        # The lamp is at the top, and rows begin at the bottom.
        self.assertGreater(first[12:].mean(), first[:12].mean())
        turned = Camera(FRONT.position, FRONT.look_at, (0.0, -1.0, 0.0), FRONT.shift, fov=40.0)
        upside_down = self.settle(session, session.look(turned))
        self.assertGreater(upside_down[:12].mean(), upside_down[12:].mean())
        self.assertEqual(session.newest()[1], 1.0)

    def test_a_changed_scene_is_read_again_and_a_damaged_one_told(self) -> None:
        session = self.start()
        before = self.settle(session, session.look(FRONT))
        stated = json.loads(self.scene.read_text())
        for material in stated["materials"]:
            if any(material.get("emissiveFactor", [0])):
                material["emissiveFactor"] = [0.0, 0.0, 0.5]
        self.scene.write_text(json.dumps(stated))
        after = self.settle(session, session.reload())
        self.assertGreater(before[..., 0].mean(), 0)
        self.assertEqual(after[..., 0].mean(), 0)
        self.scene.write_text("{")
        session.reload()
        self.wait(lambda: "cornell.gltf" in session.error)
        self.assertFalse(session.is_over)

    def test_a_scene_that_cannot_be_read_ends_with_its_remedy(self) -> None:
        session = self.start("none.gltf")
        self.wait(lambda: session.is_over and bool(session.error))
        self.assertIn("none.gltf", session.error)
        self.assertIn("check that", session.error)
        self.assertIsNone(session.picture())

    def test_a_session_that_is_stopped_ends_its_process(self) -> None:
        session = self.start()
        self.settle(session, session.look(FRONT))
        session.stop()
        self.assertTrue(session.is_over)


if __name__ == "__main__":
    unittest.main()
