"""Measures memory traffic over values of options."""

from __future__ import annotations

from collections.abc import Sequence
from pathlib import Path
from typing import TYPE_CHECKING, Any, Optional

from ._command import value_text, words_of
from ._errors import Error
from ._picture import Folder, PathLike
from ._process import ProgressOption, run
from ._progress import shown
from ._scene import Scene
from ._table import Table

if TYPE_CHECKING:
    import pandas

_COMMAND = ("study", "sweep")


class Sweep:
    """Tables and plots of a sweep: `points` has a row for each combination of the values."""

    def __init__(self, path: Path, kept: Any) -> None:
        #: The folder of tables and plots.
        self.path = path
        self._kept = kept
        self._read: dict[str, Table] = {}

    @property
    def tables(self) -> list[str]:
        """Names of the tables."""
        return sorted(path.stem for path in self.path.glob("*.csv"))

    def __getitem__(self, name: str) -> Table:
        """A table by its name: `points`, `structures` and, with `reuse=True`, `reuse`."""
        if name not in self.tables:
            raise Error(f"the sweep has no table {name!r}", f"there are {', '.join(self.tables)}")
        if name not in self._read:
            self._read[name] = Table.of_csv((self.path / f"{name}.csv").read_text(encoding="utf-8"))
        return self._read[name]

    @property
    def points(self) -> Table:
        """The table of points."""
        return self["points"]

    def frame(self, table: str = "points") -> pandas.DataFrame:
        """A table as a data frame of pandas, which must be installed."""
        return self[table].to_pandas()

    def _repr_html_(self) -> str:
        return self.points._repr_html_()

    def __repr__(self) -> str:
        return f"<sweep of {len(self.points)} points, tables {', '.join(self.tables)}>"


def sweep(
    scene: Scene, out: Optional[PathLike] = None, *, progress: ProgressOption = None, **options: Any
) -> Sweep:
    """Measures a scene over values of options, by `photoncard study sweep`.

    A list is varied, and every combination is a point; any other value is an option of all points. Options
    are those of `photoncard study sweep`; `chip={"irradiance_records": [256, 512]}` varies capacities. `out`
    is a folder that keeps finished points, so that the same sweep continues there.

    Raises:
        Error: if the sweep fails, or the command is built without studies.
    """
    chip = options.pop("chip", {})
    varied = {name: value for name, value in options.items() if isinstance(value, list)}
    fixed = {name: value for name, value in options.items() if name not in varied and name != "quiet"}
    words_of(_COMMAND, dict.fromkeys(varied))
    if not varied and not chip:
        raise Error("the sweep varies nothing", 'state a list of values, such as order=["naive", "sort"]')
    vary = [_variation(name.replace("_", "-"), values) for name, values in varied.items()]
    vary += [_variation(f"chip.{name}", values) for name, values in chip.items()]
    kept = Folder() if out is None else None
    path = kept.path if kept is not None else Path(out)  # type: ignore[arg-type]
    words = words_of(_COMMAND, {**scene.stated(fixed), "vary": vary, "out": path})
    with shown(False if options.get("quiet") else progress) as show:
        run(_COMMAND, [*words, "--", str(scene.path)], show)
    return Sweep(path, kept)


def _variation(name: str, values: Sequence[Any]) -> str:
    """An option with its values, as `--vary` takes them.

    >>> _variation("order", ["naive", "sort"]), _variation("size", [(64, 64), (32, 32)])
    ('order=naive,sort', 'size=64x64;32x32')
    """
    texts = [
        "x".join(map(str, value))
        if name == "size" and not isinstance(value, (str, int))
        else value_text(value)
        for value in values
    ]
    separator = ";" if len(texts) > 1 and (name == "size" or any("," in text for text in texts)) else ","
    return f"{name}={separator.join(texts)}"
