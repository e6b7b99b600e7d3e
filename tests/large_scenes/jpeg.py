"""Baseline JPEG files (ITU-T T.81) that are made as coefficients, so that no picture needs to be transformed."""

import struct

import numpy as np

# Coefficients of a block that may not be zero, in zigzag order: no run of zeros takes a code of its own.
COEFFICIENTS = 16
QUANTISER = 8
SIZES = 8
# Codes of one length each are prefix codes, if not the shortest.
DC_BITS, AC_BITS = 4, 8
DC_SYMBOLS = bytes(range(12))
AC_SYMBOLS = bytes([0]) + bytes(run << 4 | size for run in range(COEFFICIENTS - 1) for size in range(1, SIZES + 1))
LUMA, BLUE, RED = 1, 2, 3


def encode(width, height, coefficients):
    """The file of (block, component, coefficient) with components Y, Cb and Cr, blocks by rows; sides are multiples of 8."""
    scan = pack(*tokens(coefficients)).replace(b"\xff", b"\xff\x00")
    components = b"".join(bytes([component, 0x11, 0]) for component in (LUMA, BLUE, RED))
    frame = struct.pack(">BHHB", 8, height, width, 3) + components
    selectors = b"".join(bytes([component, 0]) for component in (LUMA, BLUE, RED))
    return b"".join(
        [
            b"\xff\xd8",
            segment(0xDB, bytes([0]) + bytes([QUANTISER] * 64)),
            segment(0xC0, frame),
            segment(0xC4, table(0x00, DC_BITS, DC_SYMBOLS)),
            segment(0xC4, table(0x10, AC_BITS, AC_SYMBOLS)),
            segment(0xDA, bytes([3]) + selectors + bytes([0, 63, 0])),
            scan,
            b"\xff\xd9",
        ]
    )


def segment(marker, body):
    """A marker and what belongs to it."""
    return bytes([0xFF, marker]) + struct.pack(">H", len(body) + 2) + body


def table(kind, bits, symbols):
    """A Huffman table of codes of one length."""
    counts = bytearray(16)
    counts[bits - 1] = len(symbols)
    return bytes([kind]) + bytes(counts) + symbols


def tokens(coefficients):
    """Values and their lengths in bits, in the order of the scan."""
    blocks = coefficients.reshape(-1, COEFFICIENTS).astype(np.int64)
    differences = np.diff(coefficients[..., 0].astype(np.int64), axis=0, prepend=0).reshape(-1)
    values = np.zeros((len(blocks), COEFFICIENTS + 1), np.int64)
    lengths = np.zeros_like(values)
    size, bits = magnitude(differences)
    values[:, 0], lengths[:, 0] = size << size | bits, DC_BITS + size
    last = np.zeros(len(blocks), np.int64)
    for place in range(1, COEFFICIENTS):
        there = blocks[:, place] != 0
        size, bits = magnitude(blocks[:, place])
        code = 1 + (place - last - 1) * SIZES + size - 1
        values[:, place] = np.where(there, code << size | bits, 0)
        lengths[:, place] = np.where(there, AC_BITS + size, 0)
        last = np.where(there, place, last)
    # The first code says that the rest of a block is zero.
    lengths[:, COEFFICIENTS] = AC_BITS
    return values.reshape(-1), lengths.reshape(-1)


def magnitude(values):
    """How many bits a number takes, and which."""
    size = np.ceil(np.log2(np.abs(values) + 1)).astype(np.int64)
    return size, np.where(values < 0, values + (1 << size) - 1, values)


def pack(values, lengths):
    """Values one after the other, bit by bit; the rest of the last byte is ones."""
    ends = np.cumsum(lengths)
    shifts = np.repeat(ends, lengths) - np.arange(ends[-1]) - 1
    bits = (np.repeat(values, lengths) >> shifts & 1).astype(np.uint8)
    return np.packbits(np.concatenate([bits, np.ones(-len(bits) % 8, np.uint8)])).tobytes()
