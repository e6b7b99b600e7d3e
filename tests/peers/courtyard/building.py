"""Walls, floors, arcades, vaults and roof of the courtyard, in metres."""

import math

import numpy as np

from parts import add, bake, body, box, copies, empty, join, modify, project, rod, sheet, turned

# The court is the rectangle between the columns, whose distance is a bay; galleries go round it.
BAY, COURT, GALLERY = 3.0, (10.5, 4.5), 3.2
OUTER = tuple(half + GALLERY for half in COURT)
# Heights: springs of the arches, floor of the upper storey, its ceiling.
SPRING, UPPER, UPPER_SPRING, ROOF = 3.2, 5.2, 7.7, 9.6
SLAB = 0.4
ARCH = 1.2
HALF_TURN = math.pi


def places(height):
    """Places of columns without the corners, and their angles."""
    x, y = COURT
    along, across = np.arange(-7.5, 7.6, BAY), np.arange(-1.5, 1.6, BAY)
    return (
        [((a, -y, height), 0.0) for a in along]
        + [((a, y, height), HALF_TURN) for a in along]
        + [((-x, a, height), -HALF_TURN / 2) for a in across]
        + [((x, a, height), HALF_TURN / 2) for a in across]
    )


def bays(height):
    """Middles of the bays of the arcades, and their angles."""
    along, across = np.arange(-9.0, 9.1, BAY), np.arange(-3.0, 3.1, BAY)
    return (
        [((a, -COURT[1], height), 0.0) for a in along]
        + [((a, COURT[1], height), HALF_TURN) for a in along]
        + [((-COURT[0], a, height), -HALF_TURN / 2) for a in across]
        + [((COURT[0], a, height), HALF_TURN / 2) for a in across]
    )


def sides():
    """The sides of the court: the angle of what looks into it, half the length, and the middle."""
    x, y = COURT
    return (0.0, x, 0.0, -y), (HALF_TURN / 2, y, x, 0.0), (HALF_TURN, x, 0.0, y), (-HALF_TURN / 2, y, -x, 0.0)


def ends():
    """The corners of the court."""
    return [(a * COURT[0], b * COURT[1]) for a in (-1, 1) for b in (-1, 1)]


def shell(surfaces):
    """Floor, walls and ceiling of few large triangles, seen from inside alone."""
    x, y = OUTER
    sheet("floor", [(-x, -y, 0), (x, -y, 0), (x, y, 0), (-x, y, 0)], surfaces["paving"])
    for name, low, high in (("lower", 0.0, UPPER - SLAB), ("upper", UPPER, ROOF)):
        surface = surfaces["masonry" if name == "lower" else "plaster"]
        for a, b in ((-x, y), (x, y)), ((x, -y), (-x, -y)), ((x, y), (x, -y)), ((-x, -y), (-x, y)):
            sheet(f"{name} wall", [(*a, low), (*b, low), (*b, high), (*a, high)], surface)


def rings(surfaces):
    """The slab between the storeys and the roof, each around the opening, with cornices."""
    for name, low, surface in (("slab", UPPER - SLAB, "paving"), ("roof", ROOF, "wood")):
        x, y = OUTER
        a, b = COURT[0] - 0.32, COURT[1] - 0.32
        high = low + SLAB
        parts = [((-x, -y), (x, -b)), ((-x, b), (x, y)), ((-x, -b), (-a, b)), ((a, -b), (x, b))]
        for start, end in parts:
            box(name, (*start, low), (*end, high), surfaces[surface])
        for drop, radius in ((0.0, 0.09), (0.16, 0.06), (-0.4, 0.07)):
            line = [(-a, -b), (a, -b), (a, b), (-a, b)]
            rod("cornice", [(*point, low - drop) for point in line], radius, surfaces["marble"], is_cyclic=True, sides=4)
    for angle, length, x, y in sides():
        tile(surfaces["roof"], round(2 * length / 0.3), (x, y, ROOF + SLAB + 0.3), angle)


def tile(surface, count, position, angle):
    """A row of roof tiles, two deep, by arrays."""
    arc = np.linspace(0.0, HALF_TURN, 7)
    vertices = [(0.15 * math.cos(a), y, 0.12 * math.sin(a) + 0.35 * (0.0 - y)) for y in (0.35, -0.35) for a in arc]
    faces = [(i, i + 1, i + 8, i + 7) for i in range(6)]
    one = bake(modify(body("tile", vertices, faces, surface), "SOLIDIFY", thickness=0.03), project)
    modify(one, "ARRAY", count=count, use_relative_offset=False, use_constant_offset=True, constant_offset_displace=(0.3, 0.0, 0.0))
    group = empty("tiles", position, angle)
    one.parent = group
    one.location = (-0.15 * (count - 1), 0.1, 0.0)


