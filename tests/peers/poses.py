"""Evaluates a glTF scene at a moment of an animation by the text of glTF 2.0, and compares its triangles with those on standard input.

    poses SCENE SECONDS ANIMATION | python3 poses.py SCENE SECONDS ANIMATION

Of the format it knows what poses depend on: nodes, animations, skins and morph targets, and meshes of triangle lists. Triangles that the
input lacks must be of zero area."""

import base64
import json
import math
import struct
import sys

KINDS = {"SCALAR": 1, "VEC2": 2, "VEC3": 3, "VEC4": 4, "MAT4": 16}
COMPONENTS = {5120: ("b", 127), 5121: ("B", 255), 5122: ("h", 32767), 5123: ("H", 65535), 5125: ("I", 1), 5126: ("f", 1)}
TOLERANCE = 2e-6


def read(path):
    with open(path, "rb") as file:
        data = file.read()
    if data[:4] != b"glTF":
        return json.loads(data), None
    length = struct.unpack_from("<I", data, 12)[0]
    return json.loads(data[20 : 20 + length]), data[28 + length :]


def buffer(document, index, binary, folder):
    uri = document["buffers"][index].get("uri")
    if uri is None:
        return binary
    if uri.startswith("data:"):
        return base64.b64decode(uri.split(",", 1)[1])
    with open(f"{folder}/{uri}", "rb") as file:
        return file.read()


class Scene:
    def __init__(self, path):
        self.document, binary = read(path)
        folder = path.rpartition("/")[0] or "."
        self.buffers = [buffer(self.document, i, binary, folder) for i in range(len(self.document["buffers"]))]
        self.cache = {}

    def elements(self, view, offset, count, component, width, normalized=False):
        view = self.document["bufferViews"][view]
        code, whole = COMPONENTS[component]
        size = struct.calcsize("<" + code) * width
        stride = view.get("byteStride", size)
        start = view.get("byteOffset", 0) + offset
        data = self.buffers[view["buffer"]]
        rows = [struct.unpack_from(f"<{width}{code}", data, start + i * stride) for i in range(count)]
        return [[max(x / whole, -1.0) for x in row] if normalized else list(row) for row in rows]

    def accessor(self, index, fractions=False):
        key = (index, fractions)
        if key not in self.cache:
            stated = self.document["accessors"][index]
            width, component, count = KINDS[stated["type"]], stated["componentType"], stated["count"]
            normalized = component != 5126 and (fractions or stated.get("normalized", False))
            rows = [[0.0] * width for _ in range(count)]
            if "bufferView" in stated:
                rows = self.elements(stated["bufferView"], stated.get("byteOffset", 0), count, component, width, normalized)
            if "sparse" in stated:
                sparse = stated["sparse"]
                where, what = sparse["indices"], sparse["values"]
                places = self.elements(where["bufferView"], where.get("byteOffset", 0), sparse["count"], where["componentType"], 1)
                values = self.elements(what["bufferView"], what.get("byteOffset", 0), sparse["count"], component, width, normalized)
                for (place,), value in zip(places, values):
                    rows[place] = value
            self.cache[key] = rows
        return self.cache[key]


def slerp(a, b, t):
    """By angle and axis: the rotation from a to b, times t, after a."""
    (x, y, z, w), (p, q, r, s) = a, b
    # b * conjugate(a)
    turn = [s * -x + p * w + q * -z - r * -y, s * -y - p * -z + q * w + r * -x, s * -z + p * -y - q * -x + r * w, s * w + p * x + q * y + r * z]
    if turn[3] < 0:
        turn = [-value for value in turn]
    length = math.sqrt(sum(value * value for value in turn[:3]))
    angle = math.atan2(length, turn[3]) * t
    axis = [value / length if length else 0.0 for value in turn[:3]]
    i, j, k = (value * math.sin(angle) for value in axis)
    m = math.cos(angle)
    return [m * x + i * w + j * z - k * y, m * y - i * z + j * w + k * x, m * z + i * y - j * x + k * w, m * w - i * x - j * y - k * z]


def unit(q):
    length = math.sqrt(sum(value * value for value in q))
    return [value / length for value in q]


def sampled(scene, sampler, path, elements, seconds):
    times = [row[0] for row in scene.accessor(sampler["input"])]
    rows = scene.accessor(sampler["output"], path in ("rotation", "weights"))
    kind = sampler.get("interpolation", "LINEAR")
    of_each = 3 if kind == "CUBICSPLINE" else 1

    def value(key, part=0):
        begin = (key * of_each + part) * elements
        return [number for row in rows[begin : begin + elements] for number in row]

    middle = 1 if of_each == 3 else 0
    if seconds <= times[0]:
        return value(0, middle)
    if seconds >= times[-1]:
        return value(len(times) - 1, middle)
    key = max(i for i, time in enumerate(times) if time <= seconds)
    delta = times[key + 1] - times[key]
    t = (seconds - times[key]) / delta
    if kind == "STEP":
        return value(key)
    if kind == "LINEAR":
        if path == "rotation":
            return slerp(unit(value(key)), unit(value(key + 1)), t)
        return [a + (b - a) * t for a, b in zip(value(key), value(key + 1))]
    terms = zip(value(key, 1), value(key, 2), value(key + 1, 1), value(key + 1, 0))
    return [
        (2 * t**3 - 3 * t**2 + 1) * v + delta * (t**3 - 2 * t**2 + t) * b + (3 * t**2 - 2 * t**3) * w + delta * (t**3 - t**2) * a
        for v, b, w, a in terms
    ]


