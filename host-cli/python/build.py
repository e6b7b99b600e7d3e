#!/usr/bin/env python3
"""Writes the wheel of the command and the package over it: build.py BINARY OUT_DIR.

The wheel has the command as a script, which pip puts beside the interpreter, on PATH. Its tag states the
glibc that the command's symbols need. Equal inputs give equal bytes: times are those of the last commit, or
SOURCE_DATE_EPOCH.
"""

from __future__ import annotations

import argparse
import base64
import csv
import hashlib
import io
import os
import re
import subprocess
import sys
import time
import zipfile
from pathlib import Path
from typing import Optional

from elf import needs_of

HERE = Path(__file__).resolve().parent
ROOT = HERE.parents[1]
SUMMARY = "Global illumination by photon mapping: renders, measures and bakes glTF scenes"
METADATA = f"""\
Metadata-Version: 2.1
Name: photoncard
Version: {{version}}
Summary: {SUMMARY}
License: MIT OR Apache-2.0
Requires-Python: >=3.9
Requires-Dist: numpy>=1.21
Provides-Extra: pandas
Requires-Dist: pandas; extra == "pandas"
Classifier: Programming Language :: Python :: 3
Classifier: Programming Language :: Rust
Classifier: Topic :: Multimedia :: Graphics :: 3D Rendering
Classifier: Typing :: Typed
Description-Content-Type: text/markdown

"""


def main() -> None:
    """Writes the wheel, and prints its path."""
    parser = argparse.ArgumentParser(description=__doc__.splitlines()[0])
    parser.add_argument("binary", type=Path, help="the command, built with --features study")
    parser.add_argument("out", type=Path, help="folder of the wheel")
    parser.add_argument("--licences", type=Path, help="texts of the licences of the crates in the command")
    arguments = parser.parse_args()
    try:
        print(build(arguments.binary, arguments.out, arguments.licences))
    except (OSError, ValueError) as reason:
        sys.exit(f"{sys.argv[0]}: {reason}")


def build(binary: Path, out: Path, licences: Optional[Path] = None) -> Path:
    """Writes the wheel, whole or not at all."""
    version, tag = _version(), tag_of(binary)
    name = f"photoncard-{version}"
    files = _files(binary, name, version, tag)
    if licences is not None:
        files[f"{name}.dist-info/licenses/LICENSES-OF-CRATES.txt"] = licences.read_bytes()
    content = _wheel(files, name, _date())
    out.mkdir(parents=True, exist_ok=True)
    path = out / f"{name}-{tag}.whl"
    part = path.with_name(f".{path.name}")
    part.write_bytes(content)
    os.replace(part, path)
    return path


def tag_of(binary: Path) -> str:
    """The wheel's tag, by what the command needs.

    Raises:
        ValueError: if no tag states that.
    """
    if binary.read_bytes()[:2] == b"MZ":
        return "py3-none-win_amd64"
    needs = needs_of(binary)
    if needs.others:
        raise ValueError(f"{binary} needs {', '.join(needs.others)}, which not every system has")
    major, minor = needs.glibc[:2]
    return f"py3-none-manylinux_{major}_{minor}_{needs.machine}"


def _version() -> str:
    found = re.search(r'^version = "(.+)"$', (ROOT / "Cargo.toml").read_text(encoding="utf-8"), re.MULTILINE)
    if found is None:
        raise ValueError(f"{ROOT / 'Cargo.toml'} states no version")
    return found[1]


def _date() -> tuple[int, int, int, int, int, int]:
    epoch = os.environ.get("SOURCE_DATE_EPOCH")
    if epoch is None:
        said = subprocess.run(
            ["git", "-C", str(ROOT), "log", "-1", "--format=%ct"], capture_output=True, text=True
        )
        if said.returncode != 0:
            raise ValueError("outside of git SOURCE_DATE_EPOCH states the time of the files")
        epoch = said.stdout
    year, *rest = time.gmtime(int(epoch))[:6]
    # A zip archive has no times before 1980.
    return (year, *rest) if year >= 1980 else (1980, 1, 1, 0, 0, 0)  # type: ignore[return-value]


def _files(binary: Path, name: str, version: str, tag: str) -> dict[str, bytes]:
    """Contents of the wheel by their names, but RECORD."""
    info = f"{name}.dist-info"
    suffix = ".exe" if "-win" in tag else ""
    files = {f"{name}.data/scripts/photoncard{suffix}": binary.read_bytes()}
    for path in sorted((HERE / "photoncard").iterdir()):
        if path.suffix == ".py" or path.name == "py.typed":
            files[f"photoncard/{path.name}"] = path.read_bytes()
    about = METADATA.format(version=version) + (HERE / "README.md").read_text(encoding="utf-8")
    files[f"{info}/METADATA"] = about.encode()
    files[f"{info}/WHEEL"] = (
        f"Wheel-Version: 1.0\nGenerator: photoncard {version}\nRoot-Is-Purelib: false\nTag: {tag}\n".encode()
    )
    for licence in ("LICENSE-MIT", "LICENSE-APACHE"):
        files[f"{info}/licenses/{licence}"] = (ROOT / licence).read_bytes()
    sky = ROOT / "driver/scene/src/sky/hosek_wilkie_license.txt"
    files[f"{info}/licenses/LICENSE-OF-SKY-DATA.txt"] = sky.read_bytes()
    return files


def _wheel(files: dict[str, bytes], name: str, date: tuple[int, int, int, int, int, int]) -> bytes:
    record = f"{name}.dist-info/RECORD"
    rows = [(path, f"sha256={_digest(content)}", len(content)) for path, content in sorted(files.items())]
    text = io.StringIO()
    csv.writer(text, lineterminator="\n").writerows([*rows, (record, "", "")])
    archive = io.BytesIO()
    with zipfile.ZipFile(archive, "w") as wheel:
        for path, content in [*sorted(files.items()), (record, text.getvalue().encode())]:
            entry = zipfile.ZipInfo(path, date)
            entry.create_system = 3
            entry.external_attr = (0o100755 if ".data/scripts/" in path else 0o100644) << 16
            wheel.writestr(entry, content, zipfile.ZIP_DEFLATED, 9)
    return archive.getvalue()


def _digest(content: bytes) -> str:
    return base64.urlsafe_b64encode(hashlib.sha256(content).digest()).rstrip(b"=").decode("ascii")


if __name__ == "__main__":
    main()
