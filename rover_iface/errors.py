"""Errors of the rover and its world.

::

    RoverError
    |-- ProfileError              a rover profile is malformed or unknown
    |-- FrameError                frames do not chain, or a transform is not rigid
    |-- TerrainError
    |   |-- TerrainFormatError    a file cannot be used as terrain (no georeference, wrong shape, ...)
    |   `-- OutsideTerrainError   a point lies outside the terrain
    |-- CameraError
    |   `-- CameraLabelError      a label holds no usable camera model
    |-- PicturesError             pictures cannot become terrain: none is a pair, or none can be trusted
    |-- RenderError               an image cannot be made (camera below ground, target behind it)
    |-- PlacementError            no pose from which the instrument reaches the target
    |-- TrackerError              misuse of a tracker
    |-- WeightsError              a trained network's file is missing or is not what it should be
    |-- LocalizationError         rocks, poses or frame solutions cannot be used to localise the rover
    |-- WorldError                a world, fault or problem document is malformed
    |-- MappingError              a mapping to ROS 2 is malformed or contradicts its dictionary
    |-- RosError                  ROS 2, or a package of it, is not there
    `-- MissingExtraError         a package of an extra is not installed
"""

from __future__ import annotations


class RoverError(Exception):
    """Base of all errors of this room; the message names the thing, its value and the limit."""


class MissingExtraError(RoverError):
    """A package of an extra is not installed; the message says how to get it."""


class ProfileError(RoverError):
    """A rover profile is malformed or unknown."""


class FrameError(RoverError):
    """Frames do not chain, or a matrix is not a rotation."""


class TerrainError(RoverError):
    """Base of errors about terrain."""


class TerrainFormatError(TerrainError):
    """A file cannot be used as terrain."""


class OutsideTerrainError(TerrainError):
    """A point lies outside the terrain."""


class CameraError(RoverError):
    """Base of errors about cameras."""


class CameraLabelError(CameraError):
    """A label holds no usable camera model."""


class PicturesError(RoverError):
    """Pictures cannot become terrain; the message names each picture and what is wrong with it."""


class RenderError(RoverError):
    """An image cannot be made."""


class PlacementError(RoverError):
    """No pose from which the instrument reaches the target; `reasons` counts why candidates fell out."""

    def __init__(self, message: str, reasons: dict[str, int] | None = None) -> None:
        super().__init__(message)
        self.reasons = dict(reasons or {})


class TrackerError(RoverError):
    """A tracker is used out of order."""


class WeightsError(RoverError):
    """The file of a trained network is missing, too large, or is not one of its kind."""


class LocalizationError(RoverError):
    """Rocks, poses or frame solutions cannot be used to localise the rover."""


class WorldError(RoverError):
    """A world, fault or problem document is malformed."""


class MappingError(RoverError):
    """A mapping to ROS 2 is malformed, or contradicts its dictionary."""


class RosError(RoverError):
    """ROS 2 or one of its packages is not there, or has no such type or field."""
