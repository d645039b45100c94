"""Tell what requests and plans may name of a rover."""

from __future__ import annotations

from functools import cache
from typing import TYPE_CHECKING

from ground.day.rovers import profile_of
from ground.errors import InvalidInputError, NotFoundError
from ground.gdr.repository import Repository
from ground.records.actor import Actor
from ground.records.show import value_of
from ground.resources.rovers.value import (
    ConstraintKind,
    Rover,
    RoverAction,
    RoverInstrument,
    RoverSummary,
    RoverTelemetry,
    RoverValue,
)

if TYPE_CHECKING:
    from executive.crl.dictionary import ActionSpec, ValueSpec
    from mission.instrument import Instrument


def list_rovers(_repo: Repository, _actor: Actor) -> list[RoverSummary]:
    """Return the rovers that missions may have; one that cannot be used says why."""
    from rover_iface.profile import profile_names

    found = []
    for name in profile_names():
        try:
            profile = profile_of(name)
        except InvalidInputError as err:
            found.append(RoverSummary(name, "", "", [], err.message))
        else:
            found.append(RoverSummary(name, profile.version, profile.doc, profile.instrument_names(), ""))
    return found


def show_rover(_repo: Repository, _actor: Actor, name: str) -> Rover:
    """Return all that requests, plans and forms may name of a rover; raises as `describe` does."""
    return describe(name)


def describe(name: str) -> Rover:
    """Return all that requests, plans and forms may name of a rover.

    Raises
    ------
    NotFoundError
        If there is no rover of that name.
    InvalidInputError
        If its profile cannot be used.
    """
    from rover_iface.profile import profile_names
    from rover_iface.vision.handoffs import HANDOFFS
    from rover_iface.vision.trackers import TRACKERS

    if name not in profile_names():
        raise NotFoundError(f"there is no rover {name!r}; there are {', '.join(profile_names())}")
    profile = profile_of(name)
    language = profile.language
    return Rover(
        name=name,
        version=profile.version,
        doc=profile.doc,
        profile_sha256=profile.sha256,
        dictionary=language.name,
        dictionary_version=language.version,
        dictionary_sha256=language.sha256,
        instruments=[_instrument(key, value) for key, value in profile.instruments.items()],
        actions=[_action(action) for action in language.commands.actions.values()],
        telemetry=[
            RoverTelemetry(key, language.telemetry.arguments[key], _value(spec))
            for key, spec in language.telemetry.keys.items()
        ],
        constraints=_constraints(),
        trackers=TRACKERS.names(),
        handoffs=HANDOFFS.names(),
    )


def _instrument(key: str, instrument: Instrument) -> RoverInstrument:
    return value_of(
        RoverInstrument,
        instrument,
        name=instrument.alias or key,
        profile_name=key,
        use="contact" if instrument.contact else "remote",
        action=instrument.used_by,
        tracked=instrument.tracks,
    )


def _action(action: ActionSpec) -> RoverAction:
    return value_of(
        RoverAction,
        action,
        parameters=[_value(p) for p in action.parameters],
        results=[_value(r) for r in action.results],
        one_of=[list(group) for group in action.one_of],
        needs=list(action.needs),
    )


def _value(spec: ValueSpec) -> RoverValue:
    return value_of(RoverValue, spec, type=spec.type.value, choices=list(spec.choices))


@cache
def _constraints() -> list[ConstraintKind]:
    """Return the kinds of constraint that are known, the product's and those of packages."""
    from pydantic import TypeAdapter

    from mission.constraints import constraint_kinds, constraint_type

    found = []
    for kind in constraint_kinds():
        form = TypeAdapter(constraint_type(kind)).json_schema()
        found.append(ConstraintKind(kind, str(form.pop("description", "")), form))
    return found
