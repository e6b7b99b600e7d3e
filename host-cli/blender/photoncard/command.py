"""The command `photoncard`: where it is, its arguments, and its run. Knows nothing of Blender."""

from __future__ import annotations

import os
import queue
import shutil
import stat
import subprocess
import sys
import threading
import time
from collections.abc import Iterator
from dataclasses import dataclass, field
from typing import IO

from . import events
from .packets import PacketError, PacketReader, Tile

NAME = "photoncard.exe" if sys.platform == "win32" else "photoncard"
_PATIENCE = 5.0
"""Seconds from the request to stop until the process is ended."""
_REMEDY = (
    "Install the extension's zip for this platform, or state the program in the extension's preferences."
)


class CommandError(Exception):
    """A program that cannot be found or started, or a run that failed; with what helps."""


def find(stated: str, folder: str) -> str:
    """Path of the program: the stated one, else that of the extension's `folder`, else one of PATH.

    Raises `CommandError`.
    """
    if stated:
        if not os.path.isfile(stated):
            raise CommandError(
                f"There is no program {stated}: correct the path in the extension's preferences."
            )
        return stated
    bundled = os.path.join(folder, "bin", NAME)
    if os.path.isfile(bundled):
        _make_executable(bundled)
        return bundled
    found = shutil.which("photoncard")
    if found is None:
        raise CommandError(f"The program photoncard is not there. {_REMEDY}")
    return found


def _make_executable(path: str) -> None:
    """Blender's installation of a zip drops permissions."""
    if os.access(path, os.X_OK):
        return
    try:
        os.chmod(path, os.stat(path).st_mode | stat.S_IXUSR | stat.S_IXGRP | stat.S_IXOTH)
    except OSError as error:
        raise CommandError(f"{path} is not executable and cannot be made so ({error}). {_REMEDY}") from error


@dataclass
class Settings:
    """What a picture is rendered with."""

    size: tuple[int, int]
    crop: tuple[int, int, int, int] | None = None
    quality: str = "good"
    seconds: float | None = None
    noise: float | None = None
    is_denoised: bool = False
    is_transparent: bool = False
    caustic_photons: int | None = None
    cards: list[str] = field(default_factory=list)
    layers: list[str] = field(default_factory=list)

    def arguments(self) -> list[str]:
        """The options of `photoncard render`."""
        width, height = self.size
        options = ["--size", f"{width}x{height}", "--quality", self.quality, "--sample-type", "float"]
        if self.crop is not None:
            options += ["--crop", ",".join(map(str, self.crop))]
        if self.seconds is not None:
            options += ["--time", f"{self.seconds:g}s"]
        if self.noise is not None:
            options += ["--noise", f"{self.noise:g}"]
        if self.is_denoised:
            options.append("--denoise")
        if self.is_transparent:
            options.append("--transparent")
        if self.caustic_photons is not None:
            options += ["--caustic-photons", str(self.caustic_photons)]
        for card in self.cards:
            options += ["--card", card]
        return [*options, "--aov", ",".join(self.layers) or "none"]


def render_command(program: str, scene: list[str], settings: Settings, output: str) -> list[str]:
    """The command that renders a scene to an EXR file, and reports as this module reads it."""
    reports = ["--progress", "json", "--display-server", "-"]
    return [program, "render", *scene, *settings.arguments(), *reports, "-o", output]


def end_process(process: subprocess.Popen[bytes]) -> None:
    """Asks a process to stop, ends it if it does not, and waits for it."""
    if process.poll() is None:
        process.terminate()
        try:
            process.wait(_PATIENCE)
        except subprocess.TimeoutExpired:
            process.kill()
            process.wait()


class Run:
    """A run of the command, whose tiles and events are read while it works."""

    def __init__(self, command: list[str], folder: str) -> None:
        """Starts the command in `folder`. Raises `CommandError`."""
        self._received: queue.Queue[Tile | events.Event] = queue.Queue()
        self._last_lines: list[str] = []
        self._failure: events.Failure | None = None
        try:
            self._process = subprocess.Popen(
                command,
                cwd=folder,
                stdin=subprocess.DEVNULL,
                stdout=subprocess.PIPE,
                stderr=subprocess.PIPE,
                creationflags=getattr(subprocess, "CREATE_NO_WINDOW", 0),
            )
        except OSError as error:
            raise CommandError(f"{command[0]} cannot be started ({error}). {_REMEDY}") from error
        self._readers = [
            threading.Thread(target=self._read_tiles, args=(self._process.stdout,), daemon=True),
            threading.Thread(target=self._read_events, args=(self._process.stderr,), daemon=True),
        ]
        for reader in self._readers:
            reader.start()

    def received(self, seconds: float) -> Iterator[Tile | events.Event]:
        """What has arrived, after waiting for the first for up to `seconds`."""
        try:
            yield self._received.get(timeout=seconds)
            while True:
                yield self._received.get_nowait()
        except queue.Empty:
            return

    @property
    def is_over(self) -> bool:
        """True if the process has ended and everything has been received."""
        return (
            self._process.poll() is not None
            and not any(reader.is_alive() for reader in self._readers)
            and self._received.empty()
        )

    def check(self) -> None:
        """Raises `CommandError` if the run, which is over, has failed."""
        status = self._process.returncode
        if status == 0:
            return
        if self._failure is not None:
            raise CommandError(str(self._failure))
        said = "\n".join(self._last_lines[-5:]) or "It said nothing."
        raise CommandError(f"photoncard ended with the status {status}.\n{said}")

    def stop(self) -> None:
        """Asks the process to stop, ends it if it does not, and waits for it."""
        end_process(self._process)
        end = time.monotonic() + _PATIENCE
        for reader in self._readers:
            reader.join(max(end - time.monotonic(), 0))

    def _read_tiles(self, stream: IO[bytes]) -> None:
        reader = PacketReader()
        with stream:
            try:
                while data := stream.read1(1 << 20):
                    for tile in reader.feed(data):
                        self._received.put(tile)
            except PacketError as error:
                self._received.put(events.Remark("message", f"tiles are not shown: {error}"))
                # The process must not wait for a reader.
                while stream.read1(1 << 20):
                    pass

    def _read_events(self, stream: IO[bytes]) -> None:
        with stream:
            for line in stream:
                event = events.parse(line.decode("utf-8", "replace"))
                if event is None:
                    continue
                if isinstance(event, events.Failure):
                    self._failure = event
                elif isinstance(event, events.Remark):
                    self._last_lines.append(event.message)
                self._received.put(event)
