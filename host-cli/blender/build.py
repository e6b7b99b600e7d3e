#!/usr/bin/env python3
"""Makes the zip of the Blender extension: `build.py BINARY OUT_DIR [LICENCE ...]`.

The zip has the program BINARY as `bin/photoncard`, for the platform that the program's header states.
Texts of licences of what the program contains are added. Equal inputs make equal bytes. Where the command `blender` is found, it validates the zip.
"""

from __future__ import annotations

import re
import shutil
import stat
import struct
import subprocess
import sys
import tempfile
import zipfile
from collections.abc import Sequence
from pathlib import Path

HERE = Path(__file__).resolve().parent
SOURCE = HERE / "photoncard"
LICENSES = [HERE.parent / name for name in ("LICENSE-APACHE", "LICENSE-MIT")]
TIME = (1980, 1, 1, 0, 0, 0)
ELF = {62: "linux-x64", 183: "linux-arm64"}
MACH = {0x01000007: "macos-x64", 0x0100000C: "macos-arm64"}
PE = {0x8664: "windows-x64", 0xAA64: "windows-arm64"}


class BuildError(Exception):
    """Inputs of which no zip can be made, with the remedy."""


def platform_of(program: bytes) -> str:
    """The platform of a program, as the manifest names it."""
    found = None
    if program[:4] == b"\x7fELF" and len(program) >= 20:
        found = ELF.get(struct.unpack_from("<H", program, 18)[0])
    elif program[:4] == b"\xcf\xfa\xed\xfe" and len(program) >= 8:
        found = MACH.get(struct.unpack_from("<I", program, 4)[0])
    elif program[:2] == b"MZ" and len(program) >= 64:
        (header,) = struct.unpack_from("<I", program, 60)
        if program[header : header + 4] == b"PE\0\0":
            found = PE.get(struct.unpack_from("<H", program, header + 4)[0])
    if found is None:
        raise BuildError("the program is of no platform of Blender: build photoncard for 64-bit x86 or ARM")
    return found


def stripped(program: Path) -> bytes:
    """The program's bytes, without symbols where `strip` is found."""
    strip = shutil.which("strip")
    if strip is None or not program.read_bytes().startswith(b"\x7fELF"):
        return program.read_bytes()
    with tempfile.TemporaryDirectory() as folder:
        copy = Path(folder) / "program"
        subprocess.run([strip, "-o", copy, program], check=True)
        return copy.read_bytes()


def contents(program: bytes, platform: str, licences: Sequence[Path] = ()) -> dict[str, bytes]:
    """Files of the zip by their names."""
    files = {path.relative_to(SOURCE).as_posix(): path.read_bytes() for path in SOURCE.rglob("*.py")}
    files |= {path.name: path.read_bytes() for path in [*LICENSES, *licences]}
    manifest = (SOURCE / "blender_manifest.toml").read_text()
    files["blender_manifest.toml"] = with_platform(manifest, platform).encode()
    suffix = ".exe" if platform.startswith("windows") else ""
    files[f"bin/photoncard{suffix}"] = program
    return files


def with_platform(manifest: str, platform: str) -> str:
    """The manifest of one platform. Tables follow the keys of the document."""
    return re.sub(r"(?m)^license = .*$", rf'\g<0>\nplatforms = ["{platform}"]', manifest, count=1)


def write_zip(path: Path, files: dict[str, bytes]) -> None:
    """Writes files in the order of their names, with one time."""
    with zipfile.ZipFile(path, "w") as archive:
        for name in sorted(files):
            entry = zipfile.ZipInfo(name, TIME)
            entry.create_system = 3
            mode = 0o755 if name.startswith("bin/") else 0o644
            entry.external_attr = (stat.S_IFREG | mode) << 16
            entry.compress_type = zipfile.ZIP_DEFLATED
            archive.writestr(entry, files[name], compresslevel=9)


def build(program: Path, folder: Path, licences: Sequence[Path] = ()) -> Path:
    """Makes the zip and returns its path."""
    if not program.is_file():
        raise BuildError(f"there is no program {program}: build it by cargo build --release")
    code = stripped(program)
    platform = platform_of(code)
    files = contents(code, platform, licences)
    version = re.search(r'(?m)^version = "(.+)"$', files["blender_manifest.toml"].decode()).group(1)
    folder.mkdir(parents=True, exist_ok=True)
    path = folder / f"photoncard-blender-{version}-{platform}.zip"
    partial = path.with_suffix(".partial")
    write_zip(partial, files)
    partial.replace(path)
    return path


def validate(path: Path) -> None:
    """Has Blender validate the zip, if it is there."""
    blender = shutil.which("blender")
    if blender is None:
        print("blender is not found: the zip is not validated", file=sys.stderr)
        return
    subprocess.run([blender, "--command", "extension", "validate", path], check=True)


def main() -> int:
    """The script."""
    if len(sys.argv) < 3:
        print("usage: build.py BINARY OUT_DIR [LICENCE ...]", file=sys.stderr)
        return 2
    try:
        program, folder, *licences = map(Path, sys.argv[1:])
        path = build(program, folder, licences)
        validate(path)
    except (BuildError, subprocess.CalledProcessError, OSError) as error:
        print(f"build.py: {error}", file=sys.stderr)
        return 1
    print(path)
    return 0


if __name__ == "__main__":
    sys.exit(main())
