"""Values of fields as parsed JSON, and back to trees of strings."""

from __future__ import annotations

from executive.crl import trees
from executive.crl.errors import CrlFormError
from executive.crl.lexer import is_keyword_name, is_symbol
from executive.crl.trees import Tree
from executive.crl.values import (
    Absolute,
    Amount,
    And,
    CapacityResource,
    Comparison,
    Condition,
    Expectation,
    Interval,
    Known,
    Not,
    Reference,
    Resource,
    Temporal,
    UnitResource,
    Utility,
    UtilityTable,
)

Json = dict[str, object]


# --- to JSON ------------------------------------------------------------------------


def seconds_json(t_ms: int) -> float:
    return t_ms // 1000 if t_ms % 1000 == 0 else t_ms / 1000


def interval_json(value: Interval) -> Json:
    lo, hi = value.lo_ms, value.hi_ms
    return {"lo": None if lo is None else seconds_json(lo), "hi": None if hi is None else seconds_json(hi)}


def temporal_json(temporal: Temporal) -> Json:
    if isinstance(temporal, Absolute):
        return {"ref": None, "point": None, **interval_json(temporal.interval)}
    if isinstance(temporal, Reference):
        return {"ref": temporal.node, "point": temporal.point.value, **interval_json(temporal.interval)}
    return {"ref": ":relative", "point": None, **interval_json(temporal.interval)}


def condition_json(condition: Condition) -> Json:
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
        return {"not": condition_json(condition.part)}
    return {"and" if isinstance(condition, And) else "or": [condition_json(p) for p in condition.parts]}


def amount_json(amount: Amount) -> list[object]:
    return [amount.resource, amount.amount]


def utility_json(utility: Utility) -> object:
    if isinstance(utility, UtilityTable):
        return [[seconds_json(t), u] for t, u in utility.points]
    return utility


def resource_json(resource: Resource) -> Json:
    if isinstance(resource, UnitResource):
        return {"kind": "unit", "name": resource.name}
    if isinstance(resource, CapacityResource):
        return {"kind": "capacity", "name": resource.name, "capacity": resource.capacity}
    return {"kind": "consumable", "name": resource.name, "key": resource.key, "floor": resource.floor}


def use_json(amount: Amount) -> object:
    """Return an entry of `:uses`: a name alone where one is used."""
    return amount.resource if amount.amount == 1 else amount_json(amount)


def expectation_json(expectation: Expectation) -> list[object]:
    """Return name, mean and spread."""
    return [expectation.name, expectation.mean, expectation.spread]


# --- from JSON ----------------------------------------------------------------------


def shown(value: object) -> str:
    text = repr(value)
    return text if len(text) < 40 else text[:37] + "..."


def array(name: str, value: object) -> list[object]:
    if not isinstance(value, list):
        raise CrlFormError(f'"{name}" needs an array, found {shown(value)}')
    return value


def symbol_tree(name: str, value: object) -> str:
    if not isinstance(value, str) or not is_symbol(value):
        raise CrlFormError(f'"{name}" needs a symbol, found {shown(value)}')
    return value


def keyword_tree(name: str, value: object) -> str:
    if not isinstance(value, str) or not is_keyword_name(value):
        raise CrlFormError(f'"{name}" needs a word, found {shown(value)}')
    return f":{value}"


def generic_tree(name: str, value: object) -> Tree:
    """Return numbers, truths, words and arrays of them as they stand; the reader judges them."""
    if isinstance(value, list):
        return [generic_tree(name, v) for v in value]
    return _scalar(name, value)


def _scalar(name: str, value: object) -> str:
    if isinstance(value, (str, bool, int, float)):
        try:
            return trees.value_text(value)
        except (ValueError, OverflowError) as error:
            raise CrlFormError(f'"{name}": {error}') from error
    raise CrlFormError(f'"{name}" needs a number, string or truth value, found {shown(value)}')


def _bound(name: str, value: object, infinite: str) -> str:
    if value is None:
        return infinite
    if isinstance(value, bool) or not isinstance(value, (int, float)):
        raise CrlFormError(f'"{name}" needs numbers or null as bounds, found {shown(value)}')
    return _scalar(name, value)


def json_interval_tree(name: str, value: object) -> list[Tree]:
    if not isinstance(value, dict) or not {"lo", "hi"} <= value.keys():
        raise CrlFormError(f'"{name}" needs an object with lo and hi, found {shown(value)}')
    return [_bound(name, value["lo"], ":minus-infinity"), _bound(name, value["hi"], ":plus-infinity")]


def json_temporal_tree(name: str, value: object) -> list[Tree]:
    interval = json_interval_tree(name, value)
    assert isinstance(value, dict)
    reference = value.get("ref")
    if reference is None:
        return interval
    if reference == ":relative":
        return [":relative", interval]
    return [symbol_tree(name, reference), symbol_tree(name, value.get("point")), interval]


def json_condition_tree(name: str, value: object) -> list[Tree]:
    if not isinstance(value, dict):
        raise CrlFormError(f'"{name}" needs conditions as objects, found {shown(value)}')
    if len(value) == 1:
        head, parts = next(iter(value.items()))
        if head == "not":
            return ["not", json_condition_tree(name, parts)]
        if head in ("and", "or"):
            return [head, *(json_condition_tree(name, part) for part in array(name, parts))]
    operator, key = value.get("op"), value.get("key")
    if not isinstance(key, str) or not is_keyword_name(key):
        raise CrlFormError(f'"{name}" has a condition with a bad key: {shown(value)}')
    inner: list[Tree] = [f":{key}"]
    for argument in array(name, value.get("args", [])):
        if isinstance(argument, str):
            inner.append(argument if is_symbol(argument) else trees.string_text(argument))
        elif isinstance(argument, bool):
            raise CrlFormError(f'"{name}" has a truth value as an argument of {key}')
        else:
            inner.append(_scalar(name, argument))
    if operator == "known":
        return ["known", inner]
    if operator not in ("=", "/=", "<", "<=", ">", ">="):
        raise CrlFormError(f'"{name}" has a condition with a bad op: {shown(value)}')
    inner += (operator, _scalar(name, value.get("value")))
    return ["database", inner]


def json_parameters_tree(name: str, value: object) -> list[Tree]:
    if not isinstance(value, dict):
        raise CrlFormError(f'"{name}" needs an object, found {shown(value)}')
    out: list[Tree] = []
    for key, entry in value.items():
        out += (symbol_tree(name, key), "=", _scalar(name, entry))
    return out


def json_resource_tree(_name: str, value: object) -> list[Tree]:
    if not isinstance(value, dict):
        raise CrlFormError(f'"resources" needs objects, found {shown(value)}')
    out: list[Tree] = [
        symbol_tree("resources", value.get("name")),
        keyword_tree("resources", value.get("kind")),
    ]
    if value.get("kind") == "capacity":
        out.append(_scalar("resources", value.get("capacity")))
    elif value.get("kind") == "consumable":
        out += (":key", keyword_tree("resources", value.get("key")))
        out += (":floor", _scalar("resources", value.get("floor", 0)))
    return out


def string_tree(name: str, value: object) -> Tree:
    """Return a quoted string; what is none stands as it is, the reader judges it."""
    return trees.string_text(value) if isinstance(value, str) else generic_tree(name, value)
