"""The JSON form of a plan, and back.

A form is an object: its head is `kind`, each field has its name without colon, lists are arrays. Reading goes
by way of the text, so that both forms obey one grammar and give the same messages.
"""

from __future__ import annotations

from collections.abc import Mapping
from typing import Any

from executive.crl import printer
from executive.crl.errors import CrlFormError, CrlSyntaxError
from executive.crl.lexer import is_keyword_name, is_symbol
from executive.crl.nodes import (
    Absolute,
    Alternate,
    Amount,
    And,
    Block,
    Branch,
    CapacityResource,
    Comparison,
    ConcurrentBlock,
    Condition,
    FloatingContingency,
    Interval,
    Known,
    Node,
    Not,
    Option,
    Plan,
    Reference,
    Resource,
    Task,
    Temporal,
    UnitResource,
    Utility,
    UtilityTable,
)
from executive.crl.printer import Tree
from executive.crl.reader import FIELDS, read

Json = dict[str, Any]

_KINDS: Mapping[type, str] = {
    Task: "task",
    Block: "block",
    ConcurrentBlock: "concurrent-block",
    Branch: "branch",
    Option: "option",
    FloatingContingency: "floating-contingency",
    Alternate: "alternate",
    Plan: "plan",
}
_HELD = {"node", "node-list", "options", "floating", "library"}
_DEFAULTS: dict[str, Json] = {}


# --- plan to JSON ---------------------------------------------------------------


def to_json(plan: Plan) -> Json:
    """Return the JSON form; fields at their default are left out. `from_json` gives an equal plan back."""
    done: dict[int, Json] = {}
    for tree in plan.trees():
        order: list[Node] = []
        stack = [tree]
        while stack:
            node = stack.pop()
            order.append(node)
            if isinstance(node, Branch):
                stack.extend(option.node for option in node.options)
            elif not isinstance(node, Task):
                stack.extend(node.node_list)
        for node in reversed(order):
            done[id(node)] = _form(node, done)
    return _form(plan, done)


def _form(value: Any, done: Mapping[int, Json]) -> Json:
    kind = _KINDS[type(value)]
    out: Json = {"kind": kind}
    for name in FIELDS[kind]:
        if name in _HELD:
            continue
        encoded = _encode(name, value)
        if encoded is not _OMIT and (name == "id" or encoded != _default(kind, name)):
            out[name] = encoded
    if isinstance(value, Branch):
        out["options"] = [_form(option, done) for option in value.options]
    elif isinstance(value, (Block, ConcurrentBlock)):
        out["node-list"] = [done[id(child)] for child in value.node_list]
    elif not isinstance(value, Task):
        if isinstance(value, Plan):
            if value.floating:
                out["floating"] = [_form(f, done) for f in value.floating]
            if value.library:
                out["library"] = [_form(a, done) for a in value.library]
        out["node"] = done[id(value.node)]
    return out


class _Omit:
    pass


_OMIT = _Omit()


def _default(kind: str, name: str) -> object:
    if kind not in _DEFAULTS:
        hole = Task(id="", action="")
        sample: Any = {
            "task": hole,
            "block": Block(id="", node_list=()),
            "concurrent-block": ConcurrentBlock(id="", node_list=()),
            "branch": Branch(id="", options=()),
            "option": Option(id="", node=hole),
            "floating-contingency": FloatingContingency(id="", node=hole),
            "alternate": Alternate(id="", node=hole),
            "plan": Plan(node=hole),
        }[kind]
        _DEFAULTS[kind] = {f: _encode(f, sample) for f in FIELDS[kind] if f not in _HELD}
    return _DEFAULTS[kind][name]


def _encode(name: str, owner: Any) -> object:
    """Return the JSON value of a field that holds no nodes."""
    if name == "retry-delay":
        return _seconds(owner.retry_delay_ms)
    value = getattr(owner, name.replace("-", "_"))
    if value is None:
        return _OMIT
    if name.endswith("temporal-conditions"):
        return [_temporal(t) for t in value]
    if name.endswith("conditions"):
        return [_condition(c) for c in value]
    match name:
        case "duration":
            return _interval(value)
        case "uses":
            return [a.resource if a.amount == 1 else [a.resource, a.amount] for a in value]
        case "requires" | "budgets":
            return [_amount(a) for a in value]
        case "expectations":
            return [[e.name, e.mean, e.spread] for e in value]
        case "metadata" | "parameters":
            return dict(value)
        case "utility":
            return _utility(value)
        case "resources":
            return [_resource(r) for r in value]
        case "on-resume" | "if-none" | "on-option-failure" | "mode" | "expectation-spread":
            return str(value)
        case _:
            return value


