"""A session of `photoncard view`, of which pictures are shown while they are rendered.

Knows nothing of Blender.
"""

from __future__ import annotations

import json
import struct
import subprocess
import threading
from collections.abc import Callable
from dataclasses import dataclass
from typing import Any
from urllib.parse import urlsplit

import numpy as np

from . import events
from .command import end_process
from .websocket import WebSocket, WebSocketError

_TILE = struct.Struct("<11I")
MAX_SIDE, MAX_PIXELS = 4096, 1 << 22
"""Greatest side and greatest number of pixels of a view's picture."""


@dataclass(frozen=True)
class Camera:
    """Camera in the coordinates of glTF, metres. One of `fov`, degrees, and `height`, metres, is stated."""

    position: tuple[float, float, float]
    look_at: tuple[float, float, float]
    up: tuple[float, float, float]
    shift: tuple[float, float]
    lens: tuple[float, float] = (0.0, 0.0)
    """Diameter of the lens and distance in focus, metres; that of a pinhole is zeros."""
    fov: float | None = None
    height: float | None = None

    def message(self) -> dict[str, Any]:
        """The message that moves a view's camera there."""
        stated = {name: value for name, value in vars(self).items() if value is not None}
        return {"type": "camera", "moving": True, **stated}


class Session:
    """A process of `photoncard view` and the connection to it.

    Threads of its own start it and receive pictures; `changed` is called from them. All methods but `stop`
    return at once. The process ends with this one.
    """

    def __init__(self, command: list[str], folder: str, changed: Callable[[], None]) -> None:
        """Starts the command, a `photoncard view`, in `folder`. Raises `OSError`."""
        self._changed = changed
        self._lock = threading.Lock()
        self._sending = threading.Lock()
        self._socket: WebSocket | None = None
        self._wishes: dict[str, dict[str, Any]] = {}
        self._sent = 0
        self._received = 0
        self._is_stopping = False
        self._picture: np.ndarray | None = None
        self._versions: np.ndarray | None = None
        self.state: dict[str, Any] = {}
        """The newest state of the view, as its protocol has it."""
        self.error = ""
        """Why there is no picture, or why a change was refused."""
        self.is_lost = False
        """True once nothing more arrives."""
        self._process = subprocess.Popen(
            [*command, "--listen", "127.0.0.1:0", "--attached", "--progress", "json"],
            cwd=folder,
            stdin=subprocess.PIPE,
            stdout=subprocess.PIPE,
            stderr=subprocess.PIPE,
            creationflags=getattr(subprocess, "CREATE_NO_WINDOW", 0),
        )
        for work in (self._listen, self._read_events):
            threading.Thread(target=work, daemon=True).start()

    def look(self, camera: Camera) -> int:
        """Moves the camera. Returns the number of the message."""
        return self._wish("camera", camera.message())

    def resize(self, width: int, height: int) -> int:
        """Changes the size of the picture, within `MAX_SIDE` and `MAX_PIXELS`. Returns the message's number."""
        return self._wish("size", {"type": "size", "size": [width, height]})

    def reload(self) -> int:
        """Has the scene's files read again. Returns the number of the message."""
        return self._wish("reload", {"type": "reload"})

    def picture(self) -> np.ndarray | None:
        """The picture so far: RGBA, linear, rows from the bottom; None before the first tile."""
        with self._lock:
            return None if self._picture is None else self._picture.copy()

    def newest(self) -> tuple[int, float]:
        """Number of the newest message that the view has taken, and the shown share of its picture."""
        with self._lock:
            version = self.state.get("version")
            shown = 0.0 if self._versions is None else float(np.mean(self._versions == version))
            return self.state.get("id", 0), shown

    @property
    def is_over(self) -> bool:
        """True once the process has ended, or the connection to it."""
        return self.is_lost or self._process.poll() is not None

    def stop(self) -> None:
        """Ends the process, and waits for it."""
        with self._sending:
            self._is_stopping = True
            connection = self._socket
        if connection:
            connection.close()
        if self._process.stdin:
            self._process.stdin.close()
        end_process(self._process)

    def _wish(self, kind: str, message: dict[str, Any]) -> int:
        """Sends a message, or keeps it as the last of its kind until there is a connection."""
        with self._sending:
            self._sent += 1
            message = {**message, "id": self._sent}
            if self._socket is None:
                self._wishes[kind] = message
            else:
                self._send(self._socket, message)
        return message["id"]

    def _send(self, connection: WebSocket, message: dict[str, Any]) -> None:
        try:
            connection.send(json.dumps(message))
        except WebSocketError:
            # The thread that receives tells the end.
            pass

    def _listen(self) -> None:
        assert self._process.stdout is not None
        with self._process.stdout as stream:
            address = urlsplit(stream.readline().decode().strip())
            if not address.port:
                return
            try:
                path = f"/socket?{address.query}"
                connection = WebSocket(address.hostname or "", address.port, path)
                self._begin(connection)
                while (message := connection.receive()) is not None:
                    self._take(connection, message)
                if not self._is_stopping:
                    self._fail("The view has closed the connection.")
            except (WebSocketError, ValueError) as error:
                self._fail(f"The view is lost: {error}.")

    def _begin(self, connection: WebSocket) -> None:
        with self._sending:
            if self._is_stopping:
                connection.close()
                return
            for message in sorted(self._wishes.values(), key=lambda message: message["id"]):
                self._send(connection, message)
            self._wishes.clear()
            self._socket = connection

    def _take(self, connection: WebSocket, message: str | bytes) -> None:
        if isinstance(message, bytes):
            self._received += len(message)
            self._paint(message)
            self._send(connection, {"type": "shown", "bytes": self._received})
        else:
            said = json.loads(message)
            if said.get("type") == "state":
                self._resized(said)
            elif said.get("type") == "error":
                self.error = said.get("text", "")
        self._changed()

    def _resized(self, state: dict[str, Any]) -> None:
        """Takes a state; a picture of another size begins black."""
        width, height = state["size"]
        with self._lock:
            self.state = state
            self.error = state.get("refused") or state.get("unread") or ""
            if self._picture is None or self._picture.shape[:2] != (height, width):
                self._picture = np.zeros((height, width, 4), np.float32)
                self._versions = np.zeros((height, width), np.uint32)

    def _paint(self, tile: bytes) -> None:
        version, step, x, y, columns, rows, *_ = _TILE.unpack_from(tile)
        pixels = np.frombuffer(tile, "<f4", offset=_TILE.size)
        if step == 0 or pixels.size != 3 * columns * rows:
            raise WebSocketError("a tile is damaged")
        with self._lock:
            if self._picture is None or self._versions is None or version != self.state.get("version"):
                return
            height, width = self._versions.shape
            wide = pixels.reshape(rows, columns, 3).repeat(step, 0).repeat(step, 1)[: height - y, : width - x]
            place = np.s_[height - y - wide.shape[0] : height - y, x : x + wide.shape[1]]
            self._picture[place] = np.dstack([wide[::-1], np.ones(wide.shape[:2], np.float32)])
            self._versions[place] = version

    def _read_events(self) -> None:
        assert self._process.stderr is not None
        with self._process.stderr as stream:
            for line in stream:
                event = events.parse(line.decode("utf-8", "replace"))
                if isinstance(event, events.Failure) and not self._is_stopping:
                    self._fail(str(event))

    def _fail(self, text: str) -> None:
        self.error, self.is_lost = text, True
        self._changed()
