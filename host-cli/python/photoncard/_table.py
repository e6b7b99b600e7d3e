"""Tables that the command writes as CSV."""

from __future__ import annotations

import csv
import html
import io
from collections.abc import Sequence
from typing import TYPE_CHECKING, Any, Optional

import numpy as np
import numpy.typing as npt

from ._errors import Error, UnknownName, known_names

if TYPE_CHECKING:
    import pandas

_SHOWN_ROWS = 20


class Table:
    """Rows with named columns, over a structured NumPy array.

    >>> table = Table.of_csv("order,x (m)\\nnaive,0.5\\nsort,\\n")
    >>> table.columns
    ('order', 'x (m)')
    >>> table["x (m)"]
    array([0.5, nan])
    >>> len(table)
    2
    """

    def __init__(self, array: npt.NDArray[Any]) -> None:
        #: The structured array.
        self.array = array

    @classmethod
    def of_csv(cls, text: str) -> Table:
        """Reads a table with a line of heads. Columns are whole numbers, numbers (NaN where one is missing) or
        texts.
        """
        rows = list(csv.reader(io.StringIO(text)))
        if not rows:
            raise Error("the table is empty", "measure at least one point")
        heads, rows = rows[0], rows[1:]
        columns = [_column([row[index] for row in rows]) for index in range(len(heads))]
        array = np.empty(len(rows), [(head, column.dtype) for head, column in zip(heads, columns)])
        for head, column in zip(heads, columns):
            array[head] = column
        return cls(array)

    @property
    def columns(self) -> tuple[str, ...]:
        """Names of the columns."""
        return self.array.dtype.names or ()

    def __getitem__(self, name: str) -> npt.NDArray[Any]:
        if name not in self.columns:
            raise UnknownName(
                f"there is no column {name!r}", f"columns are {known_names(name, self.columns, 99)}"
            )
        return self.array[name]

    def __len__(self) -> int:
        return len(self.array)

    def __array__(self, dtype: Any = None, copy: Optional[bool] = None) -> npt.NDArray[Any]:
        return np.array(self.array, dtype=dtype, copy=True) if copy else np.asarray(self.array, dtype=dtype)

    def __repr__(self) -> str:
        return f"<{len(self)} rows of {', '.join(self.columns)}>"

    def _repr_html_(self) -> str:
        rows = "".join(_html_row("td", row) for row in self.array[:_SHOWN_ROWS].tolist())
        more = f"<p>{len(self) - _SHOWN_ROWS} more rows</p>" if len(self) > _SHOWN_ROWS else ""
        return f"<table>{_html_row('th', self.columns)}{rows}</table>{more}"

    def _ipython_key_completions_(self) -> list[str]:
        return list(self.columns)

    def to_pandas(self) -> pandas.DataFrame:
        """The table as a data frame of pandas, which must be installed."""
        try:
            import pandas
        except ImportError as reason:
            raise Error(
                "pandas is missing", "run: pip install pandas; or take the array of the table"
            ) from reason
        return pandas.DataFrame({name: self.array[name] for name in self.columns})


def _column(texts: Sequence[str]) -> npt.NDArray[Any]:
    for convert in (lambda text: int(text), lambda text: float(text) if text else float("nan")):
        try:
            return np.array([convert(text) for text in texts])
        except (ValueError, OverflowError):
            continue
    return np.array(texts, dtype=np.str_)


def _html_row(cell: str, values: Sequence[Any]) -> str:
    texts = (f"{value:.6g}" if isinstance(value, float) else str(value) for value in values)
    return "<tr>" + "".join(f"<{cell}>{html.escape(text)}</{cell}>" for text in texts) + "</tr>"
