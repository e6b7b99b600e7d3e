"""The wheel, and the examples of the documentation."""

import csv
import doctest
import importlib
import io
import os
import pkgutil
import re
import struct
import subprocess
import sys
import tempfile
import unittest
import zipfile
from pathlib import Path

import photoncard as pc
from support import ROOT, environment

sys.path.insert(0, str(ROOT / "host-cli/python"))
import build  # noqa: E402

sys.path.pop(0)


class Wheels(unittest.TestCase):
    def test_wheels_are_equal_and_their_record_holds(self):
        with tempfile.TemporaryDirectory() as folder, environment(SOURCE_DATE_EPOCH="1000000000"):
            wheels = [build.build(pc.command(), Path(folder, name)) for name in ("a", "b")]
            self.assertTrue(wheels[0].read_bytes() == wheels[1].read_bytes(), "the wheels differ")
            with zipfile.ZipFile(wheels[0]) as wheel:
                names = wheel.namelist()
                record = next(name for name in names if name.endswith("/RECORD"))
                rows = list(csv.reader(io.StringIO(wheel.read(record).decode())))
                self.assertEqual(sorted(row[0] for row in rows), sorted(names))
                for name, digest, size in rows[:-1]:
                    self.assertEqual(int(size), len(wheel.read(name)))
                    self.assertEqual(digest, "sha256=" + build._digest(wheel.read(name)))
                self.assertIn("photoncard/py.typed", names)

    @unittest.skipUnless(sys.platform == "linux", "the tag of an ELF program")
    def test_the_tag_is_the_greatest_glibc_of_the_symbols(self):
        dumped = subprocess.run(["readelf", "-VW", str(pc.command())], capture_output=True, text=True)
        if dumped.returncode != 0:
            self.skipTest("readelf is missing")
        versions = re.findall(r"GLIBC_2\.(\d+)", dumped.stdout)
        self.assertIn(f"manylinux_2_{max(map(int, versions))}_", build.tag_of(pc.command()))

    def test_other_files_have_no_tag(self):
        with tempfile.TemporaryDirectory() as folder:
            path = Path(folder, "a")
            for content in (
                b"#!/bin/sh\n",
                b"\x7fELF\x02\x01" + bytes(12) + struct.pack("<H", 8) + bytes(90),
            ):
                path.write_bytes(content)
                with self.assertRaises(ValueError):
                    build.tag_of(path)


class Examples(unittest.TestCase):
    def test_examples_of_the_documentation_hold(self):
        self.addCleanup(os.chdir, os.getcwd())
        os.chdir(ROOT)
        attempted = 0
        for module in [
            pc,
            *(
                importlib.import_module(f"photoncard.{found.name}")
                for found in pkgutil.iter_modules(pc.__path__)
            ),
        ]:
            results = doctest.testmod(module)
            self.assertEqual(results.failed, 0, module.__name__)
            attempted += results.attempted
        self.assertGreater(attempted, 20)


if __name__ == "__main__":
    unittest.main()
