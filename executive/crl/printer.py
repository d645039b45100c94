"""Plan to text: the canonical form, which the digest is taken of, and a readable one.

Both are built from the same pieces, so they differ in white space alone.
"""

from __future__ import annotations

import hashlib
import math
from collections.abc import Iterable, Iterator, Mapping
from typing import TypeAlias

from executive.crl.lexer import is_symbol
from executive.crl.nodes import (
    DEFAULT_PRIORITY,
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
    Conditions,
    Expectation,
    FloatingContingency,
    IfNone,
    Interval,
    Known,
    Mode,
    Node,
    Not,
    OnOptionFailure,
    OnResume,
    Option,
    Plan,
    Reference,
    Resource,
    Spread,
    Task,
    Temporal,
    UnitResource,
    Utility,
    UtilityTable,
    Value,
)

Tree: TypeAlias = "str | list[Tree]"
WIDTH = 100

_KIND: Mapping[type, str] = {
    Task: "task",
    Block: "block",
    ConcurrentBlock: "concurrent-block",
    Branch: "branch",
}


def canonical_text(plan: Plan) -> str:
    """Return the one text of a plan: fields in grammar order, single spaces, defaults left out."""
    return flat(_plan(plan))


def digest(plan: Plan) -> str:
    """Return the SHA-256 of the canonical text in hexadecimal, the identity of a plan."""
    return hashlib.sha256(canonical_text(plan).encode()).hexdigest()


def canonical_node(node: Node) -> str:
    """Return the canonical text of one node; two tasks are identical iff these are equal."""
    return flat(_node(node))


def readable_text(plan: Plan) -> str:
    """Return the text for people: one field a line where a form does not fit into a line."""
    return _pretty(_plan(plan)) + "\n"


def number_text(number: float) -> str:
    """Return the shortest decimal number that reads back as the same binary64 value.

    Written without exponent from 1e-6 up to below 1e21, as in RFC 8785.
    """
    if isinstance(number, int):
        if -(2**53) < number < 2**53:
            return str(number)
        number = float(number)
    if not math.isfinite(number):
        raise ValueError(f"{number} cannot be written in CRL")
    if number.is_integer() and abs(number) < 1e21:
        return str(int(number))
    mantissa, _, exponent = repr(number).partition("e")
    if not exponent:
        return mantissa
    power = int(exponent)
    if power == -5 or power == -6:
        sign = "-" if mantissa.startswith("-") else ""
        digits = mantissa.lstrip("-").replace(".", "")
        return f"{sign}0.{'0' * (-power - 1)}{digits}"
    return f"{mantissa.removesuffix('.0')}e{power:+d}"


def ms_text(t_ms: int) -> str:
    """Return a time in milliseconds as seconds."""
    seconds, rest = divmod(abs(t_ms), 1000)
    sign = "-" if t_ms < 0 else ""
    return f"{sign}{seconds}.{rest:03d}".rstrip("0") if rest else f"{sign}{seconds}"


def string_text(text: str) -> str:
    """Return a quoted string."""
    escaped = text.replace("\\", "\\\\").replace('"', '\\"')
    return f'"{escaped}"'


def value_text(value: Value) -> str:
    """Return a value, as a symbol where it can be read as one."""
    if value is True:
        return "t"
    if value is False:
        return "nil"
    if isinstance(value, str):
        if is_symbol(value) and value not in ("t", "true", "nil"):
            return value
        return string_text(value)
    return number_text(value)


# --- trees of strings -----------------------------------------------------------


def _plan(plan: Plan) -> list[Tree]:
    out: list[Tree] = ["plan"]
    _text(out, ":id", plan.id)
    _string(out, ":name", plan.name)
    if plan.version is not None:
        out += (":version", number_text(plan.version))
    _string(out, ":epoch", plan.epoch)
    _list(out, ":resources", map(_resource, plan.resources))
    _list(out, ":floating", map(_floating, plan.floating))
    _list(out, ":library", map(_alternate, plan.library))
    if plan.expectation_spread is not Spread.STDDEV:
        out += (":expectation-spread", f":{plan.expectation_spread}")
    if plan.overrun_penalty != 0:
        out += (":overrun-penalty", number_text(plan.overrun_penalty))
    _list(out, ":budgets", map(_amount, plan.budgets))
    out += (":node", _node(plan.node))
    _parameters(out, ":metadata", plan.metadata)
    return out