def _seconds(t_ms: int) -> float:
    return t_ms // 1000 if t_ms % 1000 == 0 else t_ms / 1000


def _interval(interval: Interval) -> Json:
    lo, hi = interval.lo_ms, interval.hi_ms
    return {"lo": None if lo is None else _seconds(lo), "hi": None if hi is None else _seconds(hi)}


def _temporal(temporal: Temporal) -> Json:
    if isinstance(temporal, Absolute):
        return {"ref": None, "point": None, **_interval(temporal.interval)}
    if isinstance(temporal, Reference):
        return {"ref": temporal.node, "point": temporal.point.value, **_interval(temporal.interval)}
    return {"ref": ":relative", "point": None, **_interval(temporal.interval)}


def _condition(condition: Condition) -> Json:
    if isinstance(condition, Comparison):
        return {
            "op": condition.operator.value,
            "key": condition.key,
            "args": list(condition.arguments),
            "value": condition.value,
        }
    if isinstance(condition, Known):
        return {"op": "known", "key": condition.key, "args": list(condition.arguments)}
    if isinstance(condition, Not):
        return {"not": _condition(condition.part)}
    return {"and" if isinstance(condition, And) else "or": [_condition(p) for p in condition.parts]}


def _amount(amount: Amount) -> list[object]:
    return [amount.resource, amount.amount]


def _utility(utility: Utility) -> object:
    if isinstance(utility, UtilityTable):
        return [[_seconds(t), u] for t, u in utility.points]
    return utility


def _resource(resource: Resource) -> Json:
    if isinstance(resource, UnitResource):
        return {"kind": "unit", "name": resource.name}
    if isinstance(resource, CapacityResource):
        return {"kind": "capacity", "name": resource.name, "capacity": resource.capacity}
    return {"kind": "consumable", "name": resource.name, "key": resource.key, "floor": resource.floor}


# --- JSON to plan ---------------------------------------------------------------


def from_json(document: object) -> Plan:
    """Return the plan of a JSON form (parsed JSON: dictionaries and lists).

    Raises
    ------
    CrlFormError
        If the document is not the JSON form of a plan; the message names the member.
    """
    reading = read(json_to_text(document), sources=False)
    errors = [finding for finding in reading.findings if finding.is_error]
    if errors or reading.plan is None:
        first = errors[0]
        raise CrlFormError(f"{first.code}: {first.message}") from CrlSyntaxError(
            first.message, code=first.code, line=first.line, column=first.column, node=first.node
        )
    return reading.plan


def json_to_text(document: object) -> str:
    """Return CRL text that says what a JSON form says; its form is checked by whoever reads it."""
    return printer.flat(_tree(document))


def _tree(document: object) -> list[Tree]:
    order: list[Json] = []
    stack: list[object] = [document]
    while stack:
        item = stack.pop()
        if not isinstance(item, dict):
            raise CrlFormError(f"a form is an object with a member kind, found {_show(item)}")
        order.append(item)
        for name in _HELD & item.keys():
            stack.extend(_held(name, item[name]))
    done: dict[int, list[Tree]] = {}
    for form in reversed(order):
        done[id(form)] = _form_tree(form, done)
    return done[id(order[0])]


def _held(name: str, value: object) -> list[object]:
    if name == "node":
        return [value]
    if not isinstance(value, list):
        raise CrlFormError(f'"{name}" needs an array, found {_show(value)}')
    return value


def _form_tree(form: Json, done: Mapping[int, list[Tree]]) -> list[Tree]:
    kind = form.get("kind")
    if not isinstance(kind, str) or not is_symbol(kind):
        raise CrlFormError(f'"kind" needs the head of a form, found {_show(kind)}')
    out: list[Tree] = [kind]
    for name, value in form.items():
        if name == "kind":
            continue
        if not is_keyword_name(name):
            raise CrlFormError(f"{_show(name)} is no field of {kind}")
        out.append(f":{name}")
        if name == "node":
            out.append(done[id(value)])
        elif name in _HELD:
            out.append([done[id(child)] for child in value])
        else:
            out.append(_decode(name, value))
    return out


def _decode(name: str, value: object) -> Tree:
    if name.endswith("temporal-conditions"):
        return [_temporal_tree(name, t) for t in _array(name, value)]
    if name.endswith("conditions"):
        return [_condition_tree(name, c) for c in _array(name, value)]
    match name:
        case "id" | "action" | "scope":
            return _symbol(name, value)
        case "name" | "epoch":
            return printer.string_text(value) if isinstance(value, str) else _generic(name, value)
        case "duration":
            return _interval_tree(name, value)
        case "metadata" | "parameters":
            return _parameters_tree(name, value)
        case "resources":
            return [_resource_tree(r) for r in _array(name, value)]
        case "on-resume" | "if-none" | "on-option-failure" | "mode" | "expectation-spread":
            return _keyword(name, value)
        case _:
            return _generic(name, value)


