"""Scenes, assignments and options."""

import os
import unittest
from pathlib import Path

import photoncard as pc
from photoncard._command import options_of, words_of
from support import SCENES, environment, program


class Scenes(unittest.TestCase):
    @classmethod
    def setUpClass(cls):
        cls.room = pc.load(SCENES / "room.glb")

    def tearDown(self):
        self.room.reset()

    def test_contents_are_those_of_the_file(self):
        self.assertEqual([camera["name"] for camera in self.room.cameras], ["camera"])
        self.assertEqual(len(self.room.materials), 11)
        self.assertEqual(self.room.lights, [])
        self.assertEqual(self.room["lamp"].emission, (14.0, 12.0, 9.5))

    def test_assignments_are_stated_and_taken_back(self):
        self.room["lamp"].emission = 1, 2, 3
        self.room["lamp"].alpha = 0.5
        self.assertEqual(self.room["lamp"].emission, (1, 2, 3))
        self.assertEqual(self.room.stated({})["set"], ["lamp.emission=1,2,3", "lamp.alpha=0.5"])
        del self.room["lamp"].alpha
        self.assertEqual(
            self.room.stated({"set": {"floor.alpha": 1}})["set"], ["lamp.emission=1,2,3", "floor.alpha=1"]
        )
        self.room.reset()
        self.assertNotIn("set", self.room.stated({}))

    def test_lights_have_other_properties_than_materials(self):
        moving = pc.load(SCENES / "cornell-moving.glb")
        name = moving.lights[0]["name"]
        self.assertGreater(moving[name].intensity, 0)
        self.assertEqual(max(moving[name].colour), 1)
        with self.assertRaisesRegex(pc.UnknownProperty, "'intensity'"):
            moving[name].intensty = 1

    def test_wrong_names_and_values_are_refused(self):
        with self.assertRaisesRegex(pc.UnknownName, "no 'lmp'; there are 'lamp'"):
            self.room["lmp"]
        with self.assertRaisesRegex(pc.UnknownProperty, "no 'intensity' to set; there are"):
            self.room["lamp"].intensity = 40
        for value in ((1, 2), "bright", [1, "a", 2]):
            with self.assertRaisesRegex(pc.Error, "lamp.emission is a number or three numbers"):
                self.room["lamp"].emission = value
        with self.assertRaisesRegex(pc.UnknownOption, "'quality' is no option of a scene"):
            pc.load(SCENES / "room.glb", quality="draft")
        self.assertFalse(hasattr(self.room["lamp"], "colour"))
        self.assertEqual(self.room.assignments, {})

    def test_bad_files_are_refused_by_name_and_remedy(self):
        with self.assertRaises(pc.Error) as caught:
            pc.load("absent.glb")
        self.assertIn("absent.glb", caught.exception.message)
        self.assertIn("check that the path", caught.exception.remedy)
        self.assertEqual(caught.exception.status, 2)


class Options(unittest.TestCase):
    def test_every_option_of_the_help_is_a_keyword(self):
        known = options_of(pc.command(), "render")
        self.assertGreater(len(known), 60)
        for name in (
            "light_groups",
            "camera_at",
            "energy_compensation",
            "display_server",
            "ic_error",
            "output",
        ):
            self.assertIn(name, known)

    def test_colours_of_the_command_are_off(self):
        options_of.cache_clear()
        with environment(CLICOLOR_FORCE="1", FORCE_COLOR="1"):
            self.assertIn("order", options_of(pc.command(), "study", "sweep"))
            with self.assertRaisesRegex(pc.Error, "^cannot read absent.glb"):
                pc.load("absent.glb")

    def test_values_become_words(self):
        options = {
            "size": (64, 48),
            "aov": ["direct", "N"],
            "card": ["emulated:1", "tcp:a:1"],
            "transparent": True,
            "irradiance": False,
            "irradiance_cache": True,
            "camera_at": (0, 1.5, -2),
            "seed": None,
            "light_groups": {"key": ["lamp", "sun"]},
            "environment": Path("sky.exr"),
        }
        self.assertEqual(
            words_of(["render"], options),
            [
                "--size=64x48",
                "--aov=direct,N",
                "--card=emulated:1",
                "--card=tcp:a:1",
                "--transparent",
                "--irradiance-cache=on",
                "--camera-at=0,1.5,-2",
                "--light-groups=key=lamp,sun",
                "--environment=sky.exr",
            ],
        )

    def test_wrong_keywords_are_refused(self):
        with self.assertRaisesRegex(pc.UnknownOption, "'gatherrays'.*'gather_rays'"):
            words_of(["render"], {"gatherrays": 3})
        with self.assertRaisesRegex(pc.Error, "transparent is a switch"):
            words_of(["render"], {"transparent": "yes"})


class Commands(unittest.TestCase):
    def test_the_command_is_that_of_the_package_or_the_environment(self):
        self.assertTrue(os.access(pc.command(), os.X_OK))
        with program("exit 0") as path:
            self.assertEqual(pc.command(), path)
        with environment(PHOTONCARD="/absent/photoncard"), self.assertRaisesRegex(pc.Error, "no program"):
            pc.command()

    def test_a_command_without_studies_is_named(self):
        scene = pc.load(SCENES / "cornell.gltf")
        with (
            program("exit 2"),
            self.assertRaisesRegex(pc.Error, "no command 'study sweep'.*--features study"),
        ):
            pc.sweep(scene, order=["naive", "sort"])


if __name__ == "__main__":
    unittest.main()
