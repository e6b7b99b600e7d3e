"""Measures light at points, and bakes it."""

from __future__ import annotations

import os
from collections.abc import Sequence
from pathlib import Path
from typing import Any, Optional, Union

import numpy as np
import numpy.typing as npt

from ._command import words_of
from ._errors import Error, UnknownOption
from ._picture import PathLike
from ._process import ProgressOption, run
from ._progress import shown
from ._scene import Scene
from ._table import Table

_OF_A_FARM = ("part", "farm", "parts", "merge")


class Measurement(Table):
    """A table of points, with the summary that the command states: mean, extremes and uniformity."""

    summary: str = ""


def measure(
    scene: Scene,
    points: Optional[npt.ArrayLike] = None,
    normals: npt.ArrayLike = (0.0, 1.0, 0.0),
    *,
    grid: Union[None, str, Sequence[float]] = None,
    spacing: Optional[float] = None,
    progress: ProgressOption = None,
    **options: Any,
) -> Measurement:
    """Measures irradiance and illuminance at points, or on a grid.

    Points are rows of `x y z`, with `normals` of one normal or a row a point, or rows of `x y z nx ny nz`.
    `grid` is the name of a node, or the coordinates of two corners. Options are those of `photoncard
    measure`. Columns are those of its table, such as `illuminance_lx` and `error_lx`; `probes=True` gives
    those of probes.

    >>> from photoncard import load
    >>> table = measure(load("scenes/room.glb"), [[0, 0.8, 0]], photons=2000)
    >>> bool(1 < table["illuminance_lx"][0] < 4)
    True

    Raises:
        Error: if a point has another form, or the measurement fails.
    """
    for name in _OF_A_FARM:
        if options.get(name) is not None:
            raise UnknownOption(f"{name!r} is no option here", "measure parts by the command")
    if (points is None) == (grid is None):
        raise Error("points or a grid are measured", "state points, or grid and spacing")
    kept = options.pop("output", None)
    options.pop("points", None)
    where = {"points": None if points is None else "-", "grid": grid, "spacing": spacing}
    words = words_of(["measure"], scene.stated({**_without(options), **where}))
    given = None if points is None else _lines(points, normals, bool(options.get("probes")))
    with shown(False if options.get("quiet") else progress) as show:
        outcome = run(["measure"], [*words, "--output=-", "--", str(scene.path)], show, given)
    table = Measurement(Table.of_csv(outcome.stdout).array)
    table.summary = "\n".join(outcome.messages)
    if kept is not None:
        Path(kept).write_text(outcome.stdout, encoding="utf-8")
    return table


def bake(scene: Scene, output: PathLike, *, progress: ProgressOption = None, **options: Any) -> Path:
    """Writes a glb of the scene whose textures hold its light. Options are those of `photoncard bake`.

    Raises:
        Error: if the bake fails.
    """
    for name in _OF_A_FARM:
        if options.get(name) is not None:
            raise UnknownOption(f"{name!r} is no option here", "bake parts by the command")
    words = words_of(["bake"], scene.stated(_without(options)))
    with shown(False if options.get("quiet") else progress) as show:
        run(["bake"], [*words, f"--output={os.fspath(output)}", "--", str(scene.path)], show)
    return Path(output)


def _without(options: dict[str, Any]) -> dict[str, Any]:
    return {name: value for name, value in options.items() if name != "quiet"}


def _lines(points: npt.ArrayLike, normals: npt.ArrayLike, are_probes: bool) -> str:
    """Points as the command reads them.

    >>> _lines([0, 1, 2], (0, 1, 0), False)
    '0.0 1.0 2.0 0.0 1.0 0.0\\n'
    """
    try:
        rows = np.atleast_2d(np.asarray(points, np.float64))
    except (TypeError, ValueError) as reason:
        raise Error(f"points are no rows of numbers: {reason}", "give rows of x y z") from reason
    if rows.ndim != 2 or rows.shape[1] not in (3, 6):
        raise Error(f"points have the shape {rows.shape}", "give rows of x y z, or of x y z nx ny nz")
    if not are_probes and rows.shape[1] == 3:
        try:
            turned = np.broadcast_to(np.asarray(normals, np.float64), rows.shape)
        except ValueError as reason:
            raise Error("normals are neither one nor a row a point", "give rows of nx ny nz") from reason
        rows = np.hstack([rows, turned])
    bad = np.flatnonzero(~np.isfinite(rows).all(axis=1))
    if bad.size:
        raise Error(f"the point {bad[0]} has a coordinate that is no finite number", "leave it out")
    return "".join(" ".join(map(repr, row)) + "\n" for row in rows.tolist())
