"""Actions, parameters and keys against the dictionaries of a rover: E042, E043, E050-E052."""

from __future__ import annotations

from executive.crl.checks.index import Index, Owner
from executive.crl.checks.names import RESERVED_KEYS, all_conditions, leaves
from executive.crl.dictionary import CommandDictionary, TelemetryDictionary, ValueSpec, ValueType
from executive.crl.nodes import Task
from executive.crl.reader import nearest
from executive.crl.trees import number_text, value_text
from executive.crl.values import Comparison, ConsumableResource, Known, Operator, Source, Value


def value_problem(spec: ValueSpec, value: Value, *, range_too: bool = True) -> str:
    """Return what is wrong with a value, an empty text if nothing is."""
    found = value_text(value)
    if spec.type is ValueType.BOOLEAN:
        return "" if isinstance(value, bool) else f"needs t or nil, found {found}"
    if spec.type is ValueType.STRING:
        if not isinstance(value, str):
            return f"needs a word, found {found}"
        if spec.choices and value not in spec.choices:
            return f"needs one of {', '.join(spec.choices)}, found {found}"
        return ""
    if isinstance(value, (bool, str)):
        return f"needs a number, found {found}"
    unit = f" {spec.unit}" if spec.unit else ""
    if range_too and spec.minimum is not None and value < spec.minimum:
        return f"must be at least {number_text(spec.minimum)}{unit}, found {found}"
    if range_too and spec.maximum is not None and value > spec.maximum:
        return f"must be at most {number_text(spec.maximum)}{unit}, found {found}"
    return ""


def check_commands(index: Index, commands: CommandDictionary) -> None:
    """Check actions and their parameters."""
    for entry in index.entries:
        task = entry.node
        if not isinstance(task, Task) or not task.action:
            continue
        action = commands.actions.get(task.action)
        if action is None:
            message = f'unknown action "{task.action}" (dictionary {commands.name} {commands.version})'
            index.add("E050", task, message, at="action", hint=nearest(task.action, commands.actions))
            continue
        specs = {spec.name: spec for spec in action.parameters}
        for name, value in task.parameters.items():
            spec = specs.get(name)
            if spec is None:
                message = f'action {action.name} has no parameter "{name}"'
                index.add("E051", task, message, at="parameters", hint=nearest(name, specs))
            elif problem := value_problem(spec, value):
                index.add("E052", task, f'parameter "{name}" of {action.name} {problem}', at="parameters")
        for spec in action.parameters:
            if spec.required and spec.name not in task.parameters:
                message = f'action {action.name} needs the parameter "{spec.name}"'
                index.add("E051", task, message, at="parameters")
        if action.one_of and not any(all(n in task.parameters for n in group) for group in action.one_of):
            groups = " or ".join(" with ".join(group) for group in action.one_of)
            index.add("E051", task, f"action {action.name} needs {groups}", at="parameters")


def check_telemetry(index: Index, telemetry: TelemetryDictionary) -> None:
    """Check the keys of conditions and consumables, and the values they are compared with."""
    for owner, field, condition in all_conditions(index):
        for leaf in leaves(condition):
            if leaf.key not in RESERVED_KEYS:
                _lookup(index, telemetry, owner, field, leaf)
    for resource in index.plan.resources:
        if isinstance(resource, ConsumableResource) and resource.key not in telemetry.keys:
            at = resource.source or "resources"
            _unknown(index, telemetry, index.plan, resource.key, at)


def _unknown(index: Index, telemetry: TelemetryDictionary, owner: Owner, key: str, at: Source | str) -> None:
    message = f'unknown key ":{key}" (dictionary {telemetry.name} {telemetry.version})'
    index.add("E042", owner, message, at=at, hint=nearest(key, telemetry.keys))


def _lookup(
    index: Index, telemetry: TelemetryDictionary, owner: Owner, field: str, leaf: Comparison | Known
) -> None:
    at = leaf.source or field
    spec = telemetry.keys.get(leaf.key)
    if spec is None:
        _unknown(index, telemetry, owner, leaf.key, at)
        return
    count = telemetry.arguments.get(leaf.key, 0)
    if len(leaf.arguments) != count:
        message = f'key ":{leaf.key}" takes {count} arguments, found {len(leaf.arguments)}'
        index.add("E042", owner, message, at=at)
    if isinstance(leaf, Comparison):
        equality = leaf.operator in (Operator.EQ, Operator.NE)
        if problem := value_problem(spec, leaf.value, range_too=equality):
            index.add("E043", owner, f'a comparison with ":{leaf.key}" {problem}', at=at)
