"""Measurements, bakes and sweeps."""

import tempfile
import unittest
from pathlib import Path
from unittest import mock

import numpy as np
import photoncard as pc
from support import SCENES

DESK = (-1.8, 0.8, -1.4, 1.8, 0.8, 1.4)


class Measures(unittest.TestCase):
    @classmethod
    def setUpClass(cls):
        cls.room = pc.load(SCENES / "room.glb")
        cls.table = pc.measure(cls.room, grid=DESK, spacing=0.9, photons=5000)

    def test_a_grid_has_its_cells(self):
        self.assertEqual(len(self.table), 12)
        self.assertEqual(set(self.table["y"]), {0.8})
        light = self.table["illuminance_lx"]
        np.testing.assert_allclose(self.table["direct_lx"] + self.table["indirect_lx"], light, rtol=1e-5)
        self.assertTrue((self.table["error_lx"] < 0.2 * light).all())
        self.assertIn("12 points", self.table.summary)

    def test_points_are_those_of_the_grid(self):
        places = np.column_stack([self.table[axis] for axis in "xyz"])
        points = pc.measure(self.room, places, photons=5000)
        np.testing.assert_array_equal(points["illuminance_lx"], self.table["illuminance_lx"])
        down = pc.measure(self.room, places[:1], normals=(0, -1, 0), photons=5000)
        self.assertLess(down["direct_lx"][0], 0.5 * self.table["direct_lx"][0])

    def test_probes_have_coefficients(self):
        probes = pc.measure(self.room, [0, 1.2, 0], probes=True, photons=2000, spp=1)
        self.assertEqual(len(probes.columns), 3 + 27)
        self.assertGreater(probes["l0_m0_g"][0], 0)

    def test_bad_points_are_refused(self):
        for points, message in (
            ([[1, 2]], "shape"),
            ([["a", "b", "c"]], "no rows of numbers"),
            ([[0, np.nan, 0]], "the point 0"),
            (None, "points or a grid"),
        ):
            with self.assertRaisesRegex(pc.Error, message):
                pc.measure(self.room, points)
        with self.assertRaisesRegex(pc.Error, "no node walls"):
            pc.measure(self.room, grid="walls", spacing=1)
        with self.assertRaisesRegex(pc.UnknownName, "'illuminance'.*illuminance_lx"):
            self.table["illuminance"]

    def test_pandas_is_optional(self):
        with (
            mock.patch.dict("sys.modules", pandas=None),
            self.assertRaisesRegex(pc.Error, "pip install pandas"),
        ):
            self.table.to_pandas()
        try:
            import pandas
        except ImportError:
            self.skipTest("pandas is missing")
        self.assertIsInstance(self.table.to_pandas(), pandas.DataFrame)
        self.assertEqual(list(self.table.to_pandas().columns), list(self.table.columns))

    def test_a_bake_is_a_scene(self):
        with tempfile.TemporaryDirectory() as folder:
            path = pc.bake(
                pc.load(SCENES / "cornell.gltf"),
                Path(folder, "baked.glb"),
                texels_per_metre=2,
                photons=2000,
                spp=1,
                gather_rays=4,
            )
            self.assertGreater(pc.load(path).info["triangles"], 10)


class Sweeps(unittest.TestCase):
    def test_every_combination_is_a_row(self):
        scene = pc.load(SCENES / "cornell.gltf")
        sweep = pc.sweep(
            scene, order=["naive", "sort"], seed=[1, 2], size=(32, 32), photons=2000, gather_rays=20
        )
        rows = list(zip(sweep.points["order"], sweep.points["seed"]))
        self.assertEqual(rows, [("naive", 1), ("naive", 2), ("sort", 1), ("sort", 2)])
        read = sweep.points["photon map and scene (GB)"]
        self.assertTrue((read[:2] > 2 * read[2:]).all())
        self.assertIn("structures", sweep.tables)

    def test_a_sweep_of_nothing_is_refused(self):
        scene = pc.load(SCENES / "cornell.gltf")
        with self.assertRaisesRegex(pc.Error, "varies nothing"):
            pc.sweep(scene, order="naive")
        with self.assertRaisesRegex(pc.UnknownOption, "'ordr'.*'order'"):
            pc.sweep(scene, ordr=["naive", "sort"])


if __name__ == "__main__":
    unittest.main()
