"""Scenes, and assignments to their lights and materials."""

from __future__ import annotations

import json
import os
from collections.abc import Mapping, Sequence
from pathlib import Path
from typing import Any, Optional, Union

from ._command import command, is_number, is_sequence, options_of, value_text, words_of
from ._errors import Error, UnknownName, UnknownOption, UnknownProperty, known_names
from ._picture import PathLike, Picture
from ._process import ProgressOption, run
from ._render import render

#: Properties by where they are, with the number of values that each may have.
_MATERIAL = {
    "diffuse": (1, 3),
    "specular": (1, 3),
    "emission": (1, 3),
    "exponent": (1,),
    "metallic": (1,),
    "roughness": (1,),
    "transmission": (1,),
    "ior": (1,),
    "thickness": (1,),
    "alpha": (1,),
}
_LIGHT = {"colour": (1, 3), "intensity": (1,), "position": (3,), "angle": (1,), "ies": ()}
_ENVIRONMENT = {"strength": (1,)}

Value = Union[float, str, Sequence[float], "os.PathLike[str]"]


def load(path: PathLike, *, prepared: bool = False, **options: Any) -> Scene:
    """Reads what a glTF file contains.

    Options are those of the command on the scene, which all its pictures and measurements then have:
    `light_units`, `variant`, `environment`, `sky` and others under *Scene* in `photoncard render --help`.
    With `prepared` the file is one of `photoncard prepare`, whose contents are not known.

    >>> scene = load("scenes/room.glb")
    >>> [camera["name"] for camera in scene.cameras]
    ['camera']
    """
    known = {
        name: option for name, option in options_of(command(), "render").items() if option.heading == "Scene"
    }
    for name in options:
        if name not in known or name in ("set", "prepared"):
            allowed = [other for other in known if other not in ("set", "prepared")]
            raise UnknownOption(
                f"{name!r} is no option of a scene", f"there are {known_names(name, allowed)}"
            )
    if prepared:
        if not Path(path).is_file():
            raise Error(
                f"cannot read {os.fspath(path)}", "check that the path names a file and that it may be read"
            )
        return Scene(path, None, options)
    units = {name: value for name, value in options.items() if name == "light_units"}
    words = [*words_of(["scene", "info"], units), "--json", "--", os.fspath(path)]
    return Scene(path, json.loads(run(["scene", "info"], words).stdout), options)


class Scene:
    """A scene of a glTF file, with values that replace those of the file."""

    def __init__(self, path: PathLike, info: Optional[Mapping[str, Any]], options: Mapping[str, Any]) -> None:
        self.path = Path(path)
        #: Options of the scene.
        self.options = dict(options)
        #: Values that replace those of the file, by name and property.
        self.assignments: dict[tuple[str, str], Value] = {}
        self._info = info

    @property
    def is_prepared(self) -> bool:
        """Whether the file is one of `photoncard prepare`."""
        return self._info is None

    @property
    def info(self) -> Mapping[str, Any]:
        """All that `photoncard scene info --json` states of the file."""
        if self._info is None:
            raise Error(
                f"the contents of {self.path} are not known", "load the glTF file that it was prepared from"
            )
        return self._info

    @property
    def lights(self) -> list[dict[str, Any]]:
        """Point, spot and directional lights of the file. Emissive surfaces have materials."""
        return list(self.info["lights"])

    @property
    def cameras(self) -> list[dict[str, Any]]:
        """Cameras of the file."""
        return list(self.info["cameras"])

    @property
    def materials(self) -> list[dict[str, Any]]:
        """Materials of the file."""
        return list(self.info["materials"])

    @property
    def names(self) -> list[str]:
        """Names that have properties to set."""
        named = [item["name"] for item in [*self.info["lights"], *self.info["materials"]]]
        return list(dict.fromkeys([*named, "environment"]))

    def __getitem__(self, name: str) -> Item:
        """The lights and materials of a name, or `environment`.

        >>> scene = load("scenes/room.glb")
        >>> scene["lamp"].emission
        (14.0, 12.0, 9.5)
        >>> scene["lamp"].emission = 28, 24, 19
        >>> scene
        <scene room.glb: 0 lights, 11 materials, 1 camera, lamp.emission=28,24,19>
        """
        if name not in self.names:
            raise UnknownName(
                f"{self.path.name} has no {name!r}", f"there are {known_names(name, self.names, 99)}"
            )
        return Item(self, name)

    def _ipython_key_completions_(self) -> list[str]:
        return self.names

    def reset(self) -> None:
        """Takes back all assignments."""
        self.assignments.clear()

    def _set(self) -> list[str]:
        return [f"{name}.{of}={value_text(value)}" for (name, of), value in self.assignments.items()]

    def stated(self, options: Mapping[str, Any]) -> dict[str, Any]:
        """Options of a command on this scene: the scene's, its assignments, and `options`."""
        stated = {**self.options, **options}
        more = stated.pop("set", None)
        added = (
            [f"{name}={value_text(value)}" for name, value in more.items()]
            if isinstance(more, Mapping)
            else more
        )
        added = [added] if isinstance(added, str) else list(added or [])
        if self._set() or added:
            stated["set"] = [*self._set(), *added]
        if self.is_prepared:
            stated["prepared"] = True
        return stated

    def render(
        self,
        size: Union[None, int, str, tuple[int, int]] = None,
        quality: Optional[str] = None,
        camera: Union[None, str, Mapping[str, Any]] = None,
        aov: Union[None, str, Sequence[str]] = None,
        *,
        progress: ProgressOption = None,
        **options: Any,
    ) -> Picture:
        """Renders a picture.

        Every option of `photoncard render` is a keyword, with underscores in place of dashes: sequences are
        values with commas, or options that are repeated, and True is a switch. `size` is `(width, height)`,
        the longer side, or a text such as `"1080p"`; `camera` a name or one of `cameras`. `output` keeps the
        files, beside which `resume` and `keep_samples` keep tiles and samples. `progress` is a function that
        gets each :class:`Progress`, or False.

        >>> picture = load("scenes/cornell.gltf").render((32, 32), "draft", aov=["indirect"], photons=2000)
        >>> picture.image.shape, picture.layers
        ((32, 32, 3), ('indirect',))

        Raises:
            Error: if the render fails.
            KeyboardInterrupt: after an interrupt, once the command has ended.
        """
        name = camera["name"] if isinstance(camera, Mapping) else camera
        own = {"size": size, "quality": quality, "camera": name, "aov": aov}
        [picture] = render(self.path, self.stated({**own, **options}), progress)
        return picture

    def animate(
        self, frames: Union[str, Sequence[int]], *, progress: ProgressOption = None, **options: Any
    ) -> list[Picture]:
        """Renders frames of the scene's animations, such as `"1-24"` or `[1, 12]`. Options are those of
        :meth:`render`.
        """
        return render(self.path, {**self.stated(options), "frames": frames}, progress)

    def __repr__(self) -> str:
        if self._info is None:
            return f"<prepared scene {self.path.name}>"
        counts = [
            f"{len(self._info[kind])} {kind[:-1] if len(self._info[kind]) == 1 else kind}"
            for kind in ("lights", "materials", "cameras")
        ]
        return f"<scene {self.path.name}: {', '.join([*counts, *self._set()])}>"


