"""Brightness of lights as Cycles renders them, in radiometric units. Knows nothing of Blender's API."""

from __future__ import annotations

import math

WIDEST_SPOT = math.pi / 2


def point_intensity(power: float, radius: float, is_normalized: bool = True) -> float:
    """Radiant intensity, W/sr, of a point or spot light of `power` watts.

    A light that is not normalized has the radiance of one whose sphere has 1 m^2.
    """
    intensity = power / (4 * math.pi)
    if is_normalized or radius <= 0:
        return intensity
    return intensity * 4 * math.pi * radius**2


def sun_irradiance(strength: float, angle: float, is_normalized: bool = True) -> float:
    """Irradiance, W/m^2, of a sun whose disk is `angle` radians across."""
    if is_normalized or angle <= 0:
        return strength
    return strength * math.pi * math.tan(angle / 2) ** 2


def area_radiance(power: float, area: float, is_normalized: bool = True) -> float:
    """Radiance, W/(sr m^2), of an area light of `area` m^2."""
    return power / (math.pi * (area if is_normalized else 1.0))


def ellipse_or_rectangle(width: float, height: float, is_ellipse: bool) -> float:
    """Area, m^2."""
    return width * height * (math.pi / 4 if is_ellipse else 1.0)


def spot_cones(size: float, blend: float) -> tuple[float, float]:
    """Inner and outer cone angles of glTF, radians, of a spot light of the full angle `size`.

    Cycles' falloff is a smooth step of the cosine from 0 at `cos outer` to 1 at `cos outer + w`, where
    `w = blend (1 - cos outer)`: it loses the flux of `w / 2`. glTF's squared ramp of the width `v` loses
    `2 v / 3`. The inner cone has `v = 3 w / 4`, for equal flux.
    """
    outer = min(size / 2, WIDEST_SPOT)
    edge = math.cos(outer)
    return math.acos(min(edge + 0.75 * blend * (1 - edge), 1.0)), outer
