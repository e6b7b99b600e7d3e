"""Frames and fields of the link: what docs/protocol.md describes up to its section "Transport"."""
import struct

TABLE = []
for byte in range(256):
    for _ in range(8):
        byte = byte >> 1 ^ (0x82F63B78 if byte & 1 else 0)
    TABLE.append(byte)
DATA, OPEN, ACKNOWLEDGE, PROBE, ANSWER, UNKNOWN = range(6)
HEADER = struct.Struct("<BIHHB")
MAX_PAYLOAD, MAX_FRAME = 1056, 1076
LINE, RECORD = 128, 60
PROTOCOL, LAYOUT = 19, 16


def crc32c(data):
    value = 0xFFFFFFFF
    for byte in data:
        value = value >> 8 ^ TABLE[(value ^ byte) & 0xFF]
    return value ^ 0xFFFFFFFF


def stuffed(data):
    """COBS: runs without a zero, each after its length plus one. None follows a last run of 254 bytes."""
    out, runs = bytearray(), data.split(b"\0")
    for place, run in enumerate(runs):
        while len(run) >= 254:
            out += b"\xff" + run[:254]
            run = run[254:]
            if not run and place + 1 == len(runs):
                return bytes(out)
        out += bytes([len(run) + 1]) + run
    return bytes(out)


def unstuffed(data):
    """The plain bytes; None if a run ends behind the data."""
    out, at = bytearray(), 0
    while at < len(data):
        length = data[at]
        out += data[at + 1 : at + length]
        at += length
        if length < 255 and at < len(data):
            out.append(0)
    return bytes(out) if at == len(data) else None


def plain_frame(kind, session, sequence, acknowledged, held, payload=b""):
    """Bytes of a frame before COBS."""
    body = HEADER.pack(kind, session, sequence, acknowledged, held) + payload
    return body + struct.pack("<I", crc32c(body))


def parsed_frame(data):
    """Fields of the frame in the bytes before a zero; None if they are none."""
    plain = unstuffed(data) if len(data) < MAX_FRAME else None
    if plain is None or not HEADER.size + 4 <= len(plain) <= HEADER.size + MAX_PAYLOAD + 4:
        return None
    body = plain[:-4]
    if struct.pack("<I", crc32c(body)) != plain[-4:] or body[0] > UNKNOWN:
        return None
    return *HEADER.unpack(body[: HEADER.size]), body[HEADER.size :]


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

    def raw(self, length):
        self.at += length
        if self.at > len(self.data):
            raise ValueError("the message ends before its fields")
        return self.data[self.at - length : self.at]

    def number(self, bits=32):
        value = 0
        for shift in range(0, bits, 7):
            byte = self.raw(1)[0]
            value |= (byte & 0x7F) << shift
            if byte < 0x80 and value >> bits == 0:
                return value
            if byte < 0x80:
                break
        raise ValueError("an integer is too long")

    def below(self, limit):
        value = self.number()
        if value >= limit:
            raise ValueError("an unknown kind")
        return value

    def bytes(self):
        return self.raw(self.number())

    def floats(self, count):
        return list(struct.unpack(f"<{count}f", self.raw(4 * count)))

    def flag(self):
        byte = self.raw(1)[0]
        if byte > 1:
            raise ValueError("neither 0 nor 1")
        return byte

    def option(self, read):
        return read() if self.flag() else None

    def end(self):
        if self.at != len(self.data):
            raise ValueError("bytes follow the message")


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
        plain = plain_frame(kind, self.session, sequence, self.expected & 0xFFFF, 0, payload)
        self.socket.sendall(stuffed(plain) + b"\0")

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
        for frame in filter(None, map(parsed_frame, frames)):
            self.take_frame(*frame)

    def take_frame(self, kind, session, sequence, acknowledged, _held, payload):
        if session != self.session and not (kind == OPEN and self.opened(session)):
            return
        self.acknowledged += acknowledged - self.acknowledged & 0xFFFF
        if kind == PROBE:
            self.frame(ANSWER, self.next & 0xFFFF, payload)
        if kind in (DATA, OPEN) and sequence == self.expected & 0xFFFF:
            self.expected += 1
            self.messages.append(payload)
            self.frame(ACKNOWLEDGE)

    def message(self):
        while not self.messages:
            self.hear()
        return Reader(self.messages.pop(0))
