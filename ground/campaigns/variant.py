"""Variants: the same seeds in another world or with another plan.

The noise of a seed is the same in all variants (common random numbers), so their runs are compared in pairs.
"""

from __future__ import annotations

import re
from collections.abc import Mapping
from dataclasses import dataclass, replace
from pathlib import Path
from typing import TYPE_CHECKING, Any

from ground.campaigns.case import Case, world_text
from ground.errors import InvalidInputError
from mission.codec import Codec, Document
from mission.values import NotNegative, Positive, value

if TYPE_CHECKING:
    from executive.crl import Plan

NAME = re.compile(r"[A-Za-z0-9][A-Za-z0-9._-]{0,59}")


@value
class Variant:
    """What a variant changes; a member that is absent changes nothing.

    Parameters
    ----------
    name
        Letters, digits, `.`, `_` and `-`: it names a folder.
    plan
        Another plan's CRL, a path beside this file.
    add_time_s, add_energy_j
        Added to the plan's budgets, and to what its root maintains of them.
    loss_factor
        Factor on the chance to lose a track on a drive.
    failure_factor
        Factor on the chance that an observation gives no usable product.
    drive_time_factor, drive_energy_factor, observe_time_factor, observe_energy_factor
        Factors on means and standard deviations of the problem.
    faults
        Faults that strike in each run besides those of the world.
    soil
        Members of the world's soil that are another.
    tracker
        Another tracker of the rover.
    """

    name: str
    plan: str = ""
    add_time_s: float = 0.0
    add_energy_j: float = 0.0
    loss_factor: NotNegative = 1.0
    failure_factor: NotNegative = 1.0
    drive_time_factor: Positive = 1.0
    drive_energy_factor: Positive = 1.0
    observe_time_factor: Positive = 1.0
    observe_energy_factor: Positive = 1.0
    faults: tuple[Document, ...] = ()
    soil: Document | None = None
    tracker: str = ""

    def __post_init__(self) -> None:
        if not NAME.fullmatch(self.name):
            raise InvalidInputError(
                f'variant name "{self.name}": letters, digits, ".", "_" and "-" only, at most 60'
            )


@value
class Variants:
    """The variants of a campaign, beside the plan as it is."""

    variants: tuple[Variant, ...]


VARIANTS = Codec(Variants, "campaign-variants/1", "variants", error=InvalidInputError)

ODDS = (
    "loss_factor",
    "failure_factor",
    "drive_time_factor",
    "drive_energy_factor",
    "observe_time_factor",
    "observe_energy_factor",
)
"""Members that change the planning problem, in which the abstract rover alone lives."""


@dataclass(frozen=True, slots=True)
class NamedCase:
    """A variant made ready to fly."""

    name: str
    case: Case


def read_variants(path: Path, base: Case) -> tuple[NamedCase, ...]:
    """Return the cases of a `campaign-variants/1` file.

    Raises
    ------
    InvalidInputError
        If the file or a member cannot be used, or two variants have one name.
    """
    listed = VARIANTS.read_file(path).variants
    names = [variant.name for variant in listed]
    for name in names:
        if names.count(name) > 1:
            raise InvalidInputError(f'{path}: the variant name "{name}" is given {names.count(name)} times')
    return tuple(NamedCase(v.name, varied(v, base, path.parent)) for v in listed)


def varied(variant: Variant, base: Case, folder: Path = Path()) -> Case:
    """Return a case with the changes of a variant; `folder` is where its paths begin.

    Raises
    ------
    InvalidInputError
        If the rover cannot be changed like that, or the other plan cannot be read.
    """
    where = f'variant "{variant.name}"'
    plan = read_plan(folder / variant.plan) if variant.plan else base.plan()
    world: dict[str, Any] = {**base.world}
    touched = [name for name in ODDS if getattr(variant, name) != 1.0]
    if touched and base.rover != "abstract":
        raise InvalidInputError(
            f'{where}: "{touched[0]}" changes the planning problem; the rover {base.rover} has its own odds'
        )
    if (variant.soil is not None or variant.tracker) and base.rover == "abstract":
        member = "tracker" if variant.tracker else "soil"
        raise InvalidInputError(
            f'{where}: the abstract rover has no "{member}"; use loss_factor and the like'
        )
    if touched:
        world["problem"] = _problem(world["problem"], variant)
    if variant.add_energy_j and "battery_j" in world:
        world["battery_j"] = world["battery_j"] + variant.add_energy_j
    if variant.faults:
        world["faults"] = [*world.get("faults", ()), *variant.faults]
    if variant.soil is not None:
        world["soil"] = {**(world.get("soil") or {}), **variant.soil}
    if variant.tracker:
        world["tracker"] = variant.tracker
    case = Case(canonical(_budgeted(plan, variant, where)), world_text(world), base.rover)
    _try(case, variant, where)
    return case


