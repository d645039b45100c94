"""Rules of a mission: rover, calibration, drives."""

from __future__ import annotations

from collections.abc import Collection, Mapping, Sequence

from pydantic import ValidationError

from ground.day.rovers import profile_of
from ground.errors import InvalidInputError, UnavailableError
from ground.geo.place import Place
from ground.geo.site_frame import site_frame
from ground.resources.missions.bodies import DriveRuleBody, PlaceBody

ORIGIN = ("crs", "x", "y")


def require_profile(name: str) -> None:
    """Raise unless there is a rover profile of the name that can be used."""
    if name.endswith(".toml"):
        raise InvalidInputError(
            f"rover_profile is {name!r}; a mission takes a profile by its name", pointer="/rover_profile"
        )
    profile_of(name)


NEAR_TRUE = 0.01
"""A place given by hand; site metres are taken for metres on the ground. UTM is within 0.1 % in its zone."""
MAP_TRUE = 0.1
"""A place told by a terrain, whose grid is the site's anyway. Equirectangular maps of Mars that are true at a
multiple of 5 degrees are stretched by up to 8 % (2.5 degrees off, at 60 degrees of latitude).
"""


def require_place(given: PlaceBody, present: Mapping[str, object] | None = None) -> None:
    """Raise unless the site can lie there: a known reference, a point in it, and true metres.

    Where the origin is that of the `present` place, its metres may be as far off as those of a terrain.
    """
    frame = site_frame(Place(**given.model_dump()))
    kept = present is not None and all(getattr(given, name) == present[name] for name in ORIGIN)
    frame.require_true_metres(MAP_TRUE if kept else NEAR_TRUE)


def place_in(origin: Mapping[str, object]) -> dict[str, object] | None:
    """Return the place that a terrain's `origin` tells; None if it tells none of use.

    Without pyproj a reference is taken as it stands.
    """
    try:
        given = PlaceBody.model_validate({name: origin.get(name) for name in ORIGIN}).model_dump()
        site_frame(Place(**given)).require_true_metres(MAP_TRUE)
    except (ValidationError, InvalidInputError):
        return None
    except UnavailableError:
        pass
    return given


def require_drive_rules(rules: Sequence[DriveRuleBody], target_ids: Collection[str]) -> None:
    """Raise unless each rule is about two places of the mission that no other rule is about."""
    known = {None, *target_ids}
    seen: set[frozenset[str | None]] = set()
    for index, rule in enumerate(rules):
        ends = rule.from_target_id, rule.to_target_id
        for end in ends:
            if end not in known:
                raise InvalidInputError(
                    f"there is no target {end} in the mission", pointer=f"/drive_rules/{index}"
                )
        if ends[0] == ends[1]:
            raise InvalidInputError(
                "a drive leads from one place to another", pointer=f"/drive_rules/{index}/to_target_id"
            )
        if frozenset(ends) in seen:
            raise InvalidInputError("there is a rule for this drive already", pointer=f"/drive_rules/{index}")
        seen.add(frozenset(ends))


def require_calibration(document: Mapping[str, object]) -> Mapping[str, object]:
    """Return a `calibration/1` document with all its members; raise if it is none."""
    from planner.errors import PlannerError
    from planner.path_network import CALIBRATIONS, calibration_document

    try:
        return calibration_document(CALIBRATIONS.from_document(document))
    except PlannerError as err:
        raise InvalidInputError(str(err), pointer="/calibration") from err
