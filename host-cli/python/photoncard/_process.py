"""Runs the command: reports progress, stops it cleanly, and turns its failures into errors."""

from __future__ import annotations

import json
import os
import signal
import subprocess
import tempfile
from collections.abc import Sequence
from dataclasses import dataclass, field
from typing import Any, Callable, NamedTuple, Optional, Union

from ._command import command, options_of, plain_environment
from ._errors import Error, of_text

#: Seconds that a terminal's or a notebook's own interrupt has to reach the command. A second one would end
#: it at once.
_OWN_INTERRUPT = 1.0
#: Seconds that the command has to end after an interrupt.
_END = 10.0


class Progress(NamedTuple):
    """How far a phase of the work is."""

    phase: str
    done: int
    total: int
    #: Seconds since the start of the phase.
    seconds: float
    #: Estimated seconds until the end of the phase; None if there is no estimate.
    seconds_left: Optional[float]


#: None shows progress where a terminal or a notebook is there, True too, False never; a function gets it.
ProgressOption = Union[None, bool, Callable[[Progress], None]]


@dataclass(frozen=True)
class Note:
    """Contents of a scene that the render leaves out (``ignored``) or reads otherwise (``note``)."""

    kind: str
    message: str
    items: list[str] = field(default_factory=list)

    def __str__(self) -> str:
        return self.message


@dataclass
class Outcome:
    """What the command has said."""

    stdout: str
    notes: list[Note] = field(default_factory=list)
    #: Other lines, such as a summary.
    messages: list[str] = field(default_factory=list)


def run(
    names: Sequence[str],
    words: Sequence[str],
    progress: Optional[Callable[[Progress], None]] = None,
    stdin: Optional[str] = None,
) -> Outcome:
    """Runs a command to its end.

    An interrupt stops the command and is raised again.

    Raises:
        Error: if the command fails.
    """
    program = command()
    options = options_of(program, *names)
    arguments = [str(program), *names, *_quietness(options), *words]
    with tempfile.TemporaryFile("w+b") as given, tempfile.TemporaryFile("w+b") as printed:
        given.write((stdin or "").encode())
        given.seek(0)
        child = subprocess.Popen(
            arguments, stdin=given, stdout=printed, stderr=subprocess.PIPE, env=plain_environment()
        )
        listener = _Listener(progress)
        try:
            assert child.stderr is not None
            for line in child.stderr:
                listener.hear(line.decode(errors="replace").rstrip("\n"))
            status = child.wait()
        except BaseException as reason:
            _stop(child, isinstance(reason, KeyboardInterrupt))
            raise
        finally:
            child.stderr.close()
        printed.seek(0)
        listener.outcome.stdout = printed.read().decode(errors="replace")
    if status != 0:
        raise listener.failure(status)
    return listener.outcome


def _quietness(options: Any) -> list[str]:
    if "progress" in options and "json" in options["progress"].help:
        return ["--progress=json"]
    return ["--quiet"] if "quiet" in options else []


def _stop(child: subprocess.Popen[bytes], is_interrupt: bool) -> None:
    try:
        if is_interrupt and _ends(child, _OWN_INTERRUPT):
            return
        if os.name == "nt":
            child.terminate()
        else:
            child.send_signal(signal.SIGINT)
        if _ends(child, _END):
            return
    finally:
        if child.poll() is None:
            child.kill()
            child.wait()


def _ends(child: subprocess.Popen[bytes], seconds: float) -> bool:
    try:
        child.communicate(timeout=seconds)
    except subprocess.TimeoutExpired:
        return False
    return True


class _Listener:
    """Reads the lines of standard error."""

    def __init__(self, progress: Optional[Callable[[Progress], None]]) -> None:
        self.outcome = Outcome("")
        self._progress = progress
        self._failure: Optional[dict[str, Any]] = None

    def hear(self, line: str) -> None:
        said = _object(line)
        kind = said.get("kind")
        if kind == "progress" and self._progress is not None:
            self._progress(Progress(*(said.get(key) for key in Progress._fields)))  # type: ignore[arg-type]
        elif kind in ("ignored", "note"):
            self.outcome.notes.append(Note(kind, said.get("message", ""), list(said.get("items", []))))
        elif kind == "message":
            self.outcome.messages.append(said.get("message", ""))
        elif kind == "failure":
            self._failure = said
        elif not said:
            self.outcome.messages.append(line)

    def failure(self, status: int) -> Error:
        if self._failure is not None:
            return Error(self._failure.get("message", ""), self._failure.get("remedy"), status)
        if status < 0:
            name = signal.Signals(-status).name
            return Error(
                f"the command was ended by {name}", "if memory was short, take a smaller picture", status
            )
        return of_text("\n".join(self.outcome.messages), status)


def _object(line: str) -> dict[str, Any]:
    if not line.startswith("{"):
        return {}
    try:
        said = json.loads(line)
    except ValueError:
        return {}
    return said if isinstance(said, dict) else {}
