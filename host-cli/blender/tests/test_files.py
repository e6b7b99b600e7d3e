"""Tests of what needs no Blender: files, packets, events, units of light, the command, and the zip."""

from __future__ import annotations

import json
import math
import os
import re
import struct
import sys
import tempfile
import unittest
import unittest.mock
import zipfile
import zlib
from pathlib import Path

import numpy as np

FOLDER = Path(__file__).resolve().parent.parent
sys.path.insert(0, str(FOLDER))

import build  # noqa: E402
from photoncard import command, events, exr, glb, light_units, packets, passes, png  # noqa: E402
from photoncard.notices import Notices  # noqa: E402

ROOT = FOLDER.parent.parent


class Glb(unittest.TestCase):
    def test_a_file_has_aligned_chunks_and_accessors_that_read_back(self) -> None:
        made = glb.Glb()
        points = np.array([[0, 0, 0], [1, 2, 3], [-1, 5, 2]], np.float32)
        position = made.attribute(points, with_bounds=True)
        image = made.image(b"12345", "image/png", "odd")
        indices = made.indices(np.array([0, 1, 2], np.uint32))
        made.use("KHR_texture_transform")
        made.add_node({"name": "ä"})
        with tempfile.TemporaryDirectory() as folder:
            path = Path(folder) / "a.glb"
            made.write(path)
            data = path.read_bytes()
        magic, version, total = struct.unpack_from("<4sII", data)
        self.assertEqual((magic, version, total), (b"glTF", 2, len(data)))
        length, kind = struct.unpack_from("<I4s", data, 12)
        self.assertEqual((length % 4, kind), (0, b"JSON"))
        root = json.loads(data[20 : 20 + length])
        binary = data[28 + length :]
        self.assertEqual(root["buffers"], [{"byteLength": len(binary)}])
        self.assertEqual(root["extensionsUsed"], ["KHR_texture_transform"])
        self.assertEqual(root["asset"]["generator"], "photoncard-blender")
        accessor = root["accessors"][position]
        self.assertEqual((accessor["min"], accessor["max"]), ([-1, 0, 0], [1, 5, 3]))

        def read(index: int) -> bytes:
            view = root["bufferViews"][index]
            self.assertEqual(view["byteOffset"] % 4, 0)
            return binary[view["byteOffset"] : view["byteOffset"] + view["byteLength"]]

        self.assertEqual(read(accessor["bufferView"]), points.tobytes())
        self.assertEqual(read(root["images"][image]["bufferView"]), b"12345")
        self.assertEqual(read(root["accessors"][indices]["bufferView"]), struct.pack("<3I", 0, 1, 2))

    def test_numbers_that_are_not_finite_are_refused(self) -> None:
        made = glb.Glb()
        made.add_node({"translation": [math.nan, 0, 0]})
        with tempfile.TemporaryDirectory() as folder, self.assertRaises(ValueError):
            made.write(Path(folder) / "a.glb")


