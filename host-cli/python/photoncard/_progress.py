"""Shows progress in a notebook or on a terminal."""

from __future__ import annotations

import html
import sys
from collections.abc import Iterator
from contextlib import contextmanager
from typing import Any, Callable, Optional

from ._process import Progress, ProgressOption

_WIDTH = 60


def text_of(progress: Progress) -> str:
    """Progress as a line.

    >>> text_of(Progress("tiles", 3, 10, 1.25, 3.4))
    'tiles 30 %, 1 s, 3 s left'
    """
    share = 100 * progress.done // max(progress.total, 1)
    left = "" if progress.seconds_left is None else f", {progress.seconds_left:.0f} s left"
    return f"{progress.phase} {share} %, {progress.seconds:.0f} s{left}"


@contextmanager
def shown(option: ProgressOption) -> Iterator[Optional[Callable[[Progress], None]]]:
    """Where progress goes; what shows it is removed at the end."""
    if callable(option):
        yield option
        return
    show = None if option is False else (_notebook() or _terminal())
    try:
        yield show
    finally:
        if show is not None:
            show.clear()


def _notebook() -> Optional[_Notebook]:
    ipython = sys.modules.get("IPython")
    shell = ipython.get_ipython() if ipython is not None else None
    return _Notebook() if shell is not None and hasattr(shell, "kernel") else None


def _terminal() -> Optional[_Terminal]:
    return _Terminal() if sys.stderr is not None and sys.stderr.isatty() else None


class _Terminal:
    def __call__(self, progress: Progress) -> None:
        sys.stderr.write("\r" + text_of(progress)[:_WIDTH].ljust(_WIDTH))
        sys.stderr.flush()

    def clear(self) -> None:
        sys.stderr.write("\r" + " " * _WIDTH + "\r")
        sys.stderr.flush()


class _Notebook:
    def __init__(self) -> None:
        self._handle: Any = None

    def __call__(self, progress: Progress) -> None:
        text = html.escape(text_of(progress))
        self._show(f'<progress value="{progress.done}" max="{max(progress.total, 1)}"></progress> {text}')

    def clear(self) -> None:
        if self._handle is not None:
            self._show("")

    def _show(self, content: str) -> None:
        from IPython.display import HTML, display

        if self._handle is None:
            self._handle = display(HTML(content), display_id=True)
        else:
            self._handle.update(HTML(content))