def columns(surfaces):
    """Round columns with capitals in both storeys, and piers in the corners."""
    swell = [(0.255 + 0.035 * math.sin(math.pi * (0.62 - 0.5 * t)), 0.50 + 2.05 * t) for t in np.linspace(0.0, 1.0, 9)]
    low = [
        (0.0, 0.12), (0.40, 0.12), (0.43, 0.17), (0.44, 0.22), (0.42, 0.27), (0.36, 0.29), (0.33, 0.33),
        (0.34, 0.38), (0.38, 0.40), (0.38, 0.44), (0.31, 0.46),
    ]
    top = [(0.30, 2.57), (0.31, 2.61), (0.28, 2.64), (0.27, 2.72), (0.29, 2.84), (0.36, 2.94), (0.42, 2.98), (0.0, 2.98)]
    column = [turned("column", low + swell + top, 28, surfaces["marble"]), *capital(surfaces["marble"], 0.30, 2.62, 8)]
    column.append(box("plinth", (-0.46, -0.46, 0.0), (0.46, 0.46, 0.12), surfaces["ashlar"], 0.02))
    column.append(box("abacus", (-0.45, -0.45, 2.98), (0.45, 0.45, SPRING), surfaces["marble"], 0.04, 4))
    copies(join("column", column), places(0.0), empty("lower columns"))
    slim = [
        (0.0, 0.0), (0.27, 0.0), (0.27, 0.08), (0.24, 0.14), (0.19, 0.18), (0.18, 0.6), (0.17, 1.2),
        (0.155, 1.9), (0.19, 1.94), (0.16, 1.99), (0.19, 2.15), (0.28, 2.28), (0.0, 2.28),
    ]
    upper = [turned("upper column", slim, 24, surfaces["plaster"]), *capital(surfaces["plaster"], 0.18, 1.98, 6)]
    upper.append(box("abacus", (-0.3, -0.3, 2.28), (0.3, 0.3, UPPER_SPRING - UPPER), surfaces["plaster"], 0.03, 3))
    copies(join("upper column", upper), places(UPPER), empty("upper columns"))
    for x, y in ends():
        box("pier", (x - 0.45, y - 0.45, 0.0), (x + 0.45, y + 0.45, UPPER - SLAB), surfaces["ashlar"], 0.05, 3)
        box("upper pier", (x - 0.32, y - 0.32, UPPER), (x + 0.32, y + 0.32, ROOF), surfaces["plaster"], 0.04, 3)


def capital(surface, radius, height, count):
    """Bent leaves around the head of a column, subdivided."""
    result = []
    for index in range(count):
        angle = 2 * math.pi * (index + 0.5) / count
        rows = [(0.02, 0.0, 0.055), (0.025, 0.13, 0.065), (0.07, 0.25, 0.06), (0.14, 0.29, 0.02)]
        vertices = []
        for out, up, half in rows:
            for side in (-half, 0.0, half):
                r = radius + out + (0.012 if side == 0.0 else 0.0)
                vertices.append((r * math.cos(angle) - side * math.sin(angle), r * math.sin(angle) + side * math.cos(angle), height + up))
        faces = [(3 * i + j, 3 * i + j + 1, 3 * i + j + 4, 3 * i + j + 3) for i in range(3) for j in range(2)]
        leaf = modify(body("leaf", vertices, faces, surface), "SOLIDIFY", thickness=0.02)
        result.append(bake(modify(leaf, "SUBSURF", levels=1, render_levels=1), project))
    return result


def arcades(surfaces):
    """Walls with a round arch, of one polygon each side, with bevels and mouldings."""
    for name, spring, top, surface, thickness in (
        ("arch", SPRING, UPPER - SLAB, surfaces["ashlar"], 0.6),
        ("upper arch", UPPER_SPRING, ROOF, surfaces["plaster"], 0.45),
    ):
        arc = [(ARCH * math.cos(a), ARCH * math.sin(a)) for a in np.linspace(HALF_TURN, 0.0, 25)]
        outline = [(-BAY / 2, 0.0), *arc, (BAY / 2, 0.0), (BAY / 2, top - spring), (-BAY / 2, top - spring)]
        wall = body(name, [(x, 0.0, z) for x, z in outline], [tuple(range(len(outline)))], surface)
        modify(wall, "SOLIDIFY", thickness=thickness, offset=0.0)
        bake(modify(wall, "BEVEL", width=0.02, segments=2, limit_method="ANGLE"), project)
        copies(wall, bays(spring), empty(f"{name}es"))
        moulding = [((ARCH + 0.07) * math.cos(a), thickness / 2, (ARCH + 0.07) * math.sin(a)) for a in np.linspace(HALF_TURN, 0.0, 19)]
        copies(rod(f"{name} moulding", moulding, 0.06, surfaces["marble"], sides=1), bays(spring), empty(f"{name} mouldings"))
    # A frieze between the storeys, around the court.
    for angle, half, x, y in sides():
        frieze(surfaces["marble"], half - 0.45, abs(x + y) - 0.33).parent = empty("frieze", angle=angle)


