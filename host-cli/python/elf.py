"""Reads from an ELF program which machine and which glibc it needs."""

from __future__ import annotations

import struct
from dataclasses import dataclass
from pathlib import Path
from typing import Union

_MACHINES = {62: "x86_64", 183: "aarch64", 243: "riscv64"}
_DYNAMIC, _VERSION_NEEDS = 6, 0x6FFFFFFE
_NEEDED = 1
#: Libraries that every system of a manylinux tag has.
_OF_EVERY_SYSTEM = ("libc.so.6", "libm.so.6", "libgcc_s.so.1", "libpthread.so.0", "libdl.so.2", "librt.so.1")


@dataclass(frozen=True)
class Needs:
    """What a program needs of its system."""

    machine: str
    #: Version of glibc, the greatest of the symbols' versions.
    glibc: tuple[int, ...]
    #: Shared libraries that a manylinux tag does not promise.
    others: list[str]


def needs_of(path: Union[str, Path]) -> Needs:
    """Reads the needs of a program.

    Raises:
        ValueError: if the file is no 64-bit ELF program of a known machine that is linked with glibc.
    """
    content = Path(path).read_bytes()
    if content[:6] != b"\x7fELF\x02\x01":
        raise ValueError(f"{path} is no 64-bit little-endian ELF program")
    (machine,) = struct.unpack_from("<H", content, 18)
    if machine not in _MACHINES:
        raise ValueError(f"{path} is of the machine {machine}, for which there is no tag")
    sections = _sections(content)
    libraries = [
        _text(content, sections[link][1] + value)
        for kind, start, size, link in sections
        if kind == _DYNAMIC
        for tag, value in struct.iter_unpack("<qQ", content[start : start + size])
        if tag == _NEEDED
    ]
    versions = [
        tuple(int(number) for number in name[len("GLIBC_") :].split("."))
        for kind, start, _, link in sections
        if kind == _VERSION_NEEDS
        for name in _version_names(content, start, sections[link][1])
        if name.startswith("GLIBC_") and name[len("GLIBC_")].isdigit()
    ]
    if not versions:
        raise ValueError(f"{path} names no version of glibc: it is linked otherwise")
    others = [name for name in libraries if name not in _OF_EVERY_SYSTEM and not name.startswith("ld-linux")]
    return Needs(_MACHINES[machine], max(versions), others)


def _sections(content: bytes) -> list[tuple[int, int, int, int]]:
    """Type, offset, size and link of each section."""
    (start,) = struct.unpack_from("<Q", content, 40)
    size, count = struct.unpack_from("<HH", content, 58)
    heads = (struct.unpack_from("<IIQQQQII", content, start + index * size) for index in range(count))
    return [(kind, offset, length, link) for _, kind, _, _, offset, length, link, _ in heads]


def _version_names(content: bytes, start: int, names: int) -> list[str]:
    found = []
    at, more = start, True
    while more:
        _, _, _, first, following = struct.unpack_from("<HHIII", content, at)
        entry, another = at + first, True
        while another:
            _, _, _, name, step = struct.unpack_from("<IHHII", content, entry)
            found.append(_text(content, names + name))
            entry, another = entry + step, step != 0
        at, more = at + following, following != 0
    return found


def _text(content: bytes, start: int) -> str:
    return content[start : content.index(b"\0", start)].decode("ascii")
