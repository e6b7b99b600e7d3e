"""Baked values of a material on a part of a mesh."""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np

from ..baking import Baked, BakeJob
from .nodes import Path
from .value import Mapping, Value

BAKED_UVS = "photoncard baked"
"""Name of the texture coordinates of baked images."""
_MAPPING = Mapping(BAKED_UVS, wrap="EXTEND")


@dataclass(frozen=True)
class PartBake:
    """What a job has made of a part."""

    job: BakeJob
    baked: Baked

    def values(self) -> dict[Path, Value]:
        """Values by their inputs."""
        return {path: self._value(number) for number, path in enumerate(self.job.inputs)}

    def _value(self, number: int) -> Value:
        colours = self.baked.image(number)
        alpha = np.ones((*colours.shape[:2], 1), np.float32)
        return Value(np.concatenate([colours, alpha], axis=2), _MAPPING)