def _try(case: Case, variant: Variant, where: str) -> None:
    from rover_iface.errors import RoverError
    from rover_iface.simulator.faults import load_faults
    from rover_iface.simulator.world import load_world

    try:
        load_faults(variant.faults)
        load_world(case.world)
    except RoverError as err:
        raise InvalidInputError(f"{where}: {err}") from err


def read_plan(path: Path) -> Plan:
    """Return the plan in a CRL file.

    Raises
    ------
    InvalidInputError
        If it cannot be read or is not a valid plan; the message has the first finding.
    """
    from executive.crl.validate import check

    try:
        text = path.read_text(encoding="utf-8")
    except (OSError, UnicodeDecodeError) as err:
        raise InvalidInputError(f"plan {path}: {getattr(err, 'strerror', None) or err}") from err
    report = check(text)
    if report.plan is None or report.errors:
        first = report.errors[0]
        raise InvalidInputError(f"plan {path}: {first.message} (line {first.line})")
    return report.plan


def canonical(plan: Plan | str) -> str:
    """Return the canonical text of a plan, or of a text that was validated before."""
    from executive.crl.printer import canonical_text
    from executive.crl.reader import parse

    return canonical_text(parse(plan) if isinstance(plan, str) else plan)


def _budgeted(plan: Plan, variant: Variant, where: str) -> Plan:
    """Return the plan with larger or smaller budgets, and its root maintaining them."""
    added = {"time": variant.add_time_s, "energy": variant.add_energy_j}
    if not any(added.values()):
        return plan
    limits = {b.resource: b.amount for b in plan.budgets}
    for name, more in added.items():
        if more and name not in limits:
            raise InvalidInputError(f"{where}: the plan has no budget of {name}")
        if more and limits[name] + more <= 0:
            raise InvalidInputError(
                f"{where}: the budget of {name} is {limits[name]:g}; {more:+g} leaves nothing"
            )
    budgets = tuple(replace(b, amount=b.amount + added.get(b.resource, 0.0)) for b in plan.budgets)
    kept = tuple(_moved(c, added) for c in plan.node.maintain_conditions)
    return replace(plan, budgets=budgets, node=replace(plan.node, maintain_conditions=kept))


def _moved(condition: Any, added: Mapping[str, float]) -> Any:
    """Return a bound `(:time <= x)` or `(:energy-used <= x)` moved with its budget, others as they are."""
    from executive.crl.values import Comparison, Operator

    match condition:
        case Comparison(key="time" | "energy-used" as key, operator=Operator.LE | Operator.LT, value=limit):
            return replace(condition, value=float(limit) + added["time" if key == "time" else "energy"])
    return condition


def _problem(problem: Document, variant: Variant) -> dict[str, Any]:
    return {
        **problem,
        "legs": [_leg(leg, variant) for leg in problem["legs"]],
        "targets": [_target(target, variant) for target in problem["targets"]],
    }


def _amount(amount: Mapping[str, float], factor: float) -> dict[str, float]:
    return {name: figure * factor for name, figure in amount.items()}


def _leg(leg: Document, variant: Variant) -> dict[str, Any]:
    lost = {t: min(1.0, chance * variant.loss_factor) for t, chance in leg.get("p_lose", {}).items()}
    return {
        **leg,
        "time_s": _amount(leg["time_s"], variant.drive_time_factor),
        "energy_j": _amount(leg["energy_j"], variant.drive_energy_factor),
        "p_lose": lost,
    }


def _target(target: Document, variant: Variant) -> dict[str, Any]:
    if "observations" in target:
        return {**target, "observations": [_observation(o, variant) for o in target["observations"]]}
    return _observation(target, variant)


def _observation(entry: Document, variant: Variant) -> dict[str, Any]:
    fails = min(1.0, (1.0 - float(entry.get("p_success", 1.0))) * variant.failure_factor)
    return {
        **entry,
        "p_success": 1.0 - fails,
        "observe": {
            "time_s": _amount(entry["observe"]["time_s"], variant.observe_time_factor),
            "energy_j": _amount(entry["observe"]["energy_j"], variant.observe_energy_factor),
        },
    }
