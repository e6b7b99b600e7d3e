"""A scene of Mitsuba's XML: triangles in world space, materials, emitters and the sensor, names resolved."""

import xml.etree.ElementTree as xml
from dataclasses import dataclass, field
from pathlib import Path

import mitsuba as mi
import numpy as np

mi.set_variant("llvm_ad_rgb")

# Corners of Mitsuba's rectangle, which faces +z, and their texture coordinates.
RECTANGLE = np.array([[-1.0, -1, 0], [1, -1, 0], [1, 1, 0], [-1, 1, 0]])
RECTANGLE_UV = np.array([[0.0, 0], [1, 0], [1, 1], [0, 1]])
QUAD = np.array([[0, 1, 2], [0, 2, 3]])


@dataclass
class Shape:
    """Triangles of one material; `normals` and `coordinates` may be absent."""

    name: str
    positions: np.ndarray
    corners: np.ndarray
    normals: np.ndarray | None
    coordinates: np.ndarray | None
    material: "Bsdf"
    radiance: np.ndarray | None


@dataclass
class Bsdf:
    """A material: its kind, what it is wrapped in, and its numbers, colours and paths of textures."""

    name: str
    kind: str
    is_twosided: bool = False
    opacity: object = None
    values: dict = field(default_factory=dict)


@dataclass
class Sensor:
    """A perspective camera: its matrix, the angle across the picture in degrees, and the picture's sides."""

    to_world: np.ndarray
    fov: float
    width: int
    height: int


class Scene:
    """What is read of a file. `emitters` are (kind, properties, matrix) of those without a shape."""

    def __init__(self, path):
        path = Path(path)
        self.folder = path.parent
        root = xml.parse(path).getroot()
        self.defaults = {item.get("name"): item.get("value") for item in root.findall("default")}
        self.materials = {}
        for item in root.findall("bsdf"):
            bsdf = self.bsdf(item)
            self.materials[identity(item) or bsdf.name] = bsdf
        self.shapes, self.missing = [], []
        for index, item in enumerate(root.findall("shape")):
            self.add(item, f"{item.get('type')} {index}")
        self.sensor = self.read_sensor(root.find("sensor"))
        self.emitters = [
            (item.get("type"), self.properties(item), matrix(item)) for item in root.findall("emitter")
        ]

    def properties(self, item):
        """Numbers, colours, words and textures right below an element, by their names."""
        values = {}
        for child in item:
            name, text = child.get("name"), child.get("value", "")
            text = self.defaults.get(text[1:], text) if text.startswith("$") else text
            if child.tag in ("float", "integer"):
                values[name] = float(text)
            elif child.tag == "boolean":
                values[name] = text == "true"
            elif child.tag in ("rgb", "spectrum"):
                numbers = [float(number) for number in text.replace(",", " ").split()]
                values[name] = np.array(numbers * 3 if len(numbers) == 1 else numbers)
            elif child.tag == "string":
                values[name] = text
            elif child.tag in ("vector", "point"):
                values[name] = np.array([float(child.get(axis, 0.0)) for axis in "xyz"])
            elif child.tag == "texture":
                values[name] = self.folder / self.properties(child)["filename"]
        return values

    def bsdf(self, item):
        """A material without what it is wrapped in."""
        kind, nested = item.get("type"), item.find("bsdf")
        if nested is None:
            return Bsdf(identity(item) or kind, kind, values=self.properties(item))
        bsdf = self.bsdf(nested)
        bsdf.name = identity(item) or bsdf.name
        if kind == "twosided":
            bsdf.is_twosided = True
        elif kind == "mask":
            bsdf.opacity = self.properties(item).get("opacity", np.ones(3) / 2.0)
        elif kind not in ("bumpmap", "normalmap"):
            raise ValueError(f"a '{kind}' is not read here")
        return bsdf

    def add(self, item, name):
        """Adds a shape, or its file to those that are missing."""
        properties, to_world = self.properties(item), matrix(item)
        if "filename" in properties:
            name = Path(properties["filename"]).stem
        if "shapeIndex" in properties:
            # Such a file has many meshes.
            name = identity(item) or f"{name} {properties['shapeIndex']:.0f}"
        if item.get("type") == "rectangle":
            positions, corners, normals, coordinates = RECTANGLE, QUAD, None, RECTANGLE_UV
        else:
            try:
                positions, corners, normals, coordinates = self.mesh(item.get("type"), properties)
            except FileNotFoundError:
                self.missing.append(name)
                return
        linear = to_world[:3, :3]
        positions = positions @ linear.T + to_world[:3, 3]
        if np.linalg.det(linear) < 0.0:
            corners = corners[:, ::-1]
        if properties.get("faceNormals") or normals is None:
            normals = None
        else:
            normals = normals @ np.linalg.inv(linear)
            normals = normals / np.maximum(np.linalg.norm(normals, axis=1, keepdims=True), 1e-12)
        emitter, reference = item.find("emitter"), item.find("ref")
        radiance = None if emitter is None else self.properties(emitter)["radiance"]
        material = self.bsdf(item.find("bsdf")) if reference is None else self.materials[reference.get("id")]
        self.shapes.append(Shape(name, positions, corners, normals, coordinates, material, radiance))

    def mesh(self, kind, properties):
        """Positions, corners, normals and texture coordinates of a mesh as Mitsuba reads it."""
        description = {"type": kind}
        if "filename" in properties:
            path = self.folder / properties["filename"]
            if not path.exists():
                raise FileNotFoundError(path)
            description["filename"] = str(path)
        if "shapeIndex" in properties:
            description["shape_index"] = int(properties["shapeIndex"])
        read = mi.traverse(mi.load_dict(description))
        normals, coordinates = (
            np.array(read[name]).reshape(-1, width) if name in read and len(read[name]) else None
            for name, width in (("vertex_normals", 3), ("vertex_texcoords", 2))
        )
        positions = np.array(read["vertex_positions"]).reshape(-1, 3).astype(np.float64)
        return positions, np.array(read["faces"]).reshape(-1, 3).astype(np.int64), normals, coordinates

    def read_sensor(self, item):
        """The sensor."""
        properties, film = self.properties(item), self.properties(item.find("film"))
        return Sensor(matrix(item), properties["fov"], int(film["width"]), int(film["height"]))


def identity(item):
    """The name of an element that others refer to."""
    return item.get("id")


def matrix(item):
    """The transform of an element; those after the first are applied after it."""
    result = np.eye(4)
    transform = next((child for child in item.findall("transform")), None)
    for step in [] if transform is None else transform:
        result = single(step) @ result
    return result


def single(step):
    """The matrix of one step of a transform."""
    values = [float(number) for number in step.get("value", "").replace(",", " ").split()]
    x, y, z = (float(step.get(axis, 1.0 if step.tag == "scale" else 0.0)) for axis in "xyz")
    if step.tag == "matrix":
        return np.array(values).reshape(4, 4)
    if step.tag == "translate":
        result = np.eye(4)
        result[:3, 3] = [x, y, z]
        return result
    if step.tag == "scale":
        return np.diag([*(values * 3 if values else [x, y, z]), 1.0])
    if step.tag == "rotate":
        turn = mi.ScalarTransform4f().rotate([x, y, z], float(step.get("angle")))
        return np.array(turn.matrix)
    if step.tag == "lookat":
        origin, target, up = (
            [float(number) for number in step.get(name).split(",")] for name in ("origin", "target", "up")
        )
        return np.array(mi.ScalarTransform4f().look_at(origin, target, up).matrix)
    raise ValueError(f"a transform '{step.tag}' is not read here")