def times(a, b):
    """Product of two matrices, lists of columns."""
    return [[sum(a[k][row] * column[k] for k in range(4)) for row in range(4)] for column in b]


def placed(matrix, point):
    return [sum(matrix[k][row] * point[k] for k in range(3)) + matrix[3][row] for row in range(3)]


def composed(t, q, s):
    x, y, z, w = unit(q)
    columns = [
        [1 - 2 * (y * y + z * z), 2 * (x * y + z * w), 2 * (x * z - y * w)],
        [2 * (x * y - z * w), 1 - 2 * (x * x + z * z), 2 * (y * z + x * w)],
        [2 * (x * z + y * w), 2 * (y * z - x * w), 1 - 2 * (x * x + y * y)],
    ]
    return [[value * scale for value in column] + [0.0] for column, scale in zip(columns, s)] + [list(t) + [1.0]]


def columns(numbers):
    return [list(numbers[4 * i : 4 * i + 4]) for i in range(4)]


def triangles(scene, animation, seconds):
    document = scene.document
    nodes = [dict(node) for node in document["nodes"]]
    for channel in animation["channels"]:
        node, path = channel["target"]["node"], channel["target"]["path"]
        elements = 1
        if path == "weights":
            elements = len(document["meshes"][nodes[node]["mesh"]]["primitives"][0]["targets"])
        nodes[node][path] = sampled(scene, animation["samplers"][channel["sampler"]], path, elements, seconds)
    worlds, order = {}, []

    def walk(index, parent):
        node = nodes[index]
        if "matrix" in node:
            local = columns(node["matrix"])
        else:
            local = composed(node.get("translation", [0] * 3), node.get("rotation", [0, 0, 0, 1]), node.get("scale", [1] * 3))
        worlds[index] = times(parent, local)
        order.append(index)
        for child in node.get("children", []):
            walk(child, worlds[index])

    for root in document["scenes"][document.get("scene", 0)]["nodes"]:
        walk(root, composed([0] * 3, [0, 0, 0, 1], [1] * 3))
    for index in order:
        node = nodes[index]
        if "mesh" not in node:
            continue
        mesh = document["meshes"][node["mesh"]]
        weights = node.get("weights", mesh.get("weights", []))
        joints = None
        if "skin" in node:
            skin = document["skins"][node["skin"]]
            inverse = scene.accessor(skin["inverseBindMatrices"])
            joints = [times(worlds[joint], columns(matrix)) for joint, matrix in zip(skin["joints"], inverse)]
        for primitive in mesh["primitives"]:
            yield from of_primitive(scene, primitive, weights, worlds[index], joints)


def of_primitive(scene, primitive, weights, world, joints):
    attributes = primitive["attributes"]
    places = [list(row) for row in scene.accessor(attributes["POSITION"])]
    for target, weight in zip(primitive.get("targets", []), weights):
        if "POSITION" in target and weight:
            for place, row in zip(places, scene.accessor(target["POSITION"])):
                place[:] = [a + weight * b for a, b in zip(place, row)]
    if joints is not None and "JOINTS_0" in attributes:
        rows = zip(places, scene.accessor(attributes["JOINTS_0"]), scene.accessor(attributes["WEIGHTS_0"], True))
        corners = []
        for place, indices, shares in rows:
            moved = [(share, placed(joints[index], place)) for index, share in zip(indices, shares) if share]
            total = sum(share for share, _ in moved)
            corners.append([sum(share * point[axis] for share, point in moved) / total for axis in range(3)])
    else:
        corners = [placed(world, place) for place in places]
    indices = range(len(corners))
    if "indices" in primitive:
        indices = [row[0] for row in scene.accessor(primitive["indices"])]
    assert primitive.get("mode", 4) == 4, "triangle lists alone"
    for i in range(0, len(indices) - 2, 3):
        yield [corners[index] for index in indices[i : i + 3]]


def doubled_area(corners):
    a, b, c = corners
    u, v = [y - x for x, y in zip(a, b)], [y - x for x, y in zip(a, c)]
    return math.hypot(u[1] * v[2] - u[2] * v[1], u[2] * v[0] - u[0] * v[2], u[0] * v[1] - u[1] * v[0])


def main():
    path, seconds, name = sys.argv[1], float(sys.argv[2]), sys.argv[3]
    scene = Scene(path)
    animation = next(clip for clip in scene.document["animations"] if clip.get("name") == name)
    found = [[float(number) for number in line.split()] for line in sys.stdin]
    found = [[row[0:3], row[3:6], row[6:9]] for row in found]
    expected = list(triangles(scene, animation, seconds))
    extent = max(abs(number) for corners in expected for corner in corners for number in corner)
    worst, next_found, left_out = 0.0, 0, 0
    for corners in expected:
        distance = math.inf
        if next_found < len(found):
            distance = max(math.dist(a, b) for a, b in zip(found[next_found], corners)) / extent
        if distance <= TOLERANCE:
            worst, next_found = max(worst, distance), next_found + 1
        elif doubled_area(corners) <= TOLERANCE * extent * extent:
            left_out += 1
        else:
            sys.exit(f"{path} {name} at {seconds} s: triangle {next_found} is {distance:.2e} of the extent away")
    if next_found != len(found):
        sys.exit(f"{path} {name} at {seconds} s: {len(found) - next_found} triangles more than expected")
    print(f"ok  {name} at {seconds} s: {len(found)} triangles ({left_out} left out), {worst:.1e} of the extent")


main()