class Exr(unittest.TestCase):
    def test_a_written_picture_reads_back(self) -> None:
        pixels = np.random.default_rng(1).random((7, 5, 3), np.float32)
        with tempfile.TemporaryDirectory() as folder:
            path = Path(folder) / "a.exr"
            exr.write(path, pixels)
            read = exr.read(path)
        self.assertEqual((read.width, read.height), (5, 7))
        for index, name in enumerate("RGB"):
            np.testing.assert_array_equal(read.channels[name], pixels[..., index])

    def test_blocks_of_zip_read_back(self) -> None:
        pixels = np.random.default_rng(2).random((40, 6, 3), np.float32).round(1)
        with tempfile.TemporaryDirectory() as folder:
            path = Path(folder) / "a.exr"
            exr.write(path, pixels)
            path.write_bytes(zipped(path.read_bytes(), 40, 6 * 12))
            read = exr.read(path, ["G"])
        self.assertEqual(list(read.channels), ["G"])
        np.testing.assert_array_equal(read.channels["G"], pixels[..., 1])

    def test_a_broken_file_is_an_error_with_its_name(self) -> None:
        whole = (ROOT / "scenes/sky.exr").read_bytes()
        for broken in (
            b"",
            b"nothing",
            whole[:200],
            whole[: len(whole) // 2],
            (ROOT / "tests/references/room.exr").read_bytes(),
        ):
            with tempfile.TemporaryDirectory() as folder:
                path = Path(folder) / "broken.exr"
                path.write_bytes(broken)
                with self.assertRaisesRegex(exr.ExrError, "broken.exr"):
                    exr.read(path)


def zipped(plain: bytes, lines: int, line_bytes: int) -> bytes:
    """A file without compression in blocks of 16 lines with ZIP, by the format's description."""
    place = plain.index(b"compression\0compression\0") + 28
    header = plain[: plain.index(b"screenWindowWidth\0float\0") + 34 - 1]
    header = header[:place] + b"\3" + header[place + 1 :]
    start = len(header) + 8 * lines
    raw = [plain[start + i * (8 + line_bytes) + 8 : start + (i + 1) * (8 + line_bytes)] for i in range(lines)]
    blocks, offsets = [], []
    place = len(header) + 8 * -(-lines // 16)
    for first in range(0, lines, 16):
        joined = b"".join(raw[first : first + 16])
        parted = joined[0::2] + joined[1::2]
        differences = bytes([parted[0]]) + bytes((b - a + 128) & 255 for a, b in zip(parted, parted[1:]))
        packed = zlib.compress(differences)
        data = packed if len(packed) < len(joined) else joined
        blocks.append(struct.pack("<iI", first, len(data)) + data)
        offsets.append(place)
        place += len(blocks[-1])
    return header + struct.pack(f"<{len(offsets)}Q", *offsets) + b"".join(blocks)


class Packets(unittest.TestCase):
    CREATE = bytes([35, 0, 0, 0, 4, 1]) + b"a.exr\0" + struct.pack("<3i", 256, 3, 2) + b"R\0albedo.G\0"
    UPDATE = (
        bytes([84, 0, 0, 0, 6, 0])
        + b"a.exr\0"
        + struct.pack("<i", 2)
        + b"R\0G\0"
        + struct.pack("<4i", 16, 256, 2, 1)
        + struct.pack("<4q", 0, 1, 2, 2)
        + struct.pack("<4f", 1, -2, 0.5, 0)
    )

    def test_packets_in_pieces_of_any_size_give_their_tiles(self) -> None:
        for size in (1, 7, 500):
            reader, tiles = packets.PacketReader(), []
            stream = self.CREATE + self.UPDATE * 2
            for begin in range(0, len(stream), size):
                tiles += reader.feed(stream[begin : begin + size])
            self.assertEqual(len(tiles), 2)
            tile = tiles[1]
            self.assertEqual((tile.x, tile.y, tile.width, tile.height), (16, 256, 2, 1))
            np.testing.assert_array_equal(tile.channels["R"], [[1, 0.5]])
            np.testing.assert_array_equal(tile.channels["G"], [[-2, 0]])

    def test_other_bytes_are_an_error(self) -> None:
        short = self.UPDATE[:28] + struct.pack("<i", 9) + self.UPDATE[32:]
        for broken in (b"\0\0\0\0\0", b"\xff" * 8, b"\x05\0\0\0\x63", short):
            with self.assertRaises(packets.PacketError):
                list(packets.PacketReader().feed(broken))


class Events(unittest.TestCase):
    def test_lines_are_read_and_unknown_ones_ignored(self) -> None:
        line = (
            '{"kind":"progress","phase":"tiles","done":3,"total":12,"seconds":1,"seconds_left":3.4,"new":1}'
        )
        progress = events.parse(line)
        self.assertEqual((progress.phase, progress.share, progress.seconds_left), ("tiles", 0.25, 3.4))
        self.assertIsNone(
            events.parse(
                '{"kind":"progress","phase":"load","done":0,"total":0,"seconds_left":null}'
            ).seconds_left
        )
        self.assertEqual(
            str(events.parse('{"kind":"ignored","message":"fog","items":["a","b"]}')), "fog: a, b"
        )
        failure = events.parse('{"kind":"failure","message":"no light","remedy":"add one","status":2}')
        self.assertEqual(str(failure), "no light\nadd one")
        self.assertIsNone(events.parse('{"kind":"of the future"}'))
        self.assertIsNone(events.parse("\n"))
        self.assertEqual(events.parse("panicked at").message, "panicked at")


class LightUnits(unittest.TestCase):
    def test_lights_have_the_flux_that_they_state(self) -> None:
        self.assertAlmostEqual(4 * math.pi * light_units.point_intensity(60, 0.1), 60)
        area = light_units.ellipse_or_rectangle(0.3, 0.6, True)
        self.assertAlmostEqual(math.pi * area * light_units.area_radiance(15, area), 15)
        self.assertEqual(light_units.sun_irradiance(3, 0.01), 3)

    def test_a_spot_has_the_flux_of_cycles_falloff(self) -> None:
        for size, blend in ((0.8, 0.15), (1.2, 0.5), (1.0, 1.0), (3.1, 0.3)):
            inner, outer = light_units.spot_cones(size, blend)
            cosines = (np.arange(200_000) + 0.5) / 200_000
            edge = math.cos(size / 2)
            t = np.clip((cosines - edge) / (blend * (1 - edge)), 0, 1)
            of_cycles = (t * t * (3 - 2 * t)).mean()
            of_gltf = (
                np.clip((cosines - math.cos(outer)) / (math.cos(inner) - math.cos(outer)), 0, 1) ** 2
            ).mean()
            self.assertAlmostEqual(of_gltf / of_cycles, 1, delta=1e-3)


class Command(unittest.TestCase):
    def test_settings_become_options(self) -> None:
        settings = command.Settings(
            (160, 90),
            (10, 20, 0, 90),
            "draft",
            60.0,
            None,
            True,
            True,
            0,
            ["tcp:a:1", "emulated:2"],
            ["Z", "N"],
        )
        self.assertEqual(
            " ".join(settings.arguments()),
            "--size 160x90 --quality draft --sample-type float --crop 10,20,0,90 --time 60s "
            "--denoise --transparent --caustic-photons 0 --card tcp:a:1 --card emulated:2 --aov Z,N",
        )

    def test_a_missing_program_says_what_helps(self) -> None:
        with tempfile.TemporaryDirectory() as folder:
            with self.assertRaisesRegex(command.CommandError, "preferences"):
                command.find(os.path.join(folder, "none"), folder)
            with unittest.mock.patch.dict(os.environ, {"PATH": folder}):
                with self.assertRaisesRegex(command.CommandError, "Install the extension"):
                    command.find("", folder)

    @unittest.skipIf(sys.platform == "win32", "it is about permissions of Unix")
    def test_the_program_of_the_zip_is_made_executable(self) -> None:
        with tempfile.TemporaryDirectory() as folder:
            program = Path(folder) / "bin" / command.NAME
            program.parent.mkdir()
            program.write_bytes(b"")
            program.chmod(0o644)
            self.assertEqual(command.find("", folder), str(program))
            self.assertTrue(os.access(program, os.X_OK))

    def test_a_run_that_ignores_the_request_to_stop_is_ended(self) -> None:
        stubborn = "import signal, time; signal.signal(signal.SIGTERM, signal.SIG_IGN); time.sleep(60)"
        with tempfile.TemporaryDirectory() as folder, unittest.mock.patch.object(command, "_PATIENCE", 0.5):
            run = command.Run([sys.executable, "-c", stubborn], folder)
            list(run.received(5))
            run.stop()
            self.assertLess(run._process.returncode, 0, "it ended by itself")
            with self.assertRaises(command.CommandError):
                run.check()

    def test_a_failure_is_told_with_its_remedy(self) -> None:
        line = json.dumps({"kind": "failure", "message": "no room", "remedy": "make room", "status": 1})
        code = f"import sys; print({line!r}, file=sys.stderr); sys.exit(1)"
        with tempfile.TemporaryDirectory() as folder:
            run = command.Run([sys.executable, "-c", code], folder)
            while not run.is_over:
                list(run.received(0.1))
            with self.assertRaisesRegex(command.CommandError, "no room\nmake room"):
                run.check()


class Pictures(unittest.TestCase):
    def test_vectors_turn_and_infinite_depth_is_finite(self) -> None:
        normal = passes.Pass("Normal", "XYZ", "VECTOR", ("N.X", "N.Y", "N.Z"), "N")
        channels = {"N.X": np.full((1, 1), 1.0), "N.Y": np.full((1, 1), 2.0), "N.Z": np.full((1, 1), 3.0)}
        np.testing.assert_array_equal(normal.pixels(channels), [[[1, -3, 2]]])
        depth = passes.Pass("Depth", "Z", "VALUE", ("Z",), "Z")
        np.testing.assert_array_equal(depth.pixels({"Z": np.array([[np.inf], [2.0]])}), [[[2]], [[1e10]]])

    def test_a_png_has_the_pixels_of_both_depths(self) -> None:
        for kind in (np.uint8, np.uint16):
            pixels = np.arange(2 * 3 * 3, dtype=kind).reshape(2, 3, 3) * 13
            encoded = png.encode(pixels)
            begin = encoded.index(b"IDAT")
            (length,) = struct.unpack_from(">I", encoded, begin - 4)
            raw = zlib.decompress(encoded[begin + 4 : begin + 4 + length])
            lines = np.frombuffer(raw, np.uint8).reshape(2, -1)
            decoded = np.stack([lines[0, 1:], lines[0, 1:] + lines[1, 1:]])
            np.testing.assert_array_equal(
                decoded.view(np.dtype(kind).newbyteorder(">")).reshape(2, 3, 3), pixels
            )

    def test_notices_name_the_first_and_count_the_others(self) -> None:
        notices = Notices()
        for index in range(7):
            notices.add("fog is not rendered", f"cube {index}")
        self.assertEqual(
            notices.lines(), ["fog is not rendered: cube 0, cube 1, cube 2, cube 3, cube 4 and 2 more"]
        )


class Zip(unittest.TestCase):
    PROGRAM = b"\x7fELF" + bytes(14) + struct.pack("<H", 62) + bytes(40)

    def test_equal_inputs_make_equal_bytes(self) -> None:
        with tempfile.TemporaryDirectory() as folder:
            files = build.contents(self.PROGRAM, build.platform_of(self.PROGRAM))
            first, second = Path(folder) / "a.zip", Path(folder) / "b.zip"
            build.write_zip(first, files)
            build.write_zip(second, dict(reversed(files.items())))
            self.assertEqual(first.read_bytes(), second.read_bytes())
            with zipfile.ZipFile(first) as archive:
                names = archive.namelist()
                manifest = archive.read("blender_manifest.toml").decode()
        self.assertEqual(names, sorted(names))
        self.assertTrue({"__init__.py", "export/objects.py", "bin/photoncard", "LICENSE-MIT"} <= set(names))
        self.assertFalse([name for name in names if "__pycache__" in name])
        self.assertIn('platforms = ["linux-x64"]', manifest)

    def test_platforms_are_those_of_the_program(self) -> None:
        windows = b"MZ" + bytes(58) + struct.pack("<I", 64) + b"PE\0\0" + struct.pack("<H", 0x8664)
        self.assertEqual(build.platform_of(windows), "windows-x64")
        self.assertEqual(
            build.platform_of(b"\xcf\xfa\xed\xfe" + struct.pack("<I", 0x0100000C)), "macos-arm64"
        )
        with self.assertRaises(build.BuildError):
            build.platform_of(b"#!/bin/sh\n")

    def test_the_manifest_has_the_version_of_the_command(self) -> None:
        stated = (FOLDER / "photoncard/blender_manifest.toml").read_text()
        version = re.search(r'(?m)^version = "(.+)"$', (ROOT / "Cargo.toml").read_text()).group(1)
        self.assertIn(f'\nversion = "{version}"\n', stated)


if __name__ == "__main__":
    unittest.main()
