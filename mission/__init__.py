"""The frozen values of a rover's day, their codec, and open sets of implementations: what all rooms share.

A leaf: every room but the executive may read it, it reads none of them.
"""

from mission.constraints import After, Constraint, MustDo, SunElevation, Tracked, Window
from mission.day import Day, DriveRule, KeepOut, Limits, Request, Target
from mission.errors import FormatError, MissionError, PluginError
from mission.geometry import Pose
from mission.instrument import Amount, Instrument, Use
from mission.sky import Sky, SunCourse
from mission.terrain_grid import TerrainGrid

__all__ = [
    "After",
    "Amount",
    "Constraint",
    "Day",
    "DriveRule",
    "FormatError",
    "Instrument",
    "KeepOut",
    "Limits",
    "MissionError",
    "MustDo",
    "PluginError",
    "Pose",
    "Request",
    "Sky",
    "SunCourse",
    "SunElevation",
    "Target",
    "TerrainGrid",
    "Tracked",
    "Use",
    "Window",
]