def _node(root: Node) -> list[Tree]:
    """Return the tree of a node; children are done before parents, without recursion."""
    order: list[Node] = []
    stack = [root]
    while stack:
        node = stack.pop()
        order.append(node)
        if isinstance(node, Branch):
            stack.extend(o.node for o in node.options)
        elif not isinstance(node, Task):
            stack.extend(node.node_list)
    done: dict[int, list[Tree]] = {}
    for node in reversed(order):
        done[id(node)] = _single(node, done)
    return done[id(root)]


def _single(node: Node, done: Mapping[int, list[Tree]]) -> list[Tree]:
    out: list[Tree] = [_KIND[type(node)], ":id", node.id]
    _string(out, ":name", node.name)
    _list(out, ":start-conditions", map(condition_tree, node.start_conditions))
    _list(out, ":wait-for-conditions", map(condition_tree, node.wait_for_conditions))
    _list(out, ":maintain-conditions", map(condition_tree, node.maintain_conditions))
    _list(out, ":end-conditions", map(condition_tree, node.end_conditions))
    _list(out, ":start-temporal-conditions", map(temporal_tree, node.start_temporal_conditions))
    _list(out, ":end-temporal-conditions", map(temporal_tree, node.end_temporal_conditions))
    if node.duration is not None:
        out += (":duration", interval_tree(node.duration))
    if node.continue_on_failure:
        out += (":continue-on-failure", "t")
    _list(out, ":uses", map(_use, node.uses))
    _list(out, ":requires", map(_amount, node.requires))
    if node.priority != DEFAULT_PRIORITY:
        out += (":priority", number_text(node.priority))
    if node.reward != 0:
        out += (":reward", number_text(node.reward))
    if node.probability is not None:
        out += (":probability", number_text(node.probability))
    _list(out, ":expectations", map(_expectation, node.expectations))
    _parameters(out, ":metadata", node.metadata)
    if isinstance(node, Task):
        out += (":action", node.action)
        _parameters(out, ":parameters", node.parameters)
        if node.retries != 0:
            out += (":retries", number_text(node.retries))
        if node.retry_delay_ms != 0:
            out += (":retry-delay", ms_text(node.retry_delay_ms))
        if not node.interruptible:
            out += (":interruptible", "nil")
        if node.on_resume is not OnResume.REATTACH:
            out += (":on-resume", f":{node.on_resume}")
    elif isinstance(node, Branch):
        out += (":options", [_option(o, done) for o in node.options])
        if node.if_none is not IfNone.FAIL:
            out += (":if-none", f":{node.if_none}")
        if node.on_option_failure is not OnOptionFailure.FAIL:
            out += (":on-option-failure", f":{node.on_option_failure}")
    else:
        out += (":node-list", [done[id(child)] for child in node.node_list])
    return out


def _option(option: Option, done: Mapping[int, list[Tree]]) -> list[Tree]:
    out: list[Tree] = ["option", ":id", option.id]
    _string(out, ":name", option.name)
    _utility(out, option.utility)
    if option.probability is not None:
        out += (":probability", number_text(option.probability))
    _list(out, ":eligible-conditions", map(condition_tree, option.eligible_conditions))
    _list(out, ":requires", map(_amount, option.requires))
    out += (":node", done[id(option.node)])
    _parameters(out, ":metadata", option.metadata)
    return out


