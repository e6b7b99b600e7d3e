"""A client of WebSockets (RFC 6455) over TCP, for messages of text and of bytes. Knows nothing of Blender."""

from __future__ import annotations

import base64
import hashlib
import os
import socket
import struct
import threading

_GUID = "258EAFA5-E914-47DA-95CA-C5AB0DC85B11"
_TEXT, _BYTES, _CLOSE, _PING, _PONG = 1, 2, 8, 9, 10
_CONTROL = 8
_MAX_HEAD = 1 << 16
_MAX_MESSAGE = 1 << 28


class WebSocketError(Exception):
    """A connection that was refused, has ended, or does not follow the protocol."""


class WebSocket:
    """A connection. One thread may send while another receives."""

    def __init__(self, host: str, port: int, path: str, seconds: float = 10.0) -> None:
        """Connects within `seconds`. Raises `WebSocketError`."""
        self._sending = threading.Lock()
        self._rest = b""
        try:
            self._socket = socket.create_connection((host, port), seconds)
            self._socket.setsockopt(socket.IPPROTO_TCP, socket.TCP_NODELAY, 1)
            self._greet(f"{host}:{port}", path)
            self._socket.settimeout(None)
        except OSError as error:
            raise WebSocketError(f"{host}:{port} does not answer ({error})") from error

    def send(self, text: str) -> None:
        """Sends a text. Raises `WebSocketError` if the connection has ended."""
        self._send(_TEXT, text.encode())

    def receive(self) -> str | bytes | None:
        """Waits for a message; None once the connection has ended. Raises `WebSocketError`."""
        kind, message = 0, bytearray()
        while True:
            try:
                is_last, operation, payload = self._frame()
            except (OSError, EOFError):
                return None
            if operation == _CLOSE:
                return None
            if operation == _PING:
                self._send(_PONG, payload)
            if operation >= _CONTROL:
                continue
            kind = operation or kind
            message += payload
            if len(message) > _MAX_MESSAGE:
                raise WebSocketError("a message is too long")
            if is_last:
                return message.decode() if kind == _TEXT else bytes(message)

    def close(self) -> None:
        """Ends the connection; a thread that receives gets None."""
        try:
            self._socket.shutdown(socket.SHUT_RDWR)
        except OSError:
            pass
        self._socket.close()

    def _greet(self, host: str, path: str) -> None:
        key = base64.b64encode(os.urandom(16)).decode()
        lines = [
            f"GET {path} HTTP/1.1",
            f"Host: {host}",
            f"Origin: http://{host}",
            "Connection: Upgrade",
            "Upgrade: websocket",
            "Sec-WebSocket-Version: 13",
            f"Sec-WebSocket-Key: {key}",
        ]
        self._socket.sendall("\r\n".join([*lines, "", ""]).encode())
        head = b""
        while b"\r\n\r\n" not in head:
            data = self._socket.recv(4096)
            head += data
            if not data or len(head) > _MAX_HEAD:
                raise WebSocketError(f"{host} is no server of WebSockets")
        head, self._rest = head.split(b"\r\n\r\n", 1)
        status, *fields = head.decode("latin-1").split("\r\n")
        if status.split(" ")[1:2] != ["101"]:
            raise WebSocketError(f"{host} refuses the connection: {status}")
        accepted = base64.b64encode(hashlib.sha1((key + _GUID).encode()).digest()).decode()
        pairs = (field.partition(":") for field in fields)
        values = {name.strip().lower(): value.strip() for name, _, value in pairs}
        if values.get("sec-websocket-accept") != accepted:
            raise WebSocketError(f"{host} is no server of WebSockets")

    def _frame(self) -> tuple[bool, int, bytes]:
        first, second = self._bytes(2)
        if first & 0x70 or second & 0x80:
            raise WebSocketError("a frame is masked or extended")
        length = second & 0x7F
        if length == 126:
            (length,) = struct.unpack(">H", self._bytes(2))
        elif length == 127:
            (length,) = struct.unpack(">Q", self._bytes(8))
        if length > _MAX_MESSAGE:
            raise WebSocketError("a frame is too long")
        return bool(first & 0x80), first & 0x0F, self._bytes(length)

    def _bytes(self, count: int) -> bytes:
        parts = [self._rest[:count]]
        self._rest = self._rest[count:]
        left = count - len(parts[0])
        while left > 0:
            data = self._socket.recv(min(left, 1 << 20))
            if not data:
                raise EOFError
            parts.append(data)
            left -= len(data)
        return b"".join(parts)

    def _send(self, operation: int, payload: bytes) -> None:
        length = len(payload)
        if length < 126:
            head = struct.pack(">BB", 0x80 | operation, 0x80 | length)
        elif length < 1 << 16:
            head = struct.pack(">BBH", 0x80 | operation, 0x80 | 126, length)
        else:
            head = struct.pack(">BBQ", 0x80 | operation, 0x80 | 127, length)
        mask = os.urandom(4)
        masked = bytes(byte ^ mask[index % 4] for index, byte in enumerate(payload))
        try:
            with self._sending:
                self._socket.sendall(head + mask + masked)
        except OSError as error:
            raise WebSocketError(f"the connection has ended ({error})") from error
