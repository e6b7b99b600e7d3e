"""The light from infinitely far of a Mitsuba scene, as an equirectangular map as photoncard orients it."""

import mitsuba as mi
import numpy as np

# Rows and columns of the map, and directions of a texel along each.
HEIGHT, WIDTH, DIRECTIONS = 128, 256, 8
SUN_APERTURE = 0.5358


def bake(scene):
    """The sum of all such emitters, rows from the top; nothing if there are none."""
    pictures = [picture for emitter in scene.emitters if (picture := texels(scene, *emitter)) is not None]
    return sum(pictures) if pictures else None


def texels(scene, kind, properties, to_world):
    """The mean radiance of each texel."""
    radiance = {
        "constant": constant,
        "envmap": mapped,
        "sunsky": sun_and_sky,
        "sky": sun_and_sky,
        "sun": sun_and_sky,
    }.get(kind)
    if radiance is None:
        raise ValueError(f"light of the kind '{kind}' is not read here")
    total = np.zeros((HEIGHT, WIDTH, 3))
    lookup = radiance(scene, kind, properties)
    inverse = np.linalg.inv(to_world[:3, :3])
    for row in range(DIRECTIONS):
        for column in range(DIRECTIONS):
            place = np.array([row + 0.5, column + 0.5]) / DIRECTIONS
            total += lookup(directions(*place) @ inverse.T)
    return total / DIRECTIONS**2


def directions(row, column):
    """One direction in each texel, by the place within it: -z in the middle of the map, y at the top."""
    polar = (np.arange(HEIGHT) + row)[:, None] / HEIGHT * np.pi
    azimuth = ((np.arange(WIDTH) + column)[None, :] / WIDTH - 0.5) * 2.0 * np.pi
    sine = np.sin(polar)
    return np.stack([sine * np.sin(azimuth), np.cos(polar) + 0.0 * azimuth, -sine * np.cos(azimuth)], axis=-1)


def constant(_scene, _kind, properties):
    """Equal radiance from everywhere."""
    return lambda way: np.broadcast_to(properties["radiance"], way.shape)


def mapped(scene, _kind, properties):
    """A map, its texels taken as they are."""
    bitmap = mi.Bitmap(str(scene.folder / properties["filename"]))
    picture = np.array(
        bitmap.convert(mi.Bitmap.PixelFormat.RGB, mi.Struct.Type.Float32, False)
    ) * properties.get("scale", 1.0)

    def lookup(way):
        u = np.arctan2(way[..., 0], -way[..., 2]) / (2.0 * np.pi) % 1.0
        v = np.arccos(np.clip(way[..., 1], -1.0, 1.0)) / np.pi
        rows = np.minimum((v * picture.shape[0]).astype(int), picture.shape[0] - 1)
        return picture[rows, (u * picture.shape[1]).astype(int) % picture.shape[1]]

    return lookup


def sun_and_sky(_scene, kind, properties):
    """Mitsuba's model of the sky; its zenith is y in files of Mitsuba 0.6, and z in Mitsuba 3."""
    x, y, z = properties["sunDirection"]
    emitter = mi.load_dict(
        {
            "type": "sunsky",
            "sun_direction": [float(x), float(-z), float(y)],
            "turbidity": properties.get("turbidity", 3.0),
            "sky_scale": properties.get("skyScale", 1.0) if kind != "sun" else 0.0,
            "sun_scale": properties.get("sunScale", 1.0) if kind != "sky" else 0.0,
            "sun_aperture": SUN_APERTURE * properties.get("sunRadiusScale", 1.0),
        }
    )

    def lookup(way):
        point = mi.SurfaceInteraction3f()
        flat = way.reshape(-1, 3).astype(np.float32)
        point.wi = mi.Vector3f(-flat[:, 0], flat[:, 2], -flat[:, 1])
        return np.array(emitter.eval(point)).T.reshape(way.shape)

    return lookup
