"""Renders of shipped scenes, their progress, failures and interrupts."""

import os
import signal
import subprocess
import sys
import tempfile
import threading
import time
import unittest
from pathlib import Path

import numpy as np
import photoncard as pc
from support import QUICK, SCENES, program

#: A command whose help has JSON progress and whose render waits for an interrupt.
WAITING = """
case "$*" in *--help*)
for name in output stats size quality camera aov; do echo "      --$name <VALUE>"; done
echo '      --progress <FORM>'; echo '          - json: A'; exit 0;; esac
trap 'kill $! 2>/dev/null; echo stopped >"$0.said"; exit 130' INT
echo '{"kind":"progress","phase":"tiles","done":1,"total":9,"seconds":1,"seconds_left":null,"more":1}' >&2
echo '{"kind":"unknown"}' >&2
sleep 60 & wait
"""
INTERRUPTED = """
import photoncard as pc, sys
from pathlib import Path
scene = pc.Scene(Path("a.glb"), {}, {})
try:
    scene.render(progress=lambda progress: print(progress.done, flush=True))
except KeyboardInterrupt:
    print("interrupted", flush=True)
"""


class Renders(unittest.TestCase):
    @classmethod
    def setUpClass(cls):
        cls.scene = pc.load(SCENES / "cornell.gltf")
        cls.seen = []
        cls.picture = cls.scene.render(
            (24, 16),
            aov=["direct", "indirect", "caustic", "Z", "N", "object"],
            progress=cls.seen.append,
            **QUICK,
        )

    def test_the_image_is_the_sum_of_its_parts(self):
        picture = self.picture
        self.assertEqual(
            (picture.image.shape, picture.image.dtype, picture.size), ((16, 24, 3), np.float32, (24, 16))
        )
        self.assertGreater(picture.image.mean(), 0.01)
        total = picture["direct"] + picture["indirect"] + picture["caustic"]
        np.testing.assert_allclose(total, picture.image, atol=1e-5)
        self.assertEqual(picture["Z"].shape, (16, 24))
        lengths = np.linalg.norm(picture["N"], axis=2)
        self.assertLessEqual(lengths.max(), 1.001)

    def test_mattes_cover_what_surfaces_cover(self):
        mattes = self.picture.mattes()
        self.assertGreater(len(mattes), 1)
        total = sum(mattes.values())
        self.assertLessEqual(total.max(), 1.001)
        with self.assertRaisesRegex(pc.UnknownName, "mattes"):
            self.picture["object"]

    def test_statistics_and_provenance_are_of_the_render(self):
        pixels = self.picture.stats["provenance"]["pixels"]
        self.assertEqual((pixels["photons"], pixels["size"]), (2000, [24, 16]))
        self.assertEqual(self.picture.provenance["photons"], 2000)

    def test_progress_ends_with_all_tiles(self):
        tiles = [progress for progress in self.seen if progress.phase == "tiles"]
        self.assertEqual(tiles[-1].done, tiles[-1].total)

    def test_pictures_are_written_and_shown(self):
        png = b"\x89PNG\r\n"
        self.assertTrue(self.picture._repr_png_().startswith(png))
        with tempfile.TemporaryDirectory() as folder:
            plain = self.picture.to_png(Path(folder, "a.png")).read_bytes()
            dark = self.picture.to_png(Path(folder, "b.png"), exposure=-8).read_bytes()
            self.assertEqual(plain, self.picture._repr_png_())
            self.assertTrue(dark.startswith(png) and dark != plain)
            again = pc.read(self.picture.save(Path(folder, "c.exr")))
            np.testing.assert_array_equal(again.image, self.picture.image)
            self.assertTrue(again._repr_png_().startswith(png))
            with self.assertRaisesRegex(pc.Error, "absent"):
                self.picture.to_png(Path(folder, "absent", "a.png"))

    def test_missing_layers_are_named(self):
        with self.assertRaisesRegex(pc.UnknownName, "'illuminance'.*'indirect'"):
            self.picture["illuminance"]

    def test_assignments_change_the_picture(self):
        scene = pc.load(SCENES / "room.glb")
        options = {**QUICK, "size": (16, 12), "photons_for": "scene"}
        before = scene.render(**options).image.mean()
        scene["lamp"].emission = 0
        after = scene.render(**options).image.mean()
        self.assertLess(after, 0.95 * before)

    def test_groups_are_mixed(self):
        scene = pc.load(SCENES / "room.glb")
        picture = scene.render(size=(16, 12), light_groups={"lamp": "lamp", "day": "window"}, **QUICK)
        dark = picture.mix(lamp=1, day=0)
        np.testing.assert_allclose(dark.image, picture["light_lamp"], rtol=1e-5, atol=1e-6)

    def test_frames_are_pictures_of_their_own(self):
        frames = pc.load(SCENES / "cornell-moving.glb").animate([1, 12], size=(16, 16), **QUICK)
        self.assertEqual(len(frames), 2)
        self.assertFalse(np.array_equal(frames[0].image, frames[1].image))

    def test_failures_have_message_remedy_and_status(self):
        with self.assertRaises(pc.Error) as caught:
            self.scene.render(camera="absent", **QUICK)
        self.assertIn("'absent'", caught.exception.message)
        self.assertIn("choose", caught.exception.remedy)
        self.assertEqual(caught.exception.status, 2)
        with self.assertRaisesRegex(pc.Error, "output='picture.exr'"):
            self.scene.render(resume=True)

    def test_stated_outputs_are_kept(self):
        with tempfile.TemporaryDirectory() as folder:
            path = Path(folder, "kept.exr")
            picture = self.scene.render((16, 16), output=path, **QUICK)
            self.assertEqual(picture.path, path)
            self.assertEqual(os.listdir(folder), ["kept.exr"])


