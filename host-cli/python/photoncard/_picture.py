"""Pictures: an EXR with its layers, and its PNG."""

from __future__ import annotations

import json
import os
import shutil
import tempfile
import weakref
from collections.abc import Mapping, Sequence
from pathlib import Path
from typing import Any, Optional, Union

import numpy as np

from ._command import words_of
from ._errors import Error, UnknownName, known_names
from ._exr import Array, Exr, read_exr
from ._process import Note, run

PathLike = Union[str, "os.PathLike[str]"]

#: Prefixes of the channels of mattes, by the names of their layers.
_MATTES = {"object": "CryptoObject", "material": "CryptoMaterial"}
#: Order of the channels of a layer.
_ORDER = {name: index for index, name in enumerate("RGBXYZA")}


class Folder:
    """A folder that is removed when nothing refers to it."""

    def __init__(self) -> None:
        self.path = Path(tempfile.mkdtemp(prefix="photoncard-"))
        weakref.finalize(self, shutil.rmtree, self.path, ignore_errors=True)


class Picture:
    """A picture in linear light, W/(sr m^2) in each RGB channel, with layers."""

    def __init__(
        self,
        path: PathLike,
        png: Optional[PathLike] = None,
        stats: Optional[Mapping[str, Any]] = None,
        notes: Sequence[Note] = (),
        messages: Sequence[str] = (),
        kept: Optional[Folder] = None,
    ) -> None:
        #: Path of the EXR.
        self.path = Path(path)
        #: Statistics of the render: `provenance`, seconds, rays, gathers, bytes.
        self.stats = dict(stats or {})
        #: Contents of the scene that the render left out or reads otherwise.
        self.notes = list(notes)
        #: Other lines that the command has said.
        self.messages = list(messages)
        self._png = None if png is None else Path(png).read_bytes()
        self._kept = kept
        self._exr: Exr = read_exr(self.path)
        self._layers = _layers(self._exr)

    @property
    def image(self) -> Array:
        """Radiance, height x width x 3. With alpha it is premultiplied."""
        return self["RGB"]

    @property
    def alpha(self) -> Array:
        """Alpha of a picture by `transparent=True`, or the layer `alpha`, height x width."""
        return np.asarray(self._exr.channels["A"]) if "A" in self._exr.channels else self["alpha"]

    @property
    def size(self) -> tuple[int, int]:
        """Width and height of the samples, pixels."""
        left, top, right, bottom = self._exr.data_window
        return right - left + 1, bottom - top + 1

    @property
    def layers(self) -> tuple[str, ...]:
        """Names of the layers beside the radiance, such as `indirect` and `N`."""
        return tuple(name for name in self._layers if name != "RGB")

    def __getitem__(self, layer: str) -> Array:
        """A layer: height x width x 3 of colours, normals and positions, height x width of numbers."""
        if layer not in self._layers:
            prefix = _MATTES.get(layer)
            if prefix is not None and any(name.startswith(prefix) for name in self._exr.channels):
                raise UnknownName(f"{layer!r} has mattes, and no pixels", f"take mattes({layer!r})")
            remedy = f"there are {known_names(layer, self._layers)}; state others by aov=[...] of the render"
            raise UnknownName(f"the picture has no layer {layer!r}", remedy)
        channels = [self._exr.channels[name] for name in self._layers[layer]]
        return np.stack(channels, axis=-1) if len(channels) > 1 else channels[0]

    def mattes(self, layer: str = "object") -> dict[str, Array]:
        """Coverage, 0 to 1, of each name of the layer `object` or `material`, height x width.

        Names that no pixel shows are left out.
        """
        prefix = _MATTES.get(layer)
        ranks = sorted(
            name[:-2]
            for name in self._exr.channels
            if prefix and name.startswith(prefix) and name.endswith(".r")
        )
        if not ranks:
            raise UnknownName(f"the picture has no mattes {layer!r}", f"render it with aov=[{layer!r}]")
        pairs = [(f"{rank}.{key}", f"{rank}.{share}") for rank in ranks for key, share in ("rg", "ba")]
        mattes = {}
        for name, key in self._manifest(prefix or "").items():
            shares = [
                np.where(_bits(self._exr.channels[of]) == int(key, 16), self._exr.channels[share], 0)
                for of, share in pairs
            ]
            coverage = np.sum(shares, axis=0, dtype=np.float32)
            if coverage.any():
                mattes[name] = coverage
        return mattes

    def _manifest(self, prefix: str) -> dict[str, str]:
        texts = self._exr.texts
        for attribute, text in texts.items():
            if attribute.startswith("cryptomatte/") and attribute.endswith("/name") and text == prefix:
                return json.loads(texts[attribute[: -len("name")] + "manifest"])
        raise Error(f"{self.path} has no names of its mattes", "render it again")

    @property
    def provenance(self) -> dict[str, Any]:
        """All that the pixels depend on, as the file states it."""
        return json.loads(self._exr.texts.get("photoncard", "{}"))

    def to_png(self, path: PathLike, **options: Any) -> Path:
        """Writes the tone-mapped picture.

        Without options it is the PNG of the render. Options are those of `photoncard tonemap`: `exposure`,
        `tonemap`, `false_color=(low, high)` and `lumens_per_watt`.
        """
        path = Path(path)
        words = words_of(["tonemap"], options)
        if words or self._png is None:
            run(["tonemap"], [*words, f"--output={path}", "--", str(self.path)])
        else:
            _write(path, self._png)
        return path

    def save(self, path: PathLike) -> Path:
        """Writes the EXR with all layers."""
        path = Path(path)
        _write(path, self.path.read_bytes())
        return path

    def mix(
        self, *, exposure: Any = None, tonemap: Optional[str] = None, denoise: bool = False, **factors: Any
    ) -> Picture:
        """The picture with the light of its groups times factors, each a number or three: `mix(lamp=0.5)`."""
        kept = Folder()
        path, png = kept.path / "mix.exr", kept.path / "mix.png"
        options = {"group": factors, "exposure": exposure, "tonemap": tonemap, "denoise": denoise}
        words = words_of(["mix"], options)
        outcome = run(["mix"], [*words, f"--output={path}", f"--output={png}", "--", str(self.path)])
        return Picture(path, png, None, outcome.notes, outcome.messages, kept)

    def _repr_png_(self) -> bytes:
        if self._png is None:
            self._png = self._rendered_png()
        return self._png

    def _rendered_png(self) -> bytes:
        place = Folder()
        return self.to_png(place.path / "picture.png").read_bytes()

    def _ipython_key_completions_(self) -> list[str]:
        return list(self._layers)

    def __repr__(self) -> str:
        width, height = self.size
        return f"<picture of {width} x {height} pixels, layers {', '.join(self.layers) or 'none'}>"


