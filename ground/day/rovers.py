"""The rover of a mission: its profile, and the instruments that requests may name."""

from __future__ import annotations

from typing import TYPE_CHECKING

from ground.errors import InvalidInputError

if TYPE_CHECKING:
    from rover_iface.profile import RoverProfile


def profile_of(name: str) -> RoverProfile:
    """Return the profile that a mission names.

    Raises
    ------
    InvalidInputError
        If there is none of that name, or it cannot be used; the message says why and what is known.
    """
    from rover_iface.errors import ProfileError
    from rover_iface.profile import load_profile

    try:
        return load_profile(name)
    except ProfileError as err:
        raise InvalidInputError(str(err), pointer="/rover_profile") from err


def instrument_name(profile: RoverProfile, name: str) -> str:
    """Return the name under which requests hold an instrument of a rover.

    Raises
    ------
    InvalidInputError
        If the rover does not carry it.
    """
    from rover_iface.errors import ProfileError

    try:
        key = profile.instrument_key(name)
    except ProfileError as err:
        raise InvalidInputError(str(err), pointer="/instrument") from err
    return profile.instruments[key].alias or key
