#!/usr/bin/env python3
"""Compares link.py with the test vectors in vectors.json. Exits with 1 if anything differs.

    python3 docs/protocol/vectors.py
"""
import json
import pathlib
import struct
import sys

from link import (
    LAYOUT, LINE, PROTOCOL, Reader, crc32c, crc64, floats, number, option, parsed_frame, plain_frame, stuffed,
    unstuffed,
)

# Fields of each message, in order. A field is a name and how it is written: a tuple is a structure, a list of
# one an option of it, a dictionary one of its structures after its number, a number a kind below it, a string
# one of `WRITERS`.
VECTOR = "vector"
PROJECTION = {
    0: (),
    1: (("right", VECTOR), ("up", VECTOR), ("focus", "f32")),
    2: (),
    3: (("angles", "pair"),),
    4: (("line", "u32"), ("first", "u32"), ("count", "u32")),
}
CAMERA = (
    ("origin", VECTOR), ("forward", VECTOR), ("right", VECTOR), ("up", VECTOR), ("shift", "pair"),
    ("projection", PROJECTION),
)
CAUSTICS = (("neighbors", "u32"), ("max_distance", "f32"))
FRAME = (
    ("width", "u32"), ("height", "u32"), ("camera", CAMERA), ("seed", "u32"), ("first_sample", "u32"),
    ("samples", "u32"), ("planned_samples", "u32"), ("gather_rays", "u32"), ("shadow_rays", "u32"),
    ("neighbors", "u32"), ("max_distance", "f32"), ("sampling", 5), ("irradiance_error", ["f32"]),
    ("bins", "u32"), ("drain", 4), ("queue", "u32"), ("radiance", 2), ("caustics", [CAUSTICS]),
    ("layers", "flag"), ("filter", 3), ("in_flight", "u32"), ("keep_records", "flag"),
    ("adaptive_threshold", ["f32"]), ("transparent", "flag"), ("position", "flag"), ("coverage", "flag"),
    ("identities", "flag"), ("light_groups", "u8"), ("irradiance", "flag"), ("near_distance", "f32"),
)
BUDGET = tuple(
    (name, "u64" if name == "dram_bytes" else "u32")
    for name in (
        "sram_bytes", "dram_bytes", "photon_cache_bytes", "scene_cache_bytes", "stack_bytes", "tile_pixels",
        "neighbors", "gather_rays", "gather_queue", "irradiance_records", "shadow_rays", "samples", "tiles",
        "in_flight", "waiting_blocks",
    )
)
MEMORY_USE = (("static_bytes", "u32"), ("stack_bytes", "u32"), ("stack_used", "u32"))
BOARD = (("name", "text"), ("serial_number", "text"), ("clock_hz", "u32"))
WORD = (("index", "u32"), ("expected", "u32"), ("found", "u32"))
COMMANDS = (
    ("Hello", (("protocol", "u16"), ("layout", "u16"))),
    ("ReadChecksums", (("first", "u32"), ("count", "u32"))),
    ("BeginImage", (("lines", "u32"), ("checksum", "x64"))),
    ("WriteLines", (("first", "u32"), ("data", "bytes"))),
    ("EndImage", ()),
    ("BeginFrame", FRAME),
    ("RenderTile", (("id", "u32"), ("x", "u32"), ("y", "u32"), ("width", "u32"), ("height", "u32"))),
    ("Compute", (("data", "bytes"),)),
    ("TestMemory", ()),
    ("Flush", ()),
)
REPLIES = (
    ("Hello", (
        ("protocol", "u16"), ("layout", "u16"), ("budget", BUDGET), ("written_lines", "u32"),
        ("memory_use", [MEMORY_USE]), ("build", "text"), ("board", [BOARD]),
    )),
    ("Checksums", (("first", "u32"), ("data", "bytes"))),
    ("ImageAccepted", ()),
    ("FrameAccepted", ()),
    ("Pixels", (("id", "u32"), ("first", "u32"), ("data", "bytes"))),
    ("TileDone", (("id", "u32"), ("counters", "counters"))),
    ("Fault", (("code", 16), ("detail", "u32"))),
    ("Computed", (("data", "bytes"),)),
    ("MemoryTested", (
        ("lines", "u32"), ("pattern", 5), ("written", "u32"), ("checked", "u32"), ("count", "u32"),
        ("bits", "u32"), ("first", [WORD]),
    )),
)
COUNTERS = 26

