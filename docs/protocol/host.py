#!/usr/bin/env python3
"""A host in Python: renders a prepared scene on a card over TCP, by docs/protocol.md alone.

    photoncard prepare scenes/cornell.gltf -o cornell.card --quality paper --photons 20000
    photoncard emulate --listen tcp:127.0.0.1:7000 &
    python3 docs/protocol/host.py 127.0.0.1:7000 cornell.card out.pixels --size 32

Writes the pixels' records of 60 bytes, row by row. TCP loses nothing, so that this host repeats no message and
sends no probes; over a UART it must.
"""
import argparse
import json
import math
import secrets
import socket
import struct

from link import LAYOUT, LINE, OPEN, PROTOCOL, RECORD, Frames, crc64, floats, number, option

LINES_OF_MESSAGE, TILE = 8, 16


class Card(Frames):
    """A session with a card."""

    def __init__(self, address):
        host, port = address.rsplit(":", 1)
        connection = socket.create_connection((host, int(port)), timeout=60)
        connection.setsockopt(socket.IPPROTO_TCP, socket.TCP_NODELAY, 1)
        super().__init__(connection, secrets.randbits(32))

    def take(self, *kinds):
        reply = self.message()
        kind = reply.number()
        if kind == 6:
            raise ValueError(f"the card answers with fault {reply.number()}, detail {reply.number()}")
        if kind not in kinds:
            raise ValueError(f"the card answers with message {kind}")
        return kind, reply

    def hello(self):
        self.send(b"\0" + number(PROTOCOL) + number(LAYOUT), OPEN)
        _, reply = self.take(0)
        versions = reply.number(), reply.number()
        if versions != (PROTOCOL, LAYOUT):
            raise ValueError(f"the card has protocol and layout {versions}")
        return [reply.number(64) for _ in range(15)]

    def load(self, image):
        self.send(b"\2" + number(len(image) // LINE) + number(crc64(image)))
        for first in range(0, len(image), LINE * LINES_OF_MESSAGE):
            data = image[first : first + LINE * LINES_OF_MESSAGE]
            self.send(b"\3" + number(first // LINE) + number(len(data)) + data)
        self.send(b"\4")
        self.take(2)

    def render(self, frame, side):
        self.send(b"\5" + frame)
        self.take(3)
        picture = bytearray(side * side * RECORD)
        for y in range(0, side, TILE):
            for x in range(0, side, TILE):
                width, height = min(TILE, side - x), min(TILE, side - y)
                self.send(b"\6" + b"".join(map(number, (0, x, y, width, height))))
                self.send(b"\x09")
                self.pixels(picture, side, x, y, width)
        return picture

    def pixels(self, picture, side, x, y, width):
        while True:
            kind, reply = self.take(4, 5)
            if kind == 5:
                return
            _, first, data = reply.number(), reply.number(), reply.bytes()
            for index in range(len(data) // RECORD):
                row, column = divmod(first + index, width)
                at = ((y + row) * side + x + column) * RECORD
                picture[at : at + RECORD] = data[index * RECORD : (index + 1) * RECORD]


def f32(value):
    return struct.unpack("<f", struct.pack("<f", value))[0]


def frame_of(head, side):
    """Parameters of a frame of the prepared scene: its first camera, a square picture, and the box filter."""
    camera, photons, integrator = head["cameras"][0], head["photons"], head["integrator"]
    half = f32(math.tan(f32(0.5 * f32(camera["projection"]["vertical_fov"]))))
    right, up = ([f32(f32(axis) * half) for axis in camera[name]] for name in ("right", "up"))
    samples, caustics = integrator["samples"], head["gathers"]["caustics"]
    error, threshold = integrator["irradiance_error"], integrator["adaptive_threshold"]
    near = integrator["near_distance"]
    parts = [
        number(side) * 2,
        floats(*camera["origin"], *camera["forward"], *right, *up, 0, 0) + number(0),  # a pinhole, unshifted
        number(integrator["seed"]) + number(0) + number(samples),
        number(integrator["planned_samples"] or samples),
        *(number(integrator[name]) for name in ("gather_rays", "shadow_rays")),
        number(photons["neighbors"]) + floats(head["gathers"]["max_distance"]),
        number(("Reflection", "Photon", "Product", "Mixture", "Focused").index(integrator["sampling"])),
        option(error and floats(error)),
        number(8) + number(2) + number(2**32 - 1),  # bins, drain along a Hilbert curve, queue
        number(("Density", "Precomputed").index(photons["radiance"])),
        option(caustics and number(caustics["neighbors"]) + floats(caustics["max_distance"])),
        b"\0" + number(0),  # no layers, box filter
        number(1) + b"\0",  # one tile in flight, no kept records
        option(threshold and floats(threshold)),
        b"\0" * 6,  # a background, no sums of position, coverage, identities and light groups; radiance
        floats(head["gathers"]["near_distance"] if near is None else near),
    ]
    return b"".join(parts)


def main():
    parser = argparse.ArgumentParser(description=__doc__.splitlines()[0])
    parser.add_argument("card")
    parser.add_argument("prepared")
    parser.add_argument("output")
    parser.add_argument("--size", type=int, default=32)
    arguments = parser.parse_args()
    with open(arguments.prepared, "rb") as file:
        file.readline()
        head = json.loads(file.readline())
        file.seek(-(-(file.tell() + 4) // 4096) * 4096)
        image = file.read()
    card = Card(arguments.card)
    print("budget:", *card.hello())
    card.load(image)
    picture = card.render(frame_of(head, arguments.size), arguments.size)
    with open(arguments.output, "wb") as file:
        file.write(picture)


if __name__ == "__main__":
    main()
