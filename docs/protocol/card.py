#!/usr/bin/env python3
"""A card in Python, by docs/protocol.md alone: it takes any card image, and renders a test pattern.

    python3 docs/protocol/card.py 7000 &
    photoncard render scenes/cornell.gltf -o pattern.exr --card tcp:127.0.0.1:7000

A pixel's light grows to the right in red and downwards in green. Serves one host after another over TCP.
"""
import socket
import struct
import sys

from link import LAYOUT, LINE, PROTOCOL, RECORD, Frames, crc64, number

MEMORY = 64 << 20
# SRAM, DRAM, caches of photons and scene, stack; pixels of a tile, neighbours, gather rays, waiting gathers,
# irradiance records, shadow rays, samples, tiles, tiles in flight, waiting blocks.
BUDGET = (1 << 20, MEMORY, 0, 0, 0, 256, 256, 1 << 14, 1, 512, 64, 4096, 2, 1, 0)
CHUNK, PIXELS_OF_MESSAGE, COUNTERS = 64 * LINE, 16, 26
MESSAGE, ORDER, TOO_LARGE, LINES, CHUNKS, IMAGE = range(6)


class Fault(Exception):
    def __init__(self, code, detail=0):
        super().__init__(code, detail)
        self.reply = b"\6" + number(code) + number(detail)


class Card(Frames):
    """The card's end of a link. Written lines outlast sessions."""

    def __init__(self, connection, memory):
        super().__init__(connection, None)
        self.memory, self.samples = memory, 0
        self.forget()

    def opened(self, session):
        self.session, self.next, self.acknowledged, self.expected = session, 0, 0, 0
        self.messages.clear()
        self.forget()
        return True

    def forget(self):
        self.image = self.size = self.frame_size = None

    def serve(self):
        while True:
            command = self.message()
            try:
                self.execute(command.number(), command)
            except Fault as fault:
                self.send(fault.reply)
            except ValueError:
                self.send(Fault(MESSAGE, len(command.data)).reply)

    def execute(self, kind, command):
        commands = (
            self.hello, self.checksums, self.begin_image, self.write_lines, self.end_image, self.begin_frame,
            self.render_tile, self.no_self_test, self.no_self_test, lambda _: None,
        )
        if kind >= len(commands):
            raise Fault(MESSAGE, len(command.data))
        commands[kind](command)

    def hello(self, _):
        self.forget()
        budget = b"".join(map(number, BUDGET))
        build = b"a card in Python"
        written = number(len(self.memory) // LINE)
        self.send(b"\0" + number(PROTOCOL) + number(LAYOUT) + budget + written + b"\0" + number(len(build)) + build + b"\0")

    def checksums(self, command):
        first, count = command.number(), command.number()
        chunks = [self.memory[at : at + CHUNK] for at in range(first * CHUNK, len(self.memory), CHUNK)][:count]
        if not 0 < count == len(chunks):
            raise Fault(CHUNKS, first)
        sums = b"".join(struct.pack("<Q", crc64(chunk)) for chunk in chunks)
        self.send(b"\1" + number(first) + number(len(sums)) + sums)

    def begin_image(self, command):
        self.size, self.image = command.number() * LINE, command.number(64)
        self.frame_size = None
        if not 0 < self.size <= MEMORY:
            self.size = None
            raise Fault(TOO_LARGE, MEMORY // LINE)

    def write_lines(self, command):
        first, data = command.number(), command.bytes()
        end = first * LINE + len(data)
        if self.size is None:
            raise Fault(ORDER)
        if len(data) % LINE or end > self.size:
            raise Fault(LINES, first)
        self.memory.extend(bytes(max(0, end - len(self.memory))))
        self.memory[first * LINE : end] = data

    def end_image(self, _):
        if self.size is None:
            raise Fault(ORDER)
        found = crc64(self.memory[: self.size])
        if found != self.image:
            raise Fault(IMAGE, found & 0xFFFFFFFF)
        self.send(b"\2")

    def begin_frame(self, command):
        if self.size is None:
            raise Fault(ORDER)
        self.frame_size = command.number(), command.number()
        command.at += 14 * 4  # the camera's vectors and shift
        projection = command.below(4)
        command.at += (0, 7, 0, 2)[projection] * 4
        _seed, _first, self.samples = command.number(), command.number(), command.number()
        self.send(b"\3")

    def render_tile(self, command):
        tile, x, y, width, height = (command.number() for _ in range(5))
        if self.frame_size is None:
            raise Fault(ORDER)
        pixels = [(x + column, y + row) for row in range(height) for column in range(width)]
        for first in range(0, len(pixels), PIXELS_OF_MESSAGE):
            data = b"".join(map(self.pixel, pixels[first : first + PIXELS_OF_MESSAGE]))
            self.send(b"\4" + number(tile) + number(first) + number(len(data)) + data)
        self.send(b"\5" + number(tile) + bytes(COUNTERS))

    def pixel(self, place):
        """Sums of a pixel that sees no surface: its light alone, in units of 2^-40 radiance units."""
        red, green = ((place[axis] << 40) // self.frame_size[axis] * self.samples for axis in (0, 1))
        return bytes(RECORD - 24) + struct.pack("<3q", red, green, 0)

    def no_self_test(self, _):
        raise Fault(ORDER)


def main(port):
    memory = bytearray()
    with socket.create_server(("127.0.0.1", int(port))) as server:
        print(f"tcp:127.0.0.1:{server.getsockname()[1]}", flush=True)
        while True:
            connection, _ = server.accept()
            connection.setsockopt(socket.IPPROTO_TCP, socket.TCP_NODELAY, 1)
            try:
                Card(connection, memory).serve()
            except ConnectionError as error:
                print(f"the host has left: {error}", file=sys.stderr)


if __name__ == "__main__":
    if len(sys.argv) != 2:
        sys.exit(__doc__)
    main(sys.argv[1])