class Interrupts(unittest.TestCase):
    def setUp(self):
        # A process that a shell has started in the background ignores interrupts.
        before = signal.signal(signal.SIGINT, signal.default_int_handler)
        self.addCleanup(signal.signal, signal.SIGINT, before)

    def interrupted(self, whole_group):
        with program(WAITING) as path:
            child = subprocess.Popen(
                [sys.executable, "-c", INTERRUPTED], stdout=subprocess.PIPE, text=True, start_new_session=True
            )
            self.assertEqual(child.stdout.readline(), "1\n")
            start = time.monotonic()
            os.killpg(child.pid, signal.SIGINT) if whole_group else child.send_signal(signal.SIGINT)
            said, _ = child.communicate(timeout=30)
            self.assertEqual(said, "interrupted\n")
            self.assertEqual(Path(f"{path}.said").read_text(), "stopped\n")
            return time.monotonic() - start

    def test_an_interrupt_of_python_reaches_the_command(self):
        self.assertLess(self.interrupted(False), 20)

    def test_an_interrupt_of_the_terminal_is_waited_for(self):
        self.assertLess(self.interrupted(True), 20)

    def test_a_render_is_interrupted(self):
        scene = pc.load(SCENES / "cornell.gltf")
        stop = threading.Event()

        def interrupt(progress):
            if not stop.is_set():
                stop.set()
                os.kill(os.getpid(), signal.SIGINT)

        with self.assertRaises(KeyboardInterrupt):
            scene.render((512, 512), "final", progress=interrupt)
        self.assertTrue(stop.is_set())
        self.assertEqual(pc.load(SCENES / "cornell.gltf").path, scene.path)

    def test_what_progress_raises_stops_the_render(self):
        def fail(progress):
            raise ZeroDivisionError

        with self.assertRaises(ZeroDivisionError):
            pc.load(SCENES / "cornell.gltf").render((512, 512), "final", progress=fail)


if __name__ == "__main__":
    unittest.main()
