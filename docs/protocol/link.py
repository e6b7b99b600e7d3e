"""Frames and fields of the link: what docs/protocol.md describes up to its section "Transport"."""
import struct

TABLE = []
for byte in range(256):
    for _ in range(8):
        byte = byte >> 1 ^ (0x82F63B78 if byte & 1 else 0)
    TABLE.append(byte)
DATA, OPEN, ACKNOWLEDGE, PROBE, ANSWER = range(5)
HEADER = struct.Struct("<BIHHB")
LINE, RECORD = 128, 60
PROTOCOL, LAYOUT = 17, 16


def crc32c(data):
    value = 0xFFFFFFFF
    for byte in data:
        value = value >> 8 ^ TABLE[(value ^ byte) & 0xFF]
    return value ^ 0xFFFFFFFF


def stuffed(data):
    """COBS: runs without a zero, each after its length plus one; then a zero."""
    out = bytearray()
    for run in data.split(b"\0"):
        while len(run) >= 254:
            out += b"\xff" + run[:254]
            run = run[254:]
        out += bytes([len(run) + 1]) + run
    return bytes(out) + b"\0"


def unstuffed(data):
    out, at = bytearray(), 0
    while at < len(data):
        length = data[at]
        out += data[at + 1 : at + length]
        at += length
        if length < 255 and at < len(data):
            out.append(0)
    return bytes(out)


def number(value):
    out = bytearray()
    while value > 0x7F:
        out.append(value & 0x7F | 0x80)
        value >>= 7
    return bytes(out) + bytes([value])


def floats(*values):
    return struct.pack(f"<{len(values)}f", *values)


def option(value):
    return b"\0" if value is None else b"\1" + value


class Reader:
    """Fields of a message."""

    def __init__(self, data):
        self.data, self.at = data, 0

    def number(self):
        value = shift = 0
        while True:
            byte = self.data[self.at]
            self.at += 1
            value |= (byte & 0x7F) << shift
            shift += 7
            if byte < 0x80:
                return value

    def bytes(self):
        length = self.number()
        self.at += length
        return self.data[self.at - length : self.at]


def crc64(data):
    table = []
    for byte in range(256):
        for _ in range(8):
            byte = byte >> 1 ^ (0xC96C5795D7870F42 if byte & 1 else 0)
        table.append(byte)
    value = (1 << 64) - 1
    for byte in data:
        value = value >> 8 ^ table[(value ^ byte) & 0xFF]
    return value ^ (1 << 64) - 1


class Frames:
    """Frames of a session over a socket that loses nothing: no message is repeated, and no probe is sent."""

    def __init__(self, socket, session):
        self.socket, self.session = socket, session
        self.next = self.acknowledged = self.expected = 0
        self.received, self.messages = b"", []

    def frame(self, kind, sequence=0, payload=b""):
        body = HEADER.pack(kind, self.session, sequence, self.expected & 0xFFFF, 0) + payload
        self.socket.sendall(stuffed(body + struct.pack("<I", crc32c(body))))

    def send(self, payload, kind=DATA):
        """Sends a message, when fewer than four are not acknowledged."""
        while self.next - self.acknowledged >= 4:
            self.hear()
        self.frame(kind, self.next & 0xFFFF, payload)
        self.next += 1

    def opened(self, session):
        """Called for a frame that opens another session. A host ignores it."""
        return False

    def hear(self):
        """Takes at least one frame."""
        while b"\0" not in self.received:
            data = self.socket.recv(1 << 16)
            if not data:
                raise ConnectionError("the other end has closed the link")
            self.received += data
        *frames, self.received = self.received.split(b"\0")
        for plain in map(unstuffed, filter(None, frames)):
            self.take_frame(plain[:-4], plain[-4:])

    def take_frame(self, body, checksum):
        if len(body) < HEADER.size or struct.pack("<I", crc32c(body)) != checksum:
            return
        kind, session, sequence, acknowledged, _ = HEADER.unpack(body[: HEADER.size])
        if session != self.session and not (kind == OPEN and self.opened(session)):
            return
        self.acknowledged += acknowledged - self.acknowledged & 0xFFFF
        if kind == PROBE:
            self.frame(ANSWER, self.next & 0xFFFF, body[HEADER.size :])
        if kind in (DATA, OPEN) and sequence == self.expected & 0xFFFF:
            self.expected += 1
            self.messages.append(body[HEADER.size :])
            self.frame(ACKNOWLEDGE)

    def message(self):
        while not self.messages:
            self.hear()
        return Reader(self.messages.pop(0))