def read(path: PathLike) -> Picture:
    """Reads an EXR that photoncard has written."""
    return Picture(path)


def _layers(exr: Exr) -> dict[str, list[str]]:
    """Names of the channels of each layer, in their order."""
    layers: dict[str, list[str]] = {}
    for name in exr.channels:
        layer, _, channel = name.rpartition(".")
        if layer.startswith(tuple(_MATTES.values())) or name == "A":
            continue
        if not layer:
            layer = "RGB" if channel in "RGB" else channel
        layers.setdefault("position" if layer == "P" else layer, []).append(name)
    for channels in layers.values():
        channels.sort(key=lambda name: _ORDER.get(name[-1], len(_ORDER)))
    if len(layers.get("RGB", ())) != 3:
        raise Error("the picture has no channels R, G and B", "read a picture that photoncard has rendered")
    return layers


def _bits(samples: Any) -> Any:
    return np.ascontiguousarray(samples, np.float32).view(np.uint32)


def _write(path: Path, content: bytes) -> None:
    """Writes a file whole or not at all."""
    part = path.with_name(f".{path.name}.{os.getpid()}")
    try:
        part.write_bytes(content)
        os.replace(part, path)
    except OSError as reason:
        part.unlink(missing_ok=True)
        raise Error(f"cannot write {path}: {reason.strerror}", "check that its folder exists") from reason
