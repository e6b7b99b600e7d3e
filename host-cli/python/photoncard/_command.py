"""The command, and its options by its help."""

from __future__ import annotations

import functools
import importlib.metadata
import os
import re
import shutil
import subprocess
from collections.abc import Mapping, Sequence
from dataclasses import dataclass
from pathlib import Path
from typing import Any, Optional

from ._errors import Error, UnknownOption, known_names

_PROGRAM = "photoncard.exe" if os.name == "nt" else "photoncard"
_HEADING = re.compile(r"^(\S.*):$")
_OPTION = re.compile(r"^\s{2,6}(?:-\w, )?--([a-z0-9-]+)(?:[ =]<(.*)>)?(?:\.\.\.)?$")


def command() -> Path:
    """Path of the command: that of the environment's ``PHOTONCARD``, else that of this package, else that of
    ``PATH``.

    >>> command().name
    'photoncard'
    """
    stated = os.environ.get("PHOTONCARD")
    if stated:
        found = shutil.which(stated)
        if found is None:
            raise Error(f"PHOTONCARD is {stated!r}, which is no program", "state the path of the command")
        return Path(found)
    found = _packaged() or shutil.which(_PROGRAM)
    if found is None:
        raise Error("the command photoncard is missing", "install the wheel, or state its path as PHOTONCARD")
    return Path(found)


def plain_environment() -> dict[str, str]:
    """The environment of the command, whose text is without colours. Kernels of Jupyter ask for them."""
    forcing = ("CLICOLOR_FORCE", "FORCE_COLOR", "CLICOLOR")
    return {name: value for name, value in os.environ.items() if name not in forcing} | {"NO_COLOR": "1"}


def _packaged() -> Optional[str]:
    try:
        files = importlib.metadata.files("photoncard") or []
    except importlib.metadata.PackageNotFoundError:
        return None
    programs = [str(file.locate()) for file in files if file.name == _PROGRAM and len(file.parts) > 1]
    return next((os.path.abspath(program) for program in programs if os.access(program, os.X_OK)), None)


@dataclass(frozen=True)
class Option:
    """An option of a command, as its help states it."""

    name: str
    heading: str
    takes_value: bool
    #: True if each value of a list is stated by an option of its own.
    is_repeated: bool
    help: str

    def words(self, value: Any) -> list[str]:
        """The option with its value as words of the command line; none if the value is the default.

        >>> Option("look-at", "", True, False, "").words((0, 1, -2.5))
        ['--look-at=0,1,-2.5']
        >>> Option("quiet", "", False, False, "").words(True)
        ['--quiet']
        """
        if value is None:
            return []
        if not self.takes_value:
            if not isinstance(value, bool):
                raise Error(
                    f"{self.keyword} is a switch, and {value!r} is no state of it", "state True or False"
                )
            return [f"--{self.name}"] if value else []
        values = self._values(value)
        return [f"--{self.name}={text}" for text in values]

    @property
    def keyword(self) -> str:
        """Name of the option as a keyword."""
        return self.name.replace("-", "_")

    def _values(self, value: Any) -> list[str]:
        if isinstance(value, Mapping):
            if not self.is_repeated:
                raise Error(f"{self.keyword} takes no mapping", "state its value as text")
            return [f"{name}={value_text(item)}" for name, item in value.items()]
        if self.is_repeated and is_sequence(value) and not all(is_number(item) for item in value):
            return [value_text(item) for item in value]
        if self.name == "size" and is_sequence(value):
            return ["x".join(value_text(side) for side in value)]
        return [value_text(value)]


def is_sequence(value: Any) -> bool:
    """Whether a value is a list, a tuple or an array."""
    return isinstance(value, (list, tuple)) or (hasattr(value, "tolist") and getattr(value, "ndim", 0) > 0)


def is_number(value: Any) -> bool:
    """Whether a value is a number."""
    return not isinstance(value, (str, bytes)) and hasattr(value, "__float__")


def value_text(value: Any) -> str:
    """A value as the command line states it.

    >>> value_text((1, 0.5)), value_text(True), value_text(Path("a.ies"))
    ('1,0.5', 'on', 'a.ies')
    """
    if isinstance(value, bool):
        return "on" if value else "off"
    if is_sequence(value):
        return ",".join(value_text(item) for item in value)
    if hasattr(value, "item"):
        value = value.item()
    return os.fspath(value) if isinstance(value, os.PathLike) else str(value)


@functools.lru_cache(maxsize=None)
def options_of(program: Path, *names: str) -> Mapping[str, Option]:
    """The options of a command, by their keywords."""
    printed = subprocess.run(
        [str(program), *names, "--help"],
        stdin=subprocess.DEVNULL,
        capture_output=True,
        encoding="utf-8",
        errors="replace",
        env=plain_environment(),
    )
    if printed.returncode != 0:
        remedy = "install a photoncard of this package's version"
        if names[:1] == ("study",):
            remedy = "install the wheel, or build the command with --features study"
        raise Error(f"{program} has no command '{' '.join(names)}'", remedy, printed.returncode)
    return {option.keyword: option for option in _parsed(printed.stdout) if option.name != "help"}


def _parsed(text: str) -> list[Option]:
    """The options in the text of a help.

    >>> [option] = _parsed("Cards:\\n      --card <CARD>\\n          Where; may be\\n          repeated\\n")
    >>> option.heading, option.is_repeated
    ('Cards', True)
    """
    options: list[Option] = []
    heading = ""
    lines = text.splitlines()
    starts = [index for index, line in enumerate(lines) if _OPTION.match(line) or _HEADING.match(line)]
    for start, end in zip(starts, [*starts[1:], len(lines)]):
        found = _OPTION.match(lines[start])
        if found is None:
            heading = lines[start].rstrip(":")
            continue
        about = " ".join(" ".join(lines[start + 1 : end]).split())
        is_repeated = "may be repeated" in about or "several times" in about
        options.append(Option(found[1], heading, found[2] is not None, is_repeated, about))
    return options


def words_of(names: Sequence[str], options: Mapping[str, Any]) -> list[str]:
    """Keywords as words of the command line of a command."""
    known = options_of(command(), *names)
    words: list[str] = []
    for keyword, value in options.items():
        option = known.get(keyword)
        if option is None:
            listed = known_names(keyword, known, most=6)
            remedy = f"options are those of `photoncard {' '.join(names)} --help`, such as {listed}"
            raise UnknownOption(f"{keyword!r} is no option of photoncard {' '.join(names)}", remedy)
        words += option.words(value)
    return words