def frieze(surface, half, distance):
    """A band of waves and leaves in relief."""
    x, z = np.meshgrid(np.linspace(-half, half, round(12 * half) + 1), np.linspace(0.0, 0.34, 8))
    wave = np.sin(2 * np.pi * x / 0.75) * 0.08 + 0.17
    relief = 0.05 * np.exp(-(((z - wave) / 0.035) ** 2)) + 0.04 * np.exp(-((((x % 0.375) - 0.19) / 0.05) ** 2 + ((z - 0.34 + wave) / 0.06) ** 2))
    relief[0] = relief[-1] = -0.06
    return grid("frieze", np.dstack([x, -distance + relief, z + UPPER - 0.38]), surface, is_flipped=True)


def grid(name, points, surface, is_flipped=False):
    """A smooth surface through rows of points."""
    rows, columns = points.shape[:2]
    numbers = np.arange(rows * columns).reshape(rows, columns)
    faces = np.stack([numbers[:-1, :-1], numbers[:-1, 1:], numbers[1:, 1:], numbers[1:, :-1]], axis=-1).reshape(-1, 4)
    faces = faces[:, ::-1] if is_flipped else faces
    return bake(body(name, points.reshape(-1, 3), faces.tolist(), surface), project, is_closed=False)


def vaults(surfaces):
    """Groin vaults over the lower galleries, and beams over the upper ones."""
    u, v = np.meshgrid(np.linspace(-1.0, 1.0, 15), np.linspace(-1.0, 1.0, 15))
    rise = 1.45 * np.maximum(np.sqrt(np.maximum(1.0 - u**2, 0.0)), np.sqrt(np.maximum(1.0 - v**2, 0.0)))
    depth = GALLERY / 2
    middle = [((x + depth * math.sin(angle), y - depth * math.cos(angle), z), angle) for (x, y, z), angle in bays(SPRING)]
    vault = grid("vault", np.dstack([u * BAY / 2, v * depth, rise]), surfaces["plaster"], is_flipped=True)
    copies(vault, middle, empty("vaults"))
    corner = grid("corner vault", np.dstack([u * depth, v * depth, rise]), surfaces["plaster"], is_flipped=True)
    copies(corner, [((math.copysign(abs(x) + depth, x), math.copysign(abs(y) + depth, y), SPRING), 0.0) for x, y in ends()], empty("corner vaults"))
    beam = box("beam", (-0.08, 0.0, ROOF - 0.24), (0.08, GALLERY, ROOF), surfaces["wood"], 0.015, 1)
    group = empty("beams")
    side = [((x, -OUTER[1], 0.0), 0.0) for x in np.arange(-12.75, 13.0, 0.75)]
    copies(beam, side + [((-x, OUTER[1], 0.0), HALF_TURN) for (x, _, _), _ in side], group)


def balustrades(surfaces):
    """Turned balusters in arrays between bevelled rails."""
    profile = [
        (0.0, 0.10), (0.055, 0.10), (0.06, 0.16), (0.035, 0.20), (0.062, 0.32), (0.055, 0.40), (0.03, 0.55),
        (0.04, 0.64), (0.055, 0.68), (0.0, 0.68),
    ]
    baluster = turned("baluster", profile, 8, surfaces["marble"])
    data = baluster.data
    for index, (position, angle) in enumerate(bays(UPPER)):
        row = baluster if index == 0 else add("baluster", data)
        group = empty("balustrade", position, angle)
        modify(row, "ARRAY", count=9, use_relative_offset=False, use_constant_offset=True, constant_offset_displace=(0.28, 0.0, 0.0))
        row.parent, row.location = group, (-1.12, 0.0, 0.0)
    for name, low, high, half in (("rail", 0.68, 0.80, 0.10), ("foot", 0.0, 0.10, 0.08)):
        rail = box(name, (-1.35, -half, low), (1.35, half, high), surfaces["marble"], 0.02, 3)
        copies(rail, bays(UPPER), empty(f"{name}s"))


PARTS = (shell, rings, columns, arcades, vaults, balustrades)