def _show(value: object) -> str:
    text = repr(value)
    return text if len(text) < 40 else text[:37] + "..."


def _array(name: str, value: object) -> list[object]:
    if not isinstance(value, list):
        raise CrlFormError(f'"{name}" needs an array, found {_show(value)}')
    return value


def _symbol(name: str, value: object) -> str:
    if not isinstance(value, str) or not is_symbol(value):
        raise CrlFormError(f'"{name}" needs a symbol, found {_show(value)}')
    return value


def _keyword(name: str, value: object) -> str:
    if not isinstance(value, str) or not is_keyword_name(value):
        raise CrlFormError(f'"{name}" needs a word, found {_show(value)}')
    return f":{value}"


def _generic(name: str, value: object) -> Tree:
    """Return numbers, truths, words and arrays of them as they stand; the reader judges them."""
    if isinstance(value, list):
        return [_generic(name, v) for v in value]
    return _scalar(name, value)


def _scalar(name: str, value: object) -> str:
    if isinstance(value, (str, bool, int, float)):
        try:
            return printer.value_text(value)
        except (ValueError, OverflowError) as error:
            raise CrlFormError(f'"{name}": {error}') from error
    raise CrlFormError(f'"{name}" needs a number, string or truth value, found {_show(value)}')


def _bound(name: str, value: object, infinite: str) -> str:
    if value is None:
        return infinite
    if isinstance(value, bool) or not isinstance(value, (int, float)):
        raise CrlFormError(f'"{name}" needs numbers or null as bounds, found {_show(value)}')
    return _scalar(name, value)


def _interval_tree(name: str, value: object) -> list[Tree]:
    if not isinstance(value, dict) or not {"lo", "hi"} <= value.keys():
        raise CrlFormError(f'"{name}" needs an object with lo and hi, found {_show(value)}')
    return [_bound(name, value["lo"], ":minus-infinity"), _bound(name, value["hi"], ":plus-infinity")]


def _temporal_tree(name: str, value: object) -> list[Tree]:
    interval = _interval_tree(name, value)
    assert isinstance(value, dict)
    reference = value.get("ref")
    if reference is None:
        return interval
    if reference == ":relative":
        return [":relative", interval]
    return [_symbol(name, reference), _symbol(name, value.get("point")), interval]


def _condition_tree(name: str, value: object) -> list[Tree]:
    if not isinstance(value, dict):
        raise CrlFormError(f'"{name}" needs conditions as objects, found {_show(value)}')
    if len(value) == 1:
        head, parts = next(iter(value.items()))
        if head == "not":
            return ["not", _condition_tree(name, parts)]
        if head in ("and", "or"):
            return [head, *(_condition_tree(name, part) for part in _array(name, parts))]
    operator, key = value.get("op"), value.get("key")
    if not isinstance(key, str) or not is_keyword_name(key):
        raise CrlFormError(f'"{name}" has a condition with a bad key: {_show(value)}')
    inner: list[Tree] = [f":{key}"]
    for argument in _array(name, value.get("args", [])):
        if isinstance(argument, str):
            inner.append(argument if is_symbol(argument) else printer.string_text(argument))
        elif isinstance(argument, bool):
            raise CrlFormError(f'"{name}" has a truth value as an argument of {key}')
        else:
            inner.append(_scalar(name, argument))
    if operator == "known":
        return ["known", inner]
    if operator not in ("=", "/=", "<", "<=", ">", ">="):
        raise CrlFormError(f'"{name}" has a condition with a bad op: {_show(value)}')
    inner += (operator, _scalar(name, value.get("value")))
    return ["database", inner]


def _parameters_tree(name: str, value: object) -> list[Tree]:
    if not isinstance(value, dict):
        raise CrlFormError(f'"{name}" needs an object, found {_show(value)}')
    out: list[Tree] = []
    for key, entry in value.items():
        out += (_symbol(name, key), "=", _scalar(name, entry))
    return out


def _resource_tree(value: object) -> list[Tree]:
    if not isinstance(value, dict):
        raise CrlFormError(f'"resources" needs objects, found {_show(value)}')
    out: list[Tree] = [_symbol("resources", value.get("name")), _keyword("resources", value.get("kind"))]
    if value.get("kind") == "capacity":
        out.append(_scalar("resources", value.get("capacity")))
    elif value.get("kind") == "consumable":
        out += (":key", _keyword("resources", value.get("key")))
        out += (":floor", _scalar("resources", value.get("floor", 0)))
    return out