WRITERS = {
    "u8": lambda value: bytes([value]),
    "u16": number, "u32": number, "u64": number,
    "x64": lambda value: number(int(value, 16)),
    "f32": floats,
    "flag": lambda value: bytes([value]),
    "pair": lambda value: floats(*value),
    "vector": lambda value: floats(*value),
    "bytes": lambda value: number(len(value) // 2) + bytes.fromhex(value),
    "text": lambda value: number(len(value.encode())) + value.encode(),
    "counters": lambda values: b"".join(number(int(value, 16)) for value in values),
}
READERS = {
    "u8": lambda reader: reader.raw(1)[0],
    "u16": lambda reader: reader.number(16),
    "u32": Reader.number,
    "u64": lambda reader: reader.number(64),
    "x64": lambda reader: f"{reader.number(64):016x}",
    "f32": lambda reader: reader.floats(1)[0],
    "flag": Reader.flag,
    "pair": lambda reader: reader.floats(2),
    "vector": lambda reader: reader.floats(3),
    "bytes": lambda reader: reader.bytes().hex(),
    "text": lambda reader: reader.bytes().decode(),
    "counters": lambda reader: [f"{reader.number(64):x}" for _ in range(COUNTERS)],
}


def written(kind, value):
    if isinstance(kind, tuple):
        return b"".join(written(of, value[name]) for name, of in kind)
    if isinstance(kind, dict):
        return number(value["kind"]) + written(kind[value["kind"]], value)
    if isinstance(kind, list):
        return option(None if value is None else written(kind[0], value))
    return number(value) if isinstance(kind, int) else WRITERS[kind](value)


def read(kind, reader):
    if isinstance(kind, tuple):
        return {name: read(of, reader) for name, of in kind}
    if isinstance(kind, dict):
        chosen = reader.below(len(kind))
        return {"kind": chosen, **read(kind[chosen], reader)}
    if isinstance(kind, list):
        return reader.option(lambda: read(kind[0], reader))
    return reader.below(kind) if isinstance(kind, int) else READERS[kind](reader)


def decoded(messages, data):
    """Name and fields of a message; None if the data is none."""
    reader = Reader(data)
    try:
        name, kind = messages[reader.below(len(messages))]
        fields = read(kind, reader)
        reader.end()
    except ValueError:
        return None
    return name, fields


def integer(bits, data):
    reader = Reader(data)
    try:
        value = reader.number(bits)
        reader.end()
    except ValueError:
        return None
    return value


differences = []


def check(what, found, expected):
    if found != expected:
        differences.append(what)
        print(f"{what}:\n  {found}\n  is not\n  {expected}", file=sys.stderr)


def check_link(vectors):
    unhex = bytes.fromhex
    for vector in vectors["crc32c"]:
        check("crc32c", f"{crc32c(unhex(vector['bytes'])):08x}", vector["sum"])
    for vector in vectors["crc64"]:
        check("crc64", f"{crc64(unhex(vector['bytes'])):016x}", vector["sum"])
    for vector in vectors["cobs"]:
        check("cobs", stuffed(unhex(vector["plain"])).hex(), vector["stuffed"])
    for vector in vectors["cobs"] + vectors["cobs_decoded"]:
        check("decoded cobs", unstuffed(unhex(vector["stuffed"])).hex(), vector["plain"])
    for vector in vectors["cobs_refused"]:
        check("refused cobs", unstuffed(unhex(vector)), None)
    for vector in vectors["frames"]:
        fields = [vector["kind"], int(vector["session"], 16)]
        fields += [vector[name] for name in ("sequence", "acknowledged", "held")] + [unhex(vector["payload"])]
        plain = plain_frame(*fields)
        check(f"frame: {vector['name']}", plain.hex(), vector["plain"])
        check(f"frame in the link: {vector['name']}", stuffed(plain).hex() + "00", vector["link"])
        check(f"decoded frame: {vector['name']}", parsed_frame(unhex(vector["link"])[:-1]), tuple(fields))
    for vector in vectors["dropped_frames"]:
        check(f"no frame: {vector['why']}", parsed_frame(unhex(vector["link"])[:-1]), None)
    for vector in vectors["link"]:
        data = unhex(vector["link"])
        fields = parsed_frame(data[:-1])
        check(f"link: {vector['what']}", stuffed(plain_frame(*fields)).hex() + "00", vector["link"])
        if fields[0] < 2:
            messages = COMMANDS if vector["from"] == "host" else REPLIES
            check(f"its message: {vector['what']}", decoded(messages, fields[-1]) is None, False)


def check_messages(vectors):
    unhex = bytes.fromhex
    for vector in vectors["integers"]:
        check("integer", number(int(vector["value"], 16)).hex(), vector["bytes"])
    for vector in vectors["integers"] + vectors["integers_decoded"]:
        check("decoded integer", integer(vector["bits"], unhex(vector["bytes"])), int(vector["value"], 16))
    for vector in vectors["integers_refused"]:
        check("refused integer", integer(vector["bits"], unhex(vector["bytes"])), None)
    of_end = {"card": COMMANDS, "host": REPLIES}
    for vector in vectors["messages"]:
        messages, name = of_end[vector["to"]], vector["name"]
        (kind, fields), = [(at, of) for at, (called, of) in enumerate(messages) if called == name]
        check(f"message: {name}", (number(kind) + written(fields, vector["fields"])).hex(), vector["bytes"])
        check(f"decoded message: {name}", decoded(messages, unhex(vector["bytes"])), (name, vector["fields"]))
    for vector in vectors["no_messages"]:
        check(f"no message: {vector['why']}", decoded(of_end[vector["to"]], unhex(vector["bytes"])), None)
    for vector in vectors["compute"]:
        a, b, c = (struct.unpack(">f", unhex(operand))[0] for operand in vector["operands"])
        check("comparison", int(vector["words"][20], 16), (a < b) + 2 * (a == b) + 4 * (a > b))


def check_conversations(vectors):
    unhex = bytes.fromhex
    for vector in vectors["images"]:
        image = unhex(vector["bytes"])
        check(f"image: {vector['what']}", (len(image) % LINE, f"{crc64(image):016x}"), (0, vector["checksum"]))
    for step in vectors["card"] + vectors["resident_card"]:
        for answer in step["answers"]:
            # The answer to Hello is its number of written lines.
            is_hello = isinstance(answer, int)
            check(f"card: {step['what']}", is_hello or decoded(REPLIES, unhex(answer)) is not None, True)


def main():
    with open(pathlib.Path(__file__).with_name("vectors.json"), encoding="utf-8") as file:
        vectors = json.load(file)
    check("versions", (PROTOCOL, LAYOUT), (vectors["protocol"], vectors["layout"]))
    check_link(vectors)
    check_messages(vectors)
    check_conversations(vectors)
    sys.exit(1 if differences else 0)


if __name__ == "__main__":
    main()
