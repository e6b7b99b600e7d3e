"""Errors of the package, and errors that the command prints as text."""

from __future__ import annotations

import difflib
import re
from collections.abc import Iterable
from typing import Optional

#: Marks that the command sets before the lines of an error, and before the lines of its remedy.
_CAUSE = re.compile(r"^  (?:× |├─▶ |╰─▶ |│ )\s*(.*)$")
_REMEDY = re.compile(r"^  help: (.*)$")
_USAGE = re.compile(r"^error: (.*)$")
_TIP = re.compile(r"^  tip: (.*)$")


class Error(Exception):
    """Work that failed, with the place and the remedy.

    >>> error = Error("cannot read room.glb", "check the path")
    >>> print(error)
    cannot read room.glb; check the path
    >>> error.remedy
    'check the path'
    """

    def __init__(self, message: str, remedy: Optional[str] = None, status: Optional[int] = None) -> None:
        super().__init__(message)
        self.message = message
        self.remedy = remedy
        #: Exit status of the command; None if the command was not run.
        self.status = status

    def __str__(self) -> str:
        return f"{self.message}; {self.remedy}" if self.remedy else self.message


class UnknownName(Error, LookupError):
    """A name that the scene or the picture does not have."""


class UnknownProperty(Error, AttributeError):
    """A property that a light or a material does not have."""


class UnknownOption(Error, TypeError):
    """A keyword that is no option of the command."""


def known_names(name: str, names: Iterable[str], most: int = 12) -> str:
    """The known names, those like `name` first.

    >>> known_names("lmp", ["floor", "lamp"])
    "'lamp', 'floor'"
    """
    known = list(dict.fromkeys(names))
    if not known:
        return "none"
    like = difflib.get_close_matches(name, known, n=3)
    listed = like + [other for other in known if other not in like]
    more = f" ({len(listed) - most} more)" if len(listed) > most else ""
    return ", ".join(repr(other) for other in listed[:most]) + more


def of_text(text: str, status: int) -> Error:
    """The error that the command has printed as text.

    >>> of_text("scene::unreadable\\n\\n  × cannot read a.glb\\n  help: check the path\\n", 2)
    Error('cannot read a.glb')
    """
    causes: list[str] = []
    remedies: list[str] = []
    for line in text.splitlines():
        for pattern, found in ((_CAUSE, causes), (_USAGE, causes), (_REMEDY, remedies), (_TIP, remedies)):
            match = pattern.match(line)
            if match:
                found.append(match[1])
    message = ": ".join(causes) or text.strip() or f"the command ended with status {status}"
    return Error(message, " ".join(remedies) or None, status)