def _floating(floating: FloatingContingency) -> list[Tree]:
    out: list[Tree] = ["floating-contingency", ":id", floating.id]
    _string(out, ":name", floating.name)
    _list(out, ":trigger-conditions", map(condition_tree, floating.trigger_conditions))
    _utility(out, floating.utility)
    if floating.mode is not Mode.BETWEEN:
        out += (":mode", f":{floating.mode}")
    _text(out, ":scope", floating.scope)
    if floating.max_insertions != 1:
        out += (":max-insertions", number_text(floating.max_insertions))
    if not floating.continue_on_failure:
        out += (":continue-on-failure", "nil")
    out += (":node", _node(floating.node))
    _parameters(out, ":metadata", floating.metadata)
    return out


def _alternate(alternate: Alternate) -> list[Tree]:
    out: list[Tree] = ["alternate", ":id", alternate.id]
    _string(out, ":name", alternate.name)
    _list(out, ":eligible-conditions", map(condition_tree, alternate.eligible_conditions))
    _utility(out, alternate.utility)
    _list(out, ":requires", map(_amount, alternate.requires))
    out += (":node", _node(alternate.node))
    _parameters(out, ":metadata", alternate.metadata)
    return out


def _resource(resource: Resource) -> list[Tree]:
    if isinstance(resource, UnitResource):
        return [resource.name, ":unit"]
    if isinstance(resource, CapacityResource):
        return [resource.name, ":capacity", number_text(resource.capacity)]
    out: list[Tree] = [resource.name, ":consumable", ":key", f":{resource.key}"]
    if resource.floor != 0:
        out += (":floor", number_text(resource.floor))
    return out


def _amount(amount: Amount) -> list[Tree]:
    return [amount.resource, number_text(amount.amount)]


def _use(amount: Amount) -> Tree:
    return amount.resource if amount.amount == 1 else _amount(amount)


def _expectation(expectation: Expectation) -> list[Tree]:
    return [expectation.name, number_text(expectation.mean), number_text(expectation.spread)]


def interval_tree(interval: Interval) -> list[Tree]:
    """Return `(lo hi)` in pieces."""
    return [
        ":minus-infinity" if interval.lo_ms is None else ms_text(interval.lo_ms),
        ":plus-infinity" if interval.hi_ms is None else ms_text(interval.hi_ms),
    ]


def temporal_tree(temporal: Temporal) -> list[Tree]:
    """Return a temporal condition in pieces."""
    if isinstance(temporal, Absolute):
        return interval_tree(temporal.interval)
    if isinstance(temporal, Reference):
        return [temporal.node, temporal.point.value, interval_tree(temporal.interval)]
    return [":relative", interval_tree(temporal.interval)]


def temporal_text(temporal: Temporal) -> str:
    """Return a temporal condition as it stands in a plan."""
    return flat(temporal_tree(temporal))


def _lookup(key: str, arguments: tuple[str | float, ...]) -> list[Tree]:
    out: list[Tree] = [f":{key}"]
    for argument in arguments:
        if isinstance(argument, str):
            out.append(argument if is_symbol(argument) else string_text(argument))
        else:
            out.append(number_text(argument))
    return out


def condition_tree(condition: Condition) -> list[Tree]:
    """Return a condition in pieces."""
    if isinstance(condition, Comparison):
        inner = _lookup(condition.key, condition.arguments)
        inner += (condition.operator.value, value_text(condition.value))
        return ["database", inner]
    if isinstance(condition, Known):
        return ["known", _lookup(condition.key, condition.arguments)]
    if isinstance(condition, Not):
        return ["not", condition_tree(condition.part)]
    head = "and" if isinstance(condition, And) else "or"
    return [head, *(condition_tree(part) for part in condition.parts)]


def condition_text(condition: Condition) -> str:
    """Return a condition as it stands in a plan."""
    return flat(condition_tree(condition))


def conditions_text(conditions: Conditions) -> str:
    """Return a list of conditions as it stands in a plan."""
    return flat([condition_tree(c) for c in conditions])


