"""Units of numbers that cross the bridge: within one quantity they are turned into each other."""

from __future__ import annotations

import math

from rover_iface.errors import MappingError

_UNITS: dict[str, tuple[str, float]] = {
    "m": ("length", 1.0),
    "km": ("length", 1000.0),
    "cm": ("length", 0.01),
    "mm": ("length", 0.001),
    "rad": ("angle", 1.0),
    "deg": ("angle", math.pi / 180),
    "s": ("time", 1.0),
    "ms": ("time", 0.001),
    "min": ("time", 60.0),
    "h": ("time", 3600.0),
    "m/s": ("speed", 1.0),
    "km/h": ("speed", 1 / 3.6),
    "rad/s": ("turn rate", 1.0),
    "deg/s": ("turn rate", math.pi / 180),
    "J": ("energy", 1.0),
    "kJ": ("energy", 1000.0),
    "Wh": ("energy", 3600.0),
    "W": ("power", 1.0),
    "V": ("voltage", 1.0),
    "mV": ("voltage", 0.001),
    "A": ("current", 1.0),
    "mA": ("current", 0.001),
    "1": ("share", 1.0),
    "%": ("share", 0.01),
}


def factor(given: str, wanted: str) -> float:
    """Return by what a number in `given` is multiplied to be in `wanted`; an empty unit is the other's.

    Raises
    ------
    MappingError
        If a unit is not known, or the two are of different quantities.
    """
    if not given or not wanted or given == wanted:
        return 1.0
    for name in (given, wanted):
        if name not in _UNITS:
            raise MappingError(f"the unit {name!r} is not known; known are {', '.join(_UNITS)}")
    (kind, much), (other, little) = _UNITS[given], _UNITS[wanted]
    if kind != other:
        raise MappingError(f"{given} is a unit of {kind}, {wanted} one of {other}")
    return much / little
