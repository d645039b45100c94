"""The command dictionary: every action a rover takes, with parameters, results, types and units.

The validator, the documentation and the contract suite are all made from `COMMANDS`. Angles are radians
in the site frame (counter-clockwise from east), lengths metres, times seconds, energies joules.
"""

from __future__ import annotations

import math

from executive.crl.dictionary import ActionSpec, CommandDictionary, ValueSpec, ValueType

VERSION = "1"

HANDOFF_METHODS = ("cascade", "kinematic", "alternate", "refined", "geometric", "draped", "registration")
NAVIGATE_MODES = ("blind", "avoid", "track")


def _number(
    name: str,
    unit: str,
    doc: str,
    *,
    required: bool = False,
    minimum: float | None = None,
    maximum: float | None = None,
) -> ValueSpec:
    return ValueSpec(name, ValueType.NUMBER, unit, required, minimum, maximum, doc=doc)


def _string(name: str, doc: str, *, required: bool = False, choices: tuple[str, ...] = ()) -> ValueSpec:
    return ValueSpec(name, ValueType.STRING, required=required, choices=choices, doc=doc)


def _flag(name: str, doc: str) -> ValueSpec:
    return ValueSpec(name, ValueType.BOOLEAN, doc=doc)


_TARGET = _string("target", "id of the target", required=True)
_TARGET_OR = _string("target", "id of the target, instead of a direction or a place")
_ENERGY = _number("energy_j", "J", "energy drawn by the action itself, without the hotel load", minimum=0)
_AZIMUTH = _number("azimuth", "rad", "direction in the site frame", minimum=-2 * math.pi, maximum=2 * math.pi)
_ELEVATION = _number(
    "elevation", "rad", "above the horizon positive", minimum=-math.pi / 2, maximum=math.pi / 2
)
_MADE = _flag("made", "the observation was carried out, even if no usable product came of it")
_DURATION = _number("duration_s", "s", "how long", minimum=0)

_ACTIONS = (
    ActionSpec(
        "navigate",
        parameters=(
            _TARGET_OR,
            _number("x", "m", "east in the site frame"),
            _number("y", "m", "north in the site frame"),
            _number("heading", "rad", "heading to end with", minimum=-2 * math.pi, maximum=2 * math.pi),
            _number("standoff_m", "m", "stop this far from the target", minimum=0, maximum=100),
            _string("mode", "how the rover looks where it goes", choices=NAVIGATE_MODES),
            _flag("require_tracked", "fail before leaving if the target is not tracked"),
        ),
        results=(
            _number("distance_m", "m", "length driven", minimum=0),
            _ENERGY,
            _number("error_m", "m", "distance left to the goal", minimum=0),
        ),
        one_of=(("target",), ("x", "y")),
        doc="Drive to the observation point of a target, or to a place.",
    ),
    ActionSpec(
        "turn",
        parameters=(
            _number(
                "heading", "rad", "heading to end with, site frame", minimum=-2 * math.pi, maximum=2 * math.pi
            ),
            _number(
                "angle", "rad", "how far to turn, left positive", minimum=-2 * math.pi, maximum=2 * math.pi
            ),
        ),
        results=(_ENERGY,),
        one_of=(("heading",), ("angle",)),
        doc="Turn in place.",
    ),
    ActionSpec(
        "trackstart",
        parameters=(_TARGET,),
        results=(
            _number("confidence", "", "of the first match", minimum=0, maximum=1),
            _number("range_m", "m", "distance of the target from the camera", minimum=0),
            _ENERGY,
        ),
        doc="Begin to track a target that is in view.",
    ),
    ActionSpec(
        "trackstop", parameters=(_TARGET,), doc="Stop tracking a target; not tracking it is no error."
    ),
    ActionSpec(
        "pointmast",
        parameters=(_TARGET_OR, _AZIMUTH, _ELEVATION),
        results=(
            _number("pan", "rad", "mast angle reached"),
            _number("tilt", "rad", "mast angle reached"),
        ),
        one_of=(("target",), ("azimuth", "elevation")),
        doc="Point the mast cameras.",
    ),
    ActionSpec(
        "image",
        parameters=(
            _string("instrument", "name of the camera in the rover profile; its science camera if absent"),
            _TARGET_OR,
            _AZIMUTH,
            _ELEVATION,
        ),
        results=(_number("products", "", "data products written", minimum=0), _MADE, _ENERGY),
        one_of=(("target",), ("azimuth", "elevation")),
        doc="Take a remote image of a target or in a direction.",
    ),
    ActionSpec(
        "imagepanorama",
        parameters=(
            _string("instrument", "name of the camera in the rover profile; its navigation camera if absent"),
            _number("from_azimuth", "rad", "left edge", minimum=-2 * math.pi, maximum=2 * math.pi),
            _number("to_azimuth", "rad", "right edge", minimum=-2 * math.pi, maximum=2 * math.pi),
        ),
        results=(_number("products", "", "data products written", minimum=0), _ENERGY),
        doc="Take a mosaic; all round when no edges are given.",
    ),
    ActionSpec(
        "handoff",
        parameters=(_TARGET, _string("method", "how the target is found again", choices=HANDOFF_METHODS)),
        results=(
            _number("error_px", "px", "estimated error in the receiving camera", minimum=0),
            _number("confidence", "", "of the self-test", minimum=0, maximum=1),
            _ENERGY,
        ),
        doc="Hand a tracked target from the mast cameras to the hazard cameras.",
    ),
    ActionSpec(
        "ipplaceinstrument",
        parameters=(
            _TARGET,
            _string("instrument", "name of the contact instrument in the rover profile"),
            _number("dwell_s", "s", "time on the surface", minimum=0, maximum=86400),
        ),
        results=(
            _number("placement_error_m", "m", "distance of the contact from the target", minimum=0),
            _number("products", "", "data products written", minimum=0),
            _MADE,
            _ENERGY,
        ),
        doc="Place a contact instrument on a target within reach and measure.",
    ),
    ActionSpec("stow", doc="Stow the arm."),
    ActionSpec(
        "heat",
        parameters=(_string("subsystem", "what to warm"), _DURATION),
        results=(_ENERGY,),
        doc="Warm a subsystem.",
    ),
    ActionSpec(
        "recharge",
        parameters=(_DURATION, _number("until_j", "J", "stop at this state of charge", minimum=0)),
        results=(_number("charged_j", "J", "energy gained", minimum=0),),
        doc="Rest and let the panels charge the battery.",
    ),
    ActionSpec(
        "wait",
        parameters=(_number("duration_s", "s", "how long", required=True, minimum=0),),
        doc="Do nothing for a while.",
    ),
    ActionSpec(
        "downlink",
        parameters=(_number("volume_mb", "MB", "data to send", minimum=0), _DURATION),
        results=(_ENERGY,),
        doc="Send data.",
    ),
    ActionSpec("safemode", doc="Stop everything, stow, and wait for the ground."),
)

COMMANDS = CommandDictionary("outcrop-rover", VERSION, {action.name: action for action in _ACTIONS})
"""The dictionary handed to the validator."""
