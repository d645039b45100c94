"""What comes of asking whether the tool may be put on a point: one value, readable by a machine.

A verdict is never an exception: a cloud without points, a point beside the cloud, a rock too rough are
outcomes. Every finding names its reason, the value found and the limit.
"""

from __future__ import annotations

from dataclasses import dataclass, field
from enum import StrEnum

from rover_iface.frames import Pose
from rover_iface.placement.cloud import Array
from rover_iface.placement.segmentation import RockSegment


class Decision(StrEnum):
    """What to do: put the tool on the designated point, on a safe point near it, drive first, or do not."""

    PLACE = "place"
    PLACE_NEAR = "place-near"
    MOVE_BASE = "move-base"
    REFUSE = "refuse"


class Reason(StrEnum):
    """Why a point is not safe, or nothing can be placed. The value after each is what a file holds."""

    NO_POINTS = "no-points"
    NO_GROUND = "no-ground"
    OUTSIDE_CLOUD = "outside-cloud"
    NO_ROCK = "no-rock"
    FEW_POINTS = "few-points"
    STEREO_SHARE = "stereo-share"
    STEREO_HOLE = "stereo-hole"
    VIEW_ANGLE = "view-angle"
    PROTRUSION = "protrusion"
    ROUGHNESS = "roughness"
    EDGE = "edge"
    OFF_ROCK = "off-rock"
    NORMAL = "normal"
    CLEARANCE = "clearance"
    SLOPE = "slope"
    STEP_NEAR = "step-near"
    WAY_HIDDEN = "way-hidden"
    CREASE = "crease"
    RESTLESS = "restless"
    ARM = "arm"
    NO_BASE = "no-base"


_TEXT = {
    Reason.NO_POINTS: "points in the cloud",
    Reason.NO_GROUND: "share of the points on the best ground plane",
    Reason.OUTSIDE_CLOUD: "distance from the designated point to the nearest point of the cloud",
    Reason.NO_ROCK: "distance from the designated point to the nearest rock",
    Reason.FEW_POINTS: "points under the tool",
    Reason.STEREO_SHARE: "share of the surface under the tool with valid stereo",
    Reason.STEREO_HOLE: "largest hole in the stereo under the tool",
    Reason.VIEW_ANGLE: "angle between line of sight and surface normal",
    Reason.PROTRUSION: "height of the surface over the plane under the tool",
    Reason.ROUGHNESS: "deviation of the surface from the plane under the tool",
    Reason.EDGE: "depth of the surface below the plane under the tool",
    Reason.OFF_ROCK: "share of the points under the tool that belong to the rock",
    Reason.NORMAL: "uncertainty of the surface normal",
    Reason.CLEARANCE: "height beside the tool over the plane",
    Reason.SLOPE: "angle between surface normal and tool, with its uncertainty",
    Reason.WAY_HIDDEN: "share of the tool's path that lies behind something",
    Reason.CREASE: "depth of the surface between the designated point and the place, below the line there",
    Reason.STEP_NEAR: "share of the surface under the tool beside a step in depth",
    Reason.RESTLESS: "share of its limits that the relief under the tool takes",
    Reason.ARM: "the arm",
    Reason.NO_BASE: "no place to stand",
}

_LEAST = {Reason.NO_POINTS, Reason.NO_GROUND, Reason.FEW_POINTS, Reason.STEREO_SHARE, Reason.OFF_ROCK}
"""Reasons whose limit is a least value; all others have a greatest."""


@dataclass(frozen=True, slots=True)
class Finding:
    """One reason with the value found, its limit and their unit (m, rad, "" for shares and counts).

    `detail` holds what has no single figure: the words of the arm or of base placement.
    """

    reason: Reason
    value: float
    limit: float
    unit: str = ""
    detail: str = ""

    @property
    def text(self) -> str:
        """Return the finding as a sentence for people; lengths in millimetres, angles in degrees."""
        if self.detail:
            return f"{_TEXT[self.reason]}: {self.detail}"
        scale, unit, form = {"m": (1000.0, " mm", ".0f"), "rad": (57.29578, " degrees", ".0f")}.get(
            self.unit, (1.0, "", ".2f" if self.limit < 1.5 else ".0f")
        )
        side = "at least" if self.reason in _LEAST else "at most"
        return (
            f"{_TEXT[self.reason]} is {self.value * scale:{form}}{unit}; "
            f"{side} {self.limit * scale:{form}}{unit} is allowed"
        )

    def as_dict(self) -> dict[str, object]:
        """Return the JSON form."""
        return {
            "reason": self.reason.value,
            "value": self.value,
            "limit": self.limit,
            "unit": self.unit,
            "text": self.text,
        }


