"""Reads the lines of `photoncard render --progress json`."""

from __future__ import annotations

import json
from dataclasses import dataclass, field


@dataclass
class Progress:
    """Work that is done, of the phase."""

    phase: str
    done: float
    total: float
    seconds_left: float | None

    @property
    def share(self) -> float:
        """Share of the phase that is done, 0 to 1."""
        return min(self.done / self.total, 1.0) if self.total > 0 else 0.0


@dataclass
class Remark:
    """Contents that are ignored or read otherwise than the scene states, or any other line."""

    kind: str
    message: str
    items: list[str] = field(default_factory=list)

    def __str__(self) -> str:
        return f"{self.message}: {', '.join(self.items)}" if self.items else self.message


@dataclass
class Failure:
    """Reason why a render failed, and what helps."""

    message: str
    remedy: str | None = None

    def __str__(self) -> str:
        return f"{self.message}\n{self.remedy}" if self.remedy else self.message


Event = Progress | Remark | Failure

_REMARKS = ("ignored", "note", "message")


def parse(line: str) -> Event | None:
    """Reads a line. `None` for an empty one and for kinds that are not known; text is a message."""
    line = line.strip()
    if not line:
        return None
    try:
        read = json.loads(line)
    except ValueError:
        return Remark("message", line)
    if not isinstance(read, dict):
        return Remark("message", line)
    kind = read.get("kind")
    if kind == "progress":
        return Progress(
            str(read.get("phase", "")), _number(read.get("done")), _number(read.get("total")), _left(read)
        )
    if kind in _REMARKS:
        items = read.get("items")
        items = [str(item) for item in items] if isinstance(items, list) else []
        return Remark(kind, str(read.get("message", "")), items)
    if kind == "failure":
        remedy = read.get("remedy")
        return Failure(str(read.get("message", "")), None if remedy is None else str(remedy))
    return None


def _number(value: object) -> float:
    return float(value) if isinstance(value, (int, float)) else 0.0


def _left(read: dict[str, object]) -> float | None:
    value = read.get("seconds_left")
    return float(value) if isinstance(value, (int, float)) else None
