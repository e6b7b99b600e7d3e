"""Renders pictures by the command."""

from __future__ import annotations

import json
import os
import re
from collections.abc import Mapping
from pathlib import Path
from typing import Any, Optional

from ._command import words_of
from ._errors import Error, UnknownOption
from ._picture import Folder, Picture
from ._process import ProgressOption, run
from ._progress import shown

#: Options that another function has in place of a keyword of the render.
_ELSEWHERE = {
    "part": "render parts by the command, and put them together by merge",
    "stats": "read the picture's stats",
}
#: Options whose files lie beside an output that stays.
_BESIDE = ("resume", "keep_samples")


def render(path: Path, options: Mapping[str, Any], progress: ProgressOption) -> list[Picture]:
    """Renders a picture, or each of the frames that the options name."""
    for name, remedy in _ELSEWHERE.items():
        if options.get(name) is not None:
            raise UnknownOption(f"{name!r} is no option here", remedy)
    kept = Folder()
    outputs = _outputs(options, kept.path)
    stated = {name: value for name, value in options.items() if name not in ("output", "progress", "quiet")}
    frames = stated.get("frames") is not None
    stats = kept.path / ("stats.######.json" if frames else "stats.json")
    files = {"output": [str(path) for path in outputs], "stats": str(stats)}
    words = words_of(["render"], {**stated, **files})
    with shown(False if options.get("quiet") else progress) as show:
        outcome = run(["render"], [*words, "--", os.fspath(path)], show)
    numbers = _numbers(stats) if frames else [None]
    exr, png = _pair(outputs)
    return [
        Picture(
            _numbered(exr, number),
            _numbered(png, number),
            _json(_numbered(stats, number)),
            outcome.notes,
            outcome.messages,
            kept,
        )
        for number in numbers
    ]


def merge(*parts: Any, progress: ProgressOption = None, **options: Any) -> Picture:
    """The picture of parts that `photoncard render --part` has written. Options are those of `photoncard merge`."""
    kept = Folder()
    outputs = _outputs(options, kept.path)
    words = words_of(["merge"], {**options, "output": [str(path) for path in outputs]})
    with shown(progress) as show:
        outcome = run(["merge"], [*words, "--", *(os.fspath(part) for part in parts)], show)
    exr, png = _pair(outputs)
    return Picture(exr, png, None, outcome.notes, outcome.messages, kept)


def _outputs(options: Mapping[str, Any], place: Path) -> list[Path]:
    """The files to write: those that the options state, and an EXR and a PNG in any case."""
    stated = options.get("output")
    if stated is None:
        for name in _BESIDE:
            if options.get(name):
                raise Error(f"{name} needs a picture that stays", "state output='picture.exr'")
    outputs = (
        [Path(stated)] if isinstance(stated, (str, os.PathLike)) else [Path(path) for path in stated or []]
    )
    name = "picture.######" if options.get("frames") is not None else "picture"
    suffixes = {path.suffix for path in outputs}
    return outputs + [place / f"{name}{suffix}" for suffix in (".exr", ".png") if suffix not in suffixes]


def _pair(outputs: list[Path]) -> tuple[Path, Path]:
    exr, png = (next(path for path in outputs if path.suffix == suffix) for suffix in (".exr", ".png"))
    return exr, png


def _json(path: Path) -> dict[str, Any]:
    return json.loads(path.read_text(encoding="utf-8"))


def _numbers(stats: Path) -> list[int]:
    """Numbers of the frames, by the files of their statistics."""
    return sorted(int(path.name.split(".")[1]) for path in stats.parent.glob("stats.*.json"))


def _numbered(path: Path, number: Optional[int]) -> Path:
    """The file of a frame.

    >>> _numbered(Path("out.####.exr"), 12).name
    'out.0012.exr'
    """
    if number is None:
        return path
    return path.with_name(re.sub("#+", lambda run: str(number).zfill(len(run[0])), path.name))