class Item:
    """Lights and materials of one name. Attributes are properties that may be set; those of the file are read
    from the first light or material of the name.
    """

    _scene: Scene
    _name: str

    def __init__(self, scene: Scene, name: str) -> None:
        object.__setattr__(self, "_scene", scene)
        object.__setattr__(self, "_name", name)

    def _properties(self) -> dict[str, tuple[int, ...]]:
        known: dict[str, tuple[int, ...]] = {}
        for items, properties in ((self._scene.lights, _LIGHT), (self._scene.materials, _MATERIAL)):
            if any(item["name"] == self._name for item in items):
                known |= properties
        return known | (_ENVIRONMENT if self._name == "environment" else {})

    def _counts(self, of: str) -> tuple[int, ...]:
        known = self._properties()
        if of not in known:
            raise UnknownProperty(
                f"{self._name!r} has no {of!r} to set", f"there are {known_names(of, known)}"
            )
        return known[of]

    def __setattr__(self, of: str, value: Value) -> None:
        counts = self._counts(of)
        count = len(value) if is_sequence(value) else 1  # type: ignore[arg-type]
        numbers = value if is_sequence(value) else [value]
        if counts and (count not in counts or not all(is_number(number) for number in numbers)):  # type: ignore
            form = " or ".join({1: "a number", 3: "three numbers"}[count] for count in counts)
            raise Error(f"{self._name}.{of} is {form}, not {value!r}", f"set {form}")
        self._scene.assignments[self._name, of] = value

    def __getattr__(self, of: str) -> Any:
        if of.startswith("_"):
            raise AttributeError(of)
        self._counts(of)
        assigned = self._scene.assignments.get((self._name, of))
        return self._stated().get(of) if assigned is None else assigned

    def __delattr__(self, of: str) -> None:
        self._counts(of)
        self._scene.assignments.pop((self._name, of), None)

    def _stated(self) -> dict[str, Any]:
        """Values that the file states."""
        stated: dict[str, Any] = {}
        for material in self._scene.materials[::-1]:
            if material["name"] == self._name:
                stated |= _material(material)
        for light in self._scene.lights[::-1]:
            if light["name"] == self._name:
                stated |= _light(light)
        return stated

    def __dir__(self) -> list[str]:
        return list(self._properties())

    def __repr__(self) -> str:
        values = [f"{of}={getattr(self, of)}" for of in self._properties()]
        return f"<{self._name}: {', '.join(values)}>"


def _tuple(value: Any) -> Any:
    return tuple(value) if isinstance(value, list) else value


def _material(stated: Mapping[str, Any]) -> dict[str, Any]:
    values = {**stated, **stated["reflection"]}
    values["diffuse"] = values.get("diffuse", values.get("base_colour"))
    return {of: _tuple(values[of]) for of in _MATERIAL if of in values}


def _light(stated: Mapping[str, Any]) -> dict[str, Any]:
    greatest = max(stated["intensity"])
    colour = tuple(channel / greatest for channel in stated["intensity"]) if greatest > 0 else (1.0, 1.0, 1.0)
    position = _tuple(stated["at"])
    return {"colour": colour, "intensity": greatest, "position": position, "angle": stated["angle_degrees"]}