def _utility(out: list[Tree], utility: Utility) -> None:
    if isinstance(utility, UtilityTable):
        out += (":utility", [[ms_text(t), number_text(u)] for t, u in utility.points])
    elif utility != 0:
        out += (":utility", number_text(utility))


def _text(out: list[Tree], name: str, text: str | None) -> None:
    if text is not None:
        out += (name, text)


def _string(out: list[Tree], name: str, text: str | None) -> None:
    if text is not None:
        out += (name, string_text(text))


def _list(out: list[Tree], name: str, entries: Iterable[Tree]) -> None:
    found = list(entries)
    if found:
        out += (name, found)


def _parameters(out: list[Tree], name: str, parameters: Mapping[str, Value]) -> None:
    if parameters:
        entries: list[Tree] = []
        for key, value in parameters.items():
            entries += (key, "=", value_text(value))
        out += (name, entries)


# --- layout ---------------------------------------------------------------------


def flat(tree: Tree) -> str:
    """Return a tree in one line, without recursion."""
    pieces: list[str] = []
    stack: list[Iterator[Tree]] = [iter([tree])]
    space = False
    while stack:
        for item in stack[-1]:
            if space:
                pieces.append(" ")
            if isinstance(item, str):
                pieces.append(item)
                space = True
            else:
                pieces.append("(")
                space = False
                stack.append(iter(item))
                break
        else:
            stack.pop()
            if stack:
                pieces.append(")")
                space = True
    return "".join(pieces)


def _pretty(tree: list[Tree]) -> str:
    """Return a tree broken into lines of about `WIDTH` characters; each form's fields are aligned."""
    sizes: dict[int, int] = {}
    _measure(tree, sizes)
    out: list[str] = []
    stack: list[tuple[Tree | str, int]] = [(tree, 0)]
    # Entries are trees to be laid out at an indent, or, with indent -1, text to be written as it is.
    while stack:
        item, indent = stack.pop()
        if isinstance(item, str):
            out.append(item)
            continue
        if indent + sizes[id(item)] <= WIDTH or not _is_long(item):
            out.append(flat(item))
            continue
        out.append("(")
        parts: list[tuple[Tree | str, int]] = []
        inner = indent + 1
        start = 0
        if isinstance(item[0], str):
            # A form: its head, `:id x` beside it, then a field a line.
            head = [item[0]]
            start = 1
            if len(item) > 2 and item[1] == ":id" and isinstance(item[2], str):
                head += (item[1], item[2])
                start = 3
            parts.append((" ".join(map(str, head)), -1))
            inner = indent + 2
        at = start
        while at < len(item):
            name = item[at]
            if parts:
                parts.append(("\n" + " " * inner, -1))
            if isinstance(name, str) and name.startswith(":") and at + 1 < len(item):
                value = item[at + 1]
                parts.append((name + " ", -1))
                size = 0 if isinstance(value, str) else sizes[id(value)]
                if inner + len(name) + 1 + size > WIDTH and _is_long(value):
                    parts.append(("\n" + " " * inner, -1))
                    parts[-2] = (name, -1)
                    parts.append((value, inner))
                else:
                    parts.append((value, inner + len(name) + 1))
                at += 2
            else:
                parts.append((name, inner))
                at += 1
        parts.append((")", -1))
        stack.extend(reversed(parts))
    return "".join(out)


def _is_long(tree: Tree) -> bool:
    """Tell whether a tree is worth breaking: a form with fields, or a list of lists."""
    if isinstance(tree, str) or not tree:
        return False
    return any(isinstance(item, list) for item in tree)


def _measure(tree: Tree, sizes: dict[int, int]) -> None:
    order: list[list[Tree]] = []
    stack: list[Tree] = [tree]
    while stack:
        top = stack.pop()
        if not isinstance(top, str):
            order.append(top)
            stack.extend(top)
    for item in reversed(order):
        inside = sum(len(part) if isinstance(part, str) else sizes[id(part)] for part in item)
        sizes[id(item)] = inside + max(len(item) - 1, 0) + 2
