"""What a segmentation says: the label of each point, the rocks, the ground."""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np
import numpy.typing as npt

from rover_iface.placement.cloud import Array
from rover_iface.placement.ground_plane import GroundPlane, GroundSurface

Index = npt.NDArray[np.int64]

GROUND = -1
"""Label of ground points."""


@dataclass(frozen=True, eq=False)
class RockSegment:
    """One rock of a segmentation, in the frame of the cloud.

    Attributes
    ----------
    label
        Its number, as in `Segmentation.labels`.
    centroid
        (3,), mean of its points.
    extent_m
        Length and width of its points along the ground.
    height_m
        Of its highest points over the ground.
    outline
        (k, 3), corners of the convex outline of its footprint, on the ground, counter-clockwise.
    points
        How many points are its own.
    gain
        Log-likelihood by which it beats ground as an explanation of its points, less the cost of its
        parameters; positive.
    """

    label: int
    centroid: Array
    extent_m: tuple[float, float]
    height_m: float
    outline: Array
    points: int
    gain: float


@dataclass(frozen=True, eq=False)
class Segmentation:
    """What each point of a cloud is.

    Attributes
    ----------
    labels
        (n,), -1 ground, otherwise index into `rocks`.
    rock_probability
        (n,), 0..1.
    height_m
        (n,), over the ground.
    rocks
        The nearest to the eye first.
    ground
        None when no plane was found; then every label is -1.
    roughness_m
        Deviation of the ground from its surface.
    log_likelihood
        Of all points under the mixture, each patch counted once.
    rounds
        Turns of expectation and maximisation.
    """

    labels: Index
    rock_probability: Array
    height_m: Array
    rocks: tuple[RockSegment, ...]
    ground: GroundSurface | None
    roughness_m: float
    log_likelihood: float
    rounds: int

    @property
    def plane(self) -> GroundPlane | None:
        """Return the ground plane."""
        return None if self.ground is None else self.ground.plane
