#!/usr/bin/env python3
"""Executes docs/notebook.ipynb from nothing, with the installed package: tests/notebook.py [--update].

With --update the outputs are written into the file. Exit status 75: nbclient or a package that the notebook
needs is missing.
"""

from __future__ import annotations

import importlib.util
import sys
import time
from pathlib import Path

ROOT = Path(__file__).resolve().parents[1]
NOTEBOOK = ROOT / "docs/notebook.ipynb"
NEEDED = ("nbclient", "nbformat", "ipykernel", "matplotlib", "photoncard")
SECONDS = 600


def main() -> None:
    """Executes the notebook, and fails with its first error."""
    if sys.argv[1:] not in ([], ["--update"]):
        sys.exit(f"usage: {sys.argv[0]} [--update]")
    missing = [name for name in NEEDED if importlib.util.find_spec(name) is None]
    if missing:
        print(f"SKIPPED: {NOTEBOOK.name}: run: pip install {' '.join(missing)}", file=sys.stderr)
        sys.exit(75)
    import nbclient
    import nbformat

    notebook = nbformat.read(NOTEBOOK, as_version=4)
    start = time.monotonic()
    client = nbclient.NotebookClient(
        notebook, timeout=SECONDS, record_timing=False, resources={"metadata": {"path": str(ROOT)}}
    )
    try:
        client.execute()
    except nbclient.exceptions.CellExecutionError as reason:
        sys.exit(f"{NOTEBOOK.name}: {reason}")
    print(f"{NOTEBOOK.name}: executed in {time.monotonic() - start:.0f} s")
    if sys.argv[1:]:
        for cell in notebook.cells:
            if cell.cell_type == "code":
                cell.outputs = [output for output in cell.outputs if not is_progress(output)]
        notebook.metadata.language_info = {"name": "python"}
        nbformat.write(notebook, NOTEBOOK)


def is_progress(output: object) -> bool:
    """Whether an output is the empty place of a progress bar."""
    data = output.get("data", {})  # type: ignore[attr-defined]
    return data.get("text/html") == ""


if __name__ == "__main__":
    main()
