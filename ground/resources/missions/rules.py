"""Rules of a mission: rover, calibration, drives."""

from __future__ import annotations

from collections.abc import Collection, Mapping, Sequence
from dataclasses import asdict

from ground.day.rovers import profile_of
from ground.errors import InvalidInputError
from ground.gdr.base import Columns
from ground.geo.place import Place
from ground.geo.site_frame import site_frame
from ground.resources.missions.bodies import DriveRuleBody, PlaceBody
from mission.codec import Document


def require_profile(name: str) -> None:
    """Raise unless there is a rover profile of the name that can be used."""
    if name.endswith(".toml"):
        raise InvalidInputError(
            f"rover_profile is {name!r}; a mission takes a profile by its name", pointer="/rover_profile"
        )
    profile_of(name)


def require_place(given: PlaceBody) -> None:
    """Raise unless the site can lie there: a reference that is known and a point in it."""
    site_frame(Place(**given.model_dump()))


def place_in(origin: Mapping[str, object]) -> Columns | None:
    """Return the place that a terrain's `origin` tells; None if it names no reference."""
    crs, x, y = (origin.get(name) for name in ("crs", "x", "y"))
    if not (isinstance(crs, str) and isinstance(x, int | float) and isinstance(y, int | float)):
        return None
    return asdict(Place(crs, float(x), float(y)))


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


def require_calibration(document: Document) -> Document:
    """Return a `calibration/1` document with all its members; raise if it is none."""
    from planner.errors import PlannerError
    from planner.path_network import CALIBRATIONS

    try:
        return CALIBRATIONS.document(CALIBRATIONS.from_document(document))
    except PlannerError as err:
        raise InvalidInputError(str(err), pointer="/calibration") from err
