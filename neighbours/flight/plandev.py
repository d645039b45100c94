"""Runs of a plan as PlanDev's model-free plans: a plan file, version 3, for each path through the branches.

The form is that of NASA-AMMOS/plandev-gateway: `src/types/plan-transfer.ts` and
`src/schemas/plan-transfer-validation-schema.ts`. A file holds the activities, declares their types and
those of the resources, and holds results: a span for each activity, and profiles without gaps. Offsets
of results are whole microseconds.
"""

from __future__ import annotations

from collections.abc import Mapping
from datetime import UTC, datetime
from typing import TypeAlias

from executive.crl.dictionary import ActionSpec, CommandDictionary, ValueSpec, ValueType
from executive.crl.nodes import Plan
from neighbours.flight.straight_run import Step, StraightRun

Json: TypeAlias = "Mapping[str, Json] | list[Json] | str | float | bool | None"

ENERGY_USED, ENERGY_LEFT, TIME_LEFT, TASK = (
    "/outcrop/energy_used_j",
    "/outcrop/energy_left_j",
    "/outcrop/time_left_s",
    "/outcrop/task",
)
NOTHING = "none"
"""What the resource of the task holds while nothing is carried out."""


def plandev_plan(
    plan: Plan, run: StraightRun, commands: CommandDictionary, start: datetime, name: str
) -> Mapping[str, Json]:
    """Return a run as a model-free plan that begins at `start` (UTC).

    Times and energies are the means that the plan expects; a task of which it expects nothing takes no time.
    """
    steps = run.steps
    length_us = max(1_000_000, _microseconds(run.end_s))
    profiles = _profiles(plan, steps, length_us)
    actions = {step.task.action for step in steps}
    return {
        "version": "3",
        "name": name,
        "start_time": start.astimezone(UTC).strftime("%Y-%m-%dT%H:%M:%S.%f+00:00"),
        "duration": _interval(length_us),
        "simulation_arguments": {},
        "tags": [{"tag": {"name": f"outcrop {run.name}", "color": None}}],
        "activities": [
            {
                "id": number,
                "anchor_id": None,
                "anchored_to_start": True,
                "name": step.task.id,
                "type": step.task.action,
                "start_offset": _interval(_microseconds(step.start_s)),
                "arguments": dict(step.task.parameters),
                "metadata": {},
            }
            for number, step in enumerate(steps, 1)
        ],
        "model": {
            "activity_types": [_activity_type(a, commands.actions.get(a)) for a in sorted(actions)],
            "resource_types": [{"name": n, "schema": p["schema"]} for n, p in profiles.items()],
            "metadata": {"mission": plan.name or plan.id or "", "options": list(run.options)},
        },
        "results": {
            "spans": [
                {
                    "span_id": number,
                    "directive_id": number,
                    "type": step.task.action,
                    "start_offset": _microseconds(step.start_s),
                    "duration": _microseconds(step.start_s + step.time_s) - _microseconds(step.start_s),
                    "arguments": dict(step.task.parameters),
                }
                for number, step in enumerate(steps, 1)
            ],
            "profiles": profiles,
        },
    }


def _microseconds(seconds: float) -> int:
    return round(1e6 * seconds)


def _interval(us: int) -> str:
    seconds, rest = divmod(us, 1_000_000)
    return f"{seconds // 3600:02d}:{seconds // 60 % 60:02d}:{seconds % 60:02d}.{rest:06d}"


def _activity_type(name: str, action: ActionSpec | None) -> Mapping[str, Json]:
    if action is None:
        return {"name": name}
    return {
        "name": name,
        "parameters": [{"name": p.name, "schema": _schema(p)} for p in action.parameters],
        "required_parameters": [p.name for p in action.parameters if p.required],
        "description": action.doc,
    }


def _schema(spec: ValueSpec) -> Mapping[str, Json]:
    unit: Mapping[str, Json] = {"metadata": {"unit": {"value": spec.unit}}} if spec.unit else {}
    if spec.choices:
        return {"type": "variant", "variants": [{"key": c, "label": c} for c in spec.choices]}
    kinds = {ValueType.NUMBER: "real", ValueType.STRING: "string", ValueType.BOOLEAN: "boolean"}
    return {"type": kinds[spec.type], **unit}


def _real(unit: str) -> Mapping[str, Json]:
    """Return the schema of a resource that changes linearly: PlanDev's own for such."""
    items: Mapping[str, Json] = {"initial": {"type": "real"}, "rate": {"type": "real"}}
    return {"type": "struct", "items": items, "metadata": {"unit": {"value": unit}}}


def _profiles(plan: Plan, steps: tuple[Step, ...], length_us: int) -> dict[str, Mapping[str, Json]]:
    """Return energy and time used over a run, and what is left of the plan's budgets."""
    used: list[Json] = []
    tasks: list[Json] = []
    at_us, energy_j = 0, 0.0
    for step in (*steps, None):
        start_us = length_us if step is None else _microseconds(step.start_s)
        if start_us > at_us:
            used.append(_segment(start_us - at_us, energy_j, 0.0))
            tasks.append({"duration": start_us - at_us, "dynamics": NOTHING})
            at_us = start_us
        if step is None:
            break
        end_us = _microseconds(step.start_s + step.time_s)
        if end_us > at_us:
            used.append(_segment(end_us - at_us, energy_j, step.energy_j * 1e6 / (end_us - at_us)))
            tasks.append({"duration": end_us - at_us, "dynamics": step.task.id})
            at_us = end_us
        energy_j += step.energy_j
    found: dict[str, Mapping[str, Json]] = {
        ENERGY_USED: {"type": "real", "schema": _real("J"), "segments": used},
        TASK: {"type": "discrete", "schema": {"type": "string"}, "segments": tasks},
    }
    budgets = {budget.resource: budget.amount for budget in plan.budgets}
    if "energy" in budgets:
        left = [_falling(segment, budgets["energy"]) for segment in used]
        found[ENERGY_LEFT] = {"type": "real", "schema": _real("J"), "segments": left}
    if "time" in budgets:
        left = [_segment(length_us, budgets["time"], -1.0)]
        found[TIME_LEFT] = {"type": "real", "schema": _real("s"), "segments": left}
    return found


def _segment(duration_us: int, initial: float, rate_per_s: float) -> Json:
    return {"duration": duration_us, "dynamics": {"initial": initial, "rate": rate_per_s}}


def _falling(segment: Json, budget: float) -> Json:
    assert isinstance(segment, dict)
    dynamics = segment["dynamics"]
    return _segment(segment["duration"], budget - dynamics["initial"], -dynamics["rate"])
