"""Remarks on contents of a scene that are rendered otherwise than Blender states them, or not at all."""

from __future__ import annotations

_SHOWN = 5


class Notices:
    """Sentences, each once, with the names that they concern in the order of their discovery."""

    def __init__(self) -> None:
        self._items: dict[str, dict[str, None]] = {}

    def add(self, sentence: str, name: str | None = None) -> None:
        """Adds a sentence that concerns `name`, or the whole scene."""
        names = self._items.setdefault(sentence, {})
        if name is not None:
            names[name] = None

    def lines(self) -> list[str]:
        """A line for each sentence, with the first of its names and the number of the others."""
        return [_line(sentence, list(names)) for sentence, names in self._items.items()]

    def items(self) -> dict[str, list[str]]:
        """All sentences with all their names."""
        return {sentence: list(names) for sentence, names in self._items.items()}


def _line(sentence: str, names: list[str]) -> str:
    if not names:
        return sentence
    others = f" and {len(names) - _SHOWN} more" if len(names) > _SHOWN else ""
    return f"{sentence}: {', '.join(names[:_SHOWN])}{others}"