@dataclass(frozen=True, slots=True)
class PatchMeasures:
    """The surface under the tool, lengths in metres, angles in radians.

    Attributes
    ----------
    points, valid_share, hole_m, wide_hole_m
        Points under the tool; share of its area within one pixel of a point; diameter of the largest circle
        without any, and of the largest that begins somewhat beyond the tool.
    doubtful_share
        Share of the points that lie beside a step in depth.
    protrusion_m, depth_m, rms_m
        Highest and lowest part over and below the fitted plane, and root mean square deviation.
    wide_protrusion_m, wide_depth_m, wide_rms_m
        The same, to somewhat beyond the tool.
    sound_protrusion_m, sound_depth_m
        Highest and lowest part under the tool of what does not lie beside a step.
    sigma_m
        What stereo errs across the plane, for one patch that it smooths over.
    normal_sigma_rad
        How far the plane's normal may be off, one standard deviation.
    view_angle_rad
        Between the line of sight and the normal.
    rock_share
        Share of the points that belong to the rock.
    beside_m
        Height over the plane of what stands in the tool's path, beside it or over the surface: all rocks and
        ground.
    slope_rad
        Between normal and approach axis.
    """

    points: int
    valid_share: float
    hole_m: float
    wide_hole_m: float
    doubtful_share: float
    protrusion_m: float
    depth_m: float
    rms_m: float
    wide_protrusion_m: float
    wide_depth_m: float
    wide_rms_m: float
    sound_protrusion_m: float
    sound_depth_m: float
    sigma_m: float
    normal_sigma_rad: float
    view_angle_rad: float
    rock_share: float
    beside_m: float
    slope_rad: float


@dataclass(frozen=True, slots=True)
class BaseMove:
    """How the rover must move so that the arm reaches: a pose in its present frame, metres and radians."""

    pose: Pose
    distance_m: float
    turn_rad: float
    score: float


@dataclass(frozen=True, eq=False)
class PlacementVerdict:
    """Whether and where the tool may be put, frame of the cloud (rover frame), metres.

    Attributes
    ----------
    decision
        `place`, `place-near`, `move-base` or `refuse`.
    point, normal
        (3,) where to put the tool and the outward unit normal there; None when refused. With `move-base`, the
        safe point that is out of reach now.
    distance_m
        From the designated point to `point`.
    measures
        Of the surface under the tool at `point`; of the designated point when refused, as far as it has any.
    findings
        What is wrong with the designated point; empty when it is taken.
    rock
        The rock that the tool is put on, or would have been.
    tried
        How many points were judged.
    base_move
        With `move-base`.
    posture
        What the arm answered at `point` (a posture, or a whole way), for the caller who asked for it.
    """

    decision: Decision
    point: Array | None = None
    normal: Array | None = None
    distance_m: float = 0.0
    measures: PatchMeasures | None = None
    findings: tuple[Finding, ...] = ()
    rock: RockSegment | None = None
    tried: int = 0
    base_move: BaseMove | None = None
    posture: object = field(default=None, repr=False)

    @property
    def accepted(self) -> bool:
        """Return whether the tool may be put down from where the rover stands."""
        return self.decision in (Decision.PLACE, Decision.PLACE_NEAR)

    @property
    def reason(self) -> Reason | None:
        """Return the first reason found, None for the designated point."""
        return self.findings[0].reason if self.findings else None

    @property
    def text(self) -> str:
        """Return the verdict as a sentence."""
        why = "; ".join(f.text for f in self.findings)
        match self.decision:
            case Decision.PLACE:
                return "the designated point is safe"
            case Decision.PLACE_NEAR:
                return f"safe point {100 * self.distance_m:.1f} cm from the designated one ({why})"
            case Decision.MOVE_BASE:
                move = self.base_move
                far = f"{move.distance_m:.2f} m" if move is not None else "nearer"
                return f"out of the arm's reach, the rover must move {far} ({why})"
            case Decision.REFUSE:
                return f"refused: {why}"

    def as_dict(self) -> dict[str, object]:
        """Return the JSON form."""
        move = self.base_move
        return {
            "decision": self.decision.value,
            "point": None if self.point is None else [float(v) for v in self.point],
            "normal": None if self.normal is None else [float(v) for v in self.normal],
            "distance_m": self.distance_m,
            "findings": [f.as_dict() for f in self.findings],
            "tried": self.tried,
            "base_move": None
            if move is None
            else {
                "x_m": move.pose.x,
                "y_m": move.pose.y,
                "heading_rad": move.pose.heading,
                "distance_m": move.distance_m,
                "turn_rad": move.turn_rad,
            },
        }
