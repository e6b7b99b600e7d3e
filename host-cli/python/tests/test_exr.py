"""The reader of EXR files against files that the test writes by the format's description."""

import struct
import tempfile
import unittest
import zlib
from pathlib import Path

import numpy as np
import photoncard as pc

WIDTH, HEIGHT = 5, 19
TYPES = {np.dtype("<u4"): 0, np.dtype("<f2"): 1, np.dtype("<f4"): 2}


def packed(block):
    half = block[0::2] + block[1::2]
    differences = [half[0]] + [(b - a + 128) % 256 for a, b in zip(half, half[1:])]
    data = zlib.compress(bytes(differences))
    return data if len(data) < len(block) else block


def attribute(name, kind, value):
    return name.encode() + b"\0" + kind.encode() + b"\0" + struct.pack("<i", len(value)) + value


def exr(channels, compression, together):
    height, width = next(iter(channels.values())).shape
    heads = b"".join(
        name.encode() + b"\0" + struct.pack("<iiii", TYPES[samples.dtype], 0, 1, 1)
        for name, samples in sorted(channels.items())
    )
    box = struct.pack("<4i", 3, 7, 3 + width - 1, 7 + height - 1)
    head = b"v/1\x01" + struct.pack("<I", 2)
    head += attribute("channels", "chlist", heads + b"\0")
    head += attribute("compression", "compression", bytes([compression]))
    head += attribute("dataWindow", "box2i", box) + attribute("displayWindow", "box2i", box)
    head += attribute("photoncard", "string", b'{"seed": 1}') + b"\0"
    blocks = []
    for first in range(0, height, together):
        rows = b"".join(
            channels[name][row].tobytes()
            for row in range(first, min(first + together, height))
            for name in sorted(channels)
        )
        data = packed(rows) if compression else rows
        blocks.append(struct.pack("<ii", 7 + first, len(data)) + data)
    at, offsets = len(head) + 8 * len(blocks), []
    for block in blocks:
        offsets.append(at)
        at += len(block)
    return head + struct.pack(f"<{len(blocks)}Q", *offsets) + b"".join(blocks)


def pixels():
    smooth = np.linspace(0, 8, WIDTH * HEIGHT).reshape(HEIGHT, WIDTH)
    return {
        "R": smooth.astype("<f4"),
        "G": (smooth / 3).astype("<f2"),
        "B": np.sqrt(smooth).astype("<f4"),
        "id": np.arange(WIDTH * HEIGHT, dtype="<u4").reshape(HEIGHT, WIDTH),
    }


class Exr(unittest.TestCase):
    def setUp(self):
        folder = tempfile.TemporaryDirectory()
        self.addCleanup(folder.cleanup)
        self.path = Path(folder.name, "a.exr")

    def read(self, content):
        self.path.write_bytes(content)
        return pc.read_exr(self.path)

    def test_all_types_and_compressions_are_read_exactly(self):
        for compression, together in ((0, 1), (2, 1), (3, 16)):
            with self.subTest(compression=compression):
                read = self.read(exr(pixels(), compression, together))
                self.assertEqual(read.data_window, (3, 7, 7, 25))
                self.assertEqual(read.texts, {"photoncard": '{"seed": 1}'})
                for name, samples in pixels().items():
                    np.testing.assert_array_equal(read.channels[name], samples)
                    self.assertEqual(read.channels[name].dtype, np.uint32 if name == "id" else np.float32)

    def test_other_compressions_are_named(self):
        with self.assertRaisesRegex(pc.Error, "PIZ"):
            self.read(exr(pixels(), 4, 32))

    def test_tiles_are_refused(self):
        content = bytearray(exr(pixels(), 0, 1))
        content[5] |= 2
        with self.assertRaisesRegex(pc.Error, "tiles"):
            self.read(bytes(content))

    def test_every_truncation_is_an_error(self):
        whole = exr(pixels(), 3, 16)
        for length in range(len(whole)):
            with self.assertRaises(pc.Error, msg=length):
                self.read(whole[:length])

    def test_no_changed_byte_is_another_exception(self):
        whole = exr(pixels(), 3, 16)
        random = np.random.default_rng(1)
        failed = 0
        for _ in range(400):
            content = bytearray(whole)
            content[random.integers(len(whole))] = random.integers(256)
            try:
                self.read(bytes(content))
            except pc.Error:
                failed += 1
        self.assertGreater(failed, 100)

    def test_a_missing_file_is_named(self):
        with self.assertRaisesRegex(pc.Error, "absent.exr.*check the path"):
            pc.read_exr("absent.exr")


if __name__ == "__main__":
    unittest.main()
