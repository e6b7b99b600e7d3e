"""What the tests share. They run against the installed package."""

import contextlib
import os
import tempfile
from pathlib import Path

ROOT = Path(__file__).resolve().parents[3]
SCENES = ROOT / "scenes"
#: Options of a render that takes a second.
QUICK = {"quality": "draft", "photons": 2000, "gather_rays": 8, "spp": 2, "shadow_rays": 1, "adaptive": "off"}


@contextlib.contextmanager
def environment(**values):
    """Sets variables of the environment, and takes them back."""
    before = dict(os.environ)
    os.environ.update(values)
    try:
        yield
    finally:
        os.environ.clear()
        os.environ.update(before)


@contextlib.contextmanager
def program(script):
    """A program in place of the command."""
    with tempfile.TemporaryDirectory() as folder:
        path = Path(folder, "photoncard")
        path.write_text("#!/bin/sh\n" + script)
        path.chmod(0o755)
        with environment(PHOTONCARD=str(path)):
            yield path
