"""A plan taken apart into parts by id, and put together again.

The header is the part with the id "". Nodes, options, contingencies and alternates share one name space, so
an id names a part wherever it stands.
"""

from __future__ import annotations

import dataclasses
from collections.abc import Mapping
from dataclasses import dataclass, field
from typing import Any

from executive.crl.nodes import FORMS, KIND_OF, Plan
from executive.crl.values import Relative, Spread
from ground.versions.meaning import Meaning, expectations_in, field_meaning, order_matters

HEADER = ""
"""Id of the part that the plan's header is."""

Slot = tuple[str, str]
"""Where a part stands: the id of the part around it, and the field that holds it."""


@dataclass
class Part:
    """One form without what stands below it.

    Attributes
    ----------
    kind
        Head of the form: task, block, option, plan, ...
    fields
        Its own fields by their names in `executive.crl.nodes`, as they stand.
    below
        Ids of the parts in it, in order, by the field that holds them.
    """

    id: str
    kind: str
    fields: dict[str, Any]
    slot: Slot | None
    below: dict[str, list[str]] = field(default_factory=dict)
    ordered: bool = True
    """Whether the order of what stands below means anything."""


Parts = dict[str, Part]


def parts_of(plan: Plan) -> Parts:
    """Return the parts of a plan by id, those around others first.

    Raises
    ------
    ValueError
        If an id stands twice (the validator's E015).
    """
    found: Parts = {}
    stack: list[tuple[Any, Slot | None]] = [(plan, None)]
    while stack:
        form, slot = stack.pop()
        kind = KIND_OF[type(form)]
        declared = FORMS[kind]
        name = HEADER if slot is None else form.id
        if name in found:
            raise ValueError(f"the id {name} stands twice")
        structure = {d.attribute for d in declared.structure}
        own = [d.attribute for d in declared.fields.values() if d.attribute not in structure]
        if slot is not None:
            own.remove("id")
        part = Part(name, kind, {attribute: getattr(form, attribute) for attribute in own}, slot)
        for attribute in (d.attribute for d in declared.structure):
            held = getattr(form, attribute)
            inside = held if isinstance(held, tuple) else (held,)
            part.below[attribute] = [below.id for below in inside]
            stack += [(below, (name, attribute)) for below in reversed(inside)]
        if kind == "concurrent-block":
            part.ordered = len({child.priority for child in form.node_list}) < len(form.node_list)
        elif kind == "branch":
            part.ordered = order_matters(form.options)
        found[name] = part
    return found


def plan_of(parts: Mapping[str, Part]) -> Plan:
    """Return the plan of parts, which must hang together."""
    order, stack = [], [HEADER]
    while stack:
        name = stack.pop()
        order.append(name)
        stack += [below for ids in parts[name].below.values() for below in ids]
    made: dict[str, Any] = {}
    for name in reversed(order):
        part = parts[name]
        form = FORMS[part.kind]
        fields = dict(part.fields) if name == HEADER else {**part.fields, "id": name}
        for declared in form.structure:
            inside = tuple(made[below] for below in part.below[declared.attribute])
            single = declared.attribute == "node"
            fields[declared.attribute] = inside[0] if single else inside
        made[name] = form.cls(**fields)
    plan: Plan = made[HEADER]
    return plan


def spread_of(parts: Mapping[str, Part]) -> Spread:
    """Return how the predictions of a plan state their spread."""
    spread: Spread = parts[HEADER].fields["expectation_spread"]
    return spread


def in_spread(parts: Parts, wanted: Spread) -> Parts:
    """Return the parts of a plan with its predictions stating their spread as `wanted`."""
    spread = spread_of(parts)
    if spread is wanted:
        return parts
    restated = {name: copy_of(part) for name, part in parts.items()}
    for part in restated.values():
        if "expectations" in part.fields:
            part.fields["expectations"] = expectations_in(part.fields["expectations"], spread, wanted)
    restated[HEADER].fields["expectation_spread"] = wanted
    return restated


def meaning_of(part: Part, attribute: str, spread: Spread) -> Meaning:
    """Return what a field of a part means; a field that its kind does not have is None."""
    if attribute in ("expectation_spread", "duration"):
        return None  # compared with the predictions, and with the windows of the end
    if attribute == "end_temporal_conditions" and part.fields.get("duration") is not None:
        ends = (*part.fields[attribute], Relative(part.fields["duration"]))
        return field_meaning(attribute, ends, spread)
    return field_meaning(attribute, part.fields[attribute], spread) if attribute in part.fields else None


def part_meaning(part: Part, spread: Spread) -> Meaning:
    """Return what a part says by itself."""
    return (part.kind, tuple((name, meaning_of(part, name, spread)) for name in sorted(part.fields)))


def copy_of(part: Part) -> Part:
    """Return a part that can be changed without changing the first."""
    return dataclasses.replace(
        part, fields=dict(part.fields), below={name: list(ids) for name, ids in part.below.items()}
    )
