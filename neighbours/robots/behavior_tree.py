"""A plan as XML of BehaviorTree.CPP 4, with the list of what that language cannot say.

Blocks become `Sequence`, concurrent blocks `Parallel`, branches `IfThenElse` (with `Fallback` where the
next option is tried), the library a `Fallback` round the main tree. Actions of the plan become leaves of
their own names. Five leaves and decorators are of this project, as the language has nothing that does the
same; they are declared in the file's `TreeNodesModel` (`MODEL` below says what each promises): `Holds`,
`NotFalse`, `WaitWindow`, `Deadline` and `Using`. Times that windows count from are blackboard entries in
milliseconds, written by scripts; `t_ms` is the clock of the plan, kept by the program that ticks the tree.
"""

from __future__ import annotations

import math
import re
from collections.abc import Iterable, Mapping, Sequence
from copy import deepcopy
from dataclasses import dataclass, field
from itertools import combinations, pairwise
from xml.etree import ElementTree

from executive.crl.nodes import (
    Block,
    Branch,
    ConcurrentBlock,
    Node,
    Plan,
    Task,
    children,
    end_temporals,
    walk_plan,
)
from executive.crl.printer import conditions_text
from executive.crl.values import (
    Absolute,
    Amount,
    And,
    Comparison,
    Condition,
    Conditions,
    ConsumableResource,
    IfNone,
    OnOptionFailure,
    Operator,
    Or,
    Reference,
    Relative,
    Temporal,
    Utility,
    UtilityTable,
    Value,
    utility_at,
)
from executive.engine.compile_plan import shortest
from neighbours.robots.tree_limits import (
    FORBIDDEN,
    Family,
    Lacking,
    contested,
    lacking_of,
    leaves,
    node_conditions,
)

CLOCK = "t_ms"
"""Blackboard entry with the time of the plan clock, in milliseconds."""
NEVER, VOID = -1, -2
"""What a recorded point holds while it has not occurred, and when it never will."""

Model = Mapping[str, tuple[str, str, Mapping[str, tuple[str, str]]]]
_WINDOWS = (
    "list of BASE LO HI, separated by semicolons, in milliseconds, - for no bound; BASE is t_ms for the "
    "clock itself, else a blackboard entry: the time counted from, -1 not yet, -2 never"
)
MODEL: Model = {
    "Holds": (
        "Condition",
        "SUCCESS if all conditions are true, else FAILURE; comparing with an unknown key is not true",
        {"when": ("std::string", "conditions in CRL; the key `outcome X` is the entry outcome_X")},
    ),
    "NotFalse": (
        "Condition",
        "FAILURE if a condition is false, else SUCCESS; comparing with an unknown key is not false",
        {"when": ("std::string", "conditions in CRL")},
    ),
    "WaitWindow": (
        "Action",
        "RUNNING until the clock lies in all windows, every base with a lower bound has occurred or never "
        "will, and the conditions are true, then SUCCESS; FAILURE when an upper bound is reached before",
        {"within": ("std::string", _WINDOWS), "when": ("std::string", "conditions in CRL, may be empty")},
    ),
    "Deadline": (
        "Decorator",
        "as its child, but when an upper bound is reached it halts the child and gives FAILURE; a child that "
        "returns SUCCESS after an upper bound is FAILURE too",
        {"within": ("std::string", _WINDOWS)},
    ),
    "Using": (
        "Decorator",
        "waits as WaitWindow does, and until all its resources are free at once; takes them, ticks its child "
        "and releases them when that is over or halted. Of those that wait, the one with the smallest "
        "priority goes first, then the one that has waited longest, then the first in the file",
        {
            "resources": ("std::string", "list of NAME AMOUNT CAPACITY, separated by semicolons"),
            "priority": ("double", "smaller is more urgent"),
            "within": ("std::string", _WINDOWS),
            "when": ("std::string", "conditions in CRL, may be empty"),
        },
    ),
}
_BUILT_IN = """
    Action AlwaysFailure AlwaysSuccess AsyncFallback AsyncSequence BehaviorTree Condition Control
    Decorator Delay EntryUpdated Fallback ForceFailure ForceSuccess IfThenElse Inverter
    KeepRunningUntilFailure LoopDouble LoopString ManualSelector Parallel ParallelAll Precondition
    ReactiveFallback ReactiveSequence Repeat RetryUntilSuccessful RunOnce Script ScriptCondition
    Sequence SequenceWithMemory SetBlackboard SkipUnlessUpdated Sleep SubTree Switch2 Switch3
    Switch4 Switch5 Switch6 TestNode Timeout TreeNodesModel UnsetBlackboard WaitValueUpdate
    WasEntryUpdated WhileDoElse
"""
BUILT_IN = frozenset(_BUILT_IN.split())
"""Names that BehaviorTree.CPP 4 gives to nodes and elements of its own."""

Element = ElementTree.Element


@dataclass(frozen=True, slots=True)
class BehaviorTree:
    """The XML of a plan, and what of the plan it does not say; exact if that is nothing."""

    xml: str
    lacking: tuple[Lacking, ...]


def behavior_tree(plan: Plan) -> BehaviorTree:
    """Return a valid plan as BehaviorTree.CPP 4 XML.

    What does not fit is left out of the tree and marked there by a comment before its node.
    """
    lacking = lacking_of(plan)
    writer = _Writer(plan)
    name = plan.id or "plan"
    root = ElementTree.Element("root", {"BTCPP_format": "4", "main_tree_to_execute": name})
    tree = ElementTree.SubElement(root, "BehaviorTree", {"ID": name})
    tree.append(writer.whole())
    root.append(writer.model())
    _mark(root, tree, lacking)
    ElementTree.indent(root)
    text = ElementTree.tostring(root, encoding="unicode")
    return BehaviorTree(f'<?xml version="1.0" encoding="UTF-8"?>\n{text}\n', lacking)


def _mark(root: Element, tree: Element, lacking: Sequence[Lacking]) -> None:
    """Put a comment before the first element of each node that is not said exactly."""
    places: dict[str, tuple[Element, Element]] = {}
    for parent in tree.iter():
        for child in parent:
            places.setdefault(child.get("name", ""), (parent, child))
    for one in lacking:
        text = FORBIDDEN.sub("\ufffd", re.sub("-(?=-|$)", "- ", f" not said: {one} "))
        parent, child = places.get(one.node, (root, tree))
        parent.insert(list(parent).index(child), ElementTree.Comment(text))


# --- scripts ------------------------------------------------------------------------


def entry(text: str) -> str:
    """Return an identifier of the scripting language for an id of a plan; two ids never share one."""
    return re.sub(r"[^A-Za-z0-9]", lambda m: f"_{ord(m[0]):x}_", text)


@dataclass(slots=True)
class _Recorded:
    """Nodes whose points in time, or whose outcomes, something in the plan asks for."""

    times: set[str] = field(default_factory=set)
    outcomes: set[str] = field(default_factory=set)

    @classmethod
    def of(cls, plan: Plan) -> _Recorded:
        found = cls()
        for node in walk_plan(plan):
            for temporal in (*node.start_temporal_conditions, *end_temporals(node)):
                if isinstance(temporal, Reference):
                    found.times.add(temporal.node)
            if _holds(node) or (_deadlines(node) and _timeout_ms(node) is None):
                found.times.add(node.id)
            for _, conditions in node_conditions(node):
                found.ask(conditions)
            for option in node.options if isinstance(node, Branch) else ():
                found.ask(option.eligible_conditions)
        for alternate in plan.library:
            found.ask(alternate.eligible_conditions)
        return found

    def ask(self, conditions: Conditions) -> None:
        asked = (leaf for leaf in leaves(conditions) if leaf.key == "outcome" and leaf.arguments)
        self.outcomes.update(str(leaf.arguments[0]) for leaf in asked)

    def begin(self) -> str:
        """Return the script that runs before everything else."""
        parts = [f"{p}_{entry(n)} := {NEVER}" for n in sorted(self.times) for p in ("start", "end")]
        return "; ".join([*parts, *(f"outcome_{entry(n)} := ''" for n in sorted(self.outcomes))])

    def ended(self, node: str, outcome: str) -> list[str]:
        """Return what is written when a node ends; `aborted` before its start is `skipped`."""
        name, script = entry(node), []
        if node in self.outcomes:
            script.append(f"outcome_{name} := '{outcome}'")
        if node in self.times:
            script.append(f"end_{name} := (start_{name} < 0) ? {VOID} : {CLOCK}")
            script.append(f"start_{name} := (start_{name} < 0) ? {VOID} : start_{name}")
        return script

    def void(self, nodes: Iterable[str]) -> list[str]:
        """Return what is written of nodes that, if they have not run by now, never will."""
        script = []
        for node in nodes:
            name = entry(node)
            if node in self.outcomes:
                script.append(f"outcome_{name} := (outcome_{name} == '') ? 'skipped' : outcome_{name}")
            if node in self.times:
                script += [
                    f"{p}_{name} := ({p}_{name} == {NEVER}) ? {VOID} : {p}_{name}" for p in ("end", "start")
                ]
        return script


def _bounded(temporal: Temporal) -> bool:
    """Tell whether a node waits for a temporal condition: it has a lower bound that is not in the past."""
    lo = temporal.interval.lo_ms
    return lo is not None and (lo > 0 or (isinstance(temporal, Reference) and lo == 0))


def _holds(node: Node) -> list[Temporal]:
    """Return the conditions on the end that hold a node which is complete."""
    return [t for t in end_temporals(node) if _bounded(t)]


def _deadlines(node: Node) -> list[Temporal]:
    """Return the conditions on the end that a running node may miss."""
    return [t for t in end_temporals(node) if t.interval.hi_ms is not None]


def _timeout_ms(node: Node) -> int | None:
    """Return after how long `Timeout` has to stop a node; None where that does not say all."""
    limits = _deadlines(node)
    highest = [t.interval.hi_ms for t in limits if isinstance(t, Relative) and t.interval.hi_ms]
    return min(highest) if highest and len(highest) == len(limits) and min(highest) > 0 else None


def within(temporals: Iterable[Temporal], relative: str, *, lower: bool = True, upper: bool = True) -> str:
    """Return temporal conditions as a port of `WaitWindow` and `Deadline`; `relative` is their own base."""
    terms = []
    for temporal in temporals:
        match temporal:
            case Absolute():
                base = CLOCK
            case Relative():
                base = relative
            case Reference():
                base = f"{temporal.point}_{entry(temporal.node)}"
        lo, hi = temporal.interval.lo_ms, temporal.interval.hi_ms
        first = str(lo) if lower and lo is not None and lo >= 0 else "-"
        terms.append(f"{base} {first} {hi if upper and hi is not None else '-'}")
    return "; ".join(terms)


# --- elements -----------------------------------------------------------------------


def _element(tag: str, attributes: Mapping[str, str] | None = None, *below: Element) -> Element:
    made = ElementTree.Element(tag, dict(attributes or {}))
    made.extend(below)
    return made


def _holds_element(conditions: Conditions) -> Element:
    return _element("Condition", {"ID": "Holds", "when": _when(conditions)})


def _sequence(parts: Sequence[Element]) -> Element:
    """Return parts one after the other; a single one is itself."""
    return parts[0] if len(parts) == 1 else _element("Sequence", None, *parts)


def port_text(value: Value) -> str:
    """Return a parameter as the text of a port; U+FFFD stands for a character that XML cannot hold."""
    if isinstance(value, bool):
        return "true" if value else "false"
    return FORBIDDEN.sub("\ufffd", value) if isinstance(value, str) else shortest(value)


def _when(conditions: Conditions) -> str:
    """Return conditions as the text of a port."""
    return port_text(conditions_text(conditions))


def port_names(parameters: Iterable[str]) -> dict[str, str]:
    """Return the ports of parameters: an attribute of XML that BehaviorTree.CPP does not keep for itself."""
    names: dict[str, str] = {}
    for parameter in parameters:
        name = re.sub(r"[^A-Za-z0-9_.-]", "_", parameter)
        if not name[:1].isalpha() or name in ("ID", "name"):
            name = f"p_{name}"
        while name in names.values():
            name += "_"
        names[parameter] = name
    return names


@dataclass(frozen=True, slots=True)
class _Choice:
    """An option or alternate as it competes."""

    utility: Utility
    conditions: Conditions
    node: Node


class _Writer:
    """Makes the elements of one plan."""

    def __init__(self, plan: Plan) -> None:
        self._plan = plan
        self._recorded = _Recorded.of(plan)
        self._asked = self._recorded.times | self._recorded.outcomes
        self._capacities = contested(plan, Family.of(plan))
        self._consumables = {r.name: r for r in plan.resources if isinstance(r, ConsumableResource)}

    def whole(self) -> Element:
        """Return the tree: preparations, the main tree, and the library where that has failed."""
        whole = self._node(self._plan.node)
        if self._plan.library:
            choices = [
                _Choice(a.utility, self._with_required(a.eligible_conditions, a.requires), a.node)
                for a in self._plan.library
            ]
            whole = _element(
                "Fallback", None, whole, self._tried(choices, _element("AlwaysFailure"), root=True)
            )
        script = self._recorded.begin()
        return _sequence([*([_element("Script", {"code": script})] if script else []), whole])

    def model(self) -> Element:
        """Return the `TreeNodesModel`: the actions of the plan, and what is this project's own."""
        model = ElementTree.Element("TreeNodesModel")
        tasks = [node for node in walk_plan(self._plan) if isinstance(node, Task)]
        used: dict[str, dict[str, str]] = {}
        for task in tasks:
            ports = used.setdefault(action_id(task.action), {})
            names = port_names(task.parameters)
            for parameter, value in task.parameters.items():
                kind = (
                    "bool"
                    if isinstance(value, bool)
                    else "std::string"
                    if isinstance(value, str)
                    else "double"
                )
                ports[names[parameter]] = kind
        for action, ports in sorted(used.items()):
            about = ElementTree.SubElement(model, "Action", {"ID": action})
            for port, kind in ports.items():
                ElementTree.SubElement(about, "input_port", {"name": port, "type": kind})
        for name, (kind, text, own) in MODEL.items():
            about = ElementTree.SubElement(model, kind, {"ID": name})
            ElementTree.SubElement(about, "description").text = text
            for port, (type_, told) in own.items():
                ElementTree.SubElement(about, "input_port", {"name": port, "type": type_}).text = told
        return model

    def _child(self, node: Node) -> Element:
        """Return a node below another: a failure that is tolerated becomes a success."""
        made = self._node(node)
        return _element("ForceSuccess", None, made) if node.continue_on_failure else made

    def _node(self, node: Node) -> Element:
        body = self._running(node)
        checks: list[Element] = []
        start = self._with_required(node.start_conditions, node.requires)
        if start:
            checks.append(_holds_element(start))
        made = self._gate(node, [*checks, body])
        made.set("name", node.id)
        self._scripts(node, made)
        return made

    def _running(self, node: Node) -> Element:
        """Return what happens from the start of a node to its end."""
        parts: list[Element] = []
        if node.id in self._recorded.times:
            parts.append(_element("Script", {"code": f"start_{entry(node.id)} := {CLOCK}"}))
        parts.append(self._core(node))
        own = f"start_{entry(node.id)}"
        held = _holds(node)
        if held:
            parts.append(
                _element("Action", {"ID": "WaitWindow", "within": within(held, own, upper=False), "when": ""})
            )
        if node.end_conditions:
            parts.append(_holds_element(node.end_conditions))
        made = _sequence(parts)
        if node.maintain_conditions:
            watch = {"ID": "NotFalse", "when": _when(node.maintain_conditions)}
            made = _element("ReactiveSequence", None, _element("Condition", watch), made)
        timeout_ms = _timeout_ms(node)
        if timeout_ms is not None:
            return _element("Timeout", {"msec": str(timeout_ms)}, made)
        if limits := _deadlines(node):
            return _element("Decorator", {"ID": "Deadline", "within": within(limits, own, lower=False)}, made)
        return made

    def _gate(self, node: Node, parts: list[Element]) -> Element:
        """Return parts behind what a node waits for before it starts."""
        windows = [t for t in node.start_temporal_conditions if _bounded(t) or t.interval.hi_ms is not None]
        waits = node.wait_for_conditions
        lows = [t.interval.lo_ms or 0 for t in windows]
        plain = not waits and all(t.interval.hi_ms is None for t in windows)
        needs = [
            f"{use.resource} {shortest(use.amount)} {shortest(self._capacities[use.resource])}"
            for use in node.uses
            if use.resource in self._capacities
        ]
        if not windows and not waits and not needs:
            return self._wrapped(node, parts)
        plain = plain and not needs
        if plain and all(isinstance(t, Absolute) for t in windows):
            test = {"if": f"{CLOCK} >= {max(lows)}", "else": "RUNNING"}
            return self._wrapped(node, [_element("Precondition", test, _element("AlwaysSuccess")), *parts])
        if plain and all(isinstance(t, Relative) for t in windows):
            return _element("Delay", {"delay_msec": str(max(lows))}, _sequence(parts))
        activated = f"active_{entry(node.id)}"
        ports = {"within": within(windows, activated), "when": _when(waits) if waits else ""}
        if needs:
            about = {"resources": "; ".join(needs), "priority": shortest(node.priority), **ports}
            parts = [_element("Decorator", {"ID": "Using", **about}, _sequence(parts))]
            gate = []
        else:
            gate = [_element("Action", {"ID": "WaitWindow", **ports})]
        if any(isinstance(t, Relative) for t in windows):
            gate.insert(0, _element("Script", {"code": f"{activated} := {CLOCK}"}))
        return self._wrapped(node, [*gate, *parts])

    def _wrapped(self, node: Node, parts: list[Element]) -> Element:
        """Return parts as one element that has no other node's name."""
        made = _sequence(parts)
        return made if made.get("name", node.id) == node.id else _element("Sequence", None, made)

    def _scripts(self, node: Node, made: Element) -> None:
        """Write down what others ask for when a node ends, and what below it will not run any more."""
        below = [n.id for n in _below(node) if n.id in self._asked]
        for word, outcome in (
            ("_onSuccess", "succeeded"),
            ("_onFailure", "failed"),
            ("_onHalted", "aborted"),
        ):
            script = [*self._recorded.ended(node.id, outcome), *self._recorded.void(below)]
            if script:
                made.set(word, "; ".join(script))

    # --- kinds ------------------------------------------------------------------------

    def _core(self, node: Node) -> Element:
        match node:
            case Task():
                return self._task(node)
            case Block():
                return _element("Sequence", None, *map(self._child, node.node_list))
            case ConcurrentBlock():
                test = {"failure_count": "1", "success_count": "-1"}
                return _element("Parallel", test, *map(self._child, node.node_list))
            case Branch():
                return self._branch(node)

    def _task(self, task: Task) -> Element:
        names = port_names(task.parameters)
        ports = {names[parameter]: port_text(value) for parameter, value in task.parameters.items()}
        about = {"ID": action_id(task.action), "name": task.id, **ports}
        action = _element("Action", about)
        if not task.retries:
            return action
        if not task.retry_delay_ms:
            return _element("RetryUntilSuccessful", {"num_attempts": str(task.retries + 1)}, action)
        sleep = _element("Sleep", {"msec": str(task.retry_delay_ms)})
        again = _element("Sequence", None, sleep, _element("Action", about))
        tries = _element("RetryUntilSuccessful", {"num_attempts": str(task.retries)}, again)
        return _element("Fallback", None, action, tries)

    def _branch(self, branch: Branch) -> Element:
        choices = [
            _Choice(o.utility, self._with_required(o.eligible_conditions, o.requires), o.node)
            for o in branch.options
        ]
        none = _element("AlwaysSuccess" if branch.if_none is IfNone.SKIP else "AlwaysFailure")
        if branch.on_option_failure is OnOptionFailure.NEXT:
            chosen = self._tried(choices, none)
        else:
            chosen = self._by_time(branch, choices, none)
        if branch.if_none is not IfNone.WAIT or any(not c.conditions for c in choices):
            return chosen
        some: Conditions = (Or(tuple(And(c.conditions) for c in choices)),)
        ports = {"ID": "WaitWindow", "within": "", "when": _when(some)}
        return _element("Sequence", None, _element("Action", ports), chosen)

    def _by_time(self, branch: Branch, choices: list[_Choice], none: Element) -> Element:
        """Return the choice of the most useful eligible option, for each period with an order of its own."""
        periods = _rankings([choice.utility for choice in choices])
        made: Element | None = None
        for place in reversed(range(len(periods))):
            _, order = periods[place]
            chosen = self._chosen(branch, [choices[n] for n in order], deepcopy(none))
            if made is None:
                made = chosen
            else:
                before = _element("ScriptCondition", {"code": f"{CLOCK} < {periods[place + 1][0]}"})
                made = _element("IfThenElse", None, before, chosen, made)
        assert made is not None
        return made

    def _chosen(self, branch: Branch, choices: list[_Choice], none: Element) -> Element:
        """Return the choice of the first eligible of `choices`."""
        made = none
        for choice in reversed(choices):
            others = [o.node for o in branch.options if o.node is not choice.node]
            left = [n.id for other in others for n in (other, *_below(other)) if n.id in self._asked]
            script = "; ".join(self._recorded.void(left))
            then = self._child(choice.node)
            if script:
                then = _element("Sequence", None, _element("Script", {"code": script}), then)
            made = _if_else(choice.conditions, then, made)
        return made

    def _tried(self, choices: list[_Choice], none: Element, *, root: bool = False) -> Element:
        """Return the choice of an eligible one, and when it has failed of another, each asked afresh."""
        made = none
        ordered = _best_first(choices)
        first_free = next((place for place, c in enumerate(ordered) if not c.conditions), len(ordered) - 1)
        for choice in reversed(ordered[: first_free + 1]):
            then = self._node(choice.node) if root else self._child(choice.node)
            rest = [c for c in choices if c is not choice]
            if rest:
                then = _element(
                    "Fallback", None, then, self._tried(rest, _element("AlwaysFailure"), root=root)
                )
            made = _if_else(choice.conditions, then, made)
        return made

    def _with_required(self, conditions: Conditions, requires: Sequence[Amount]) -> Conditions:
        """Return conditions with what must be there of consumables, which nothing else reserves."""
        more: list[Condition] = []
        for one in requires:
            resource = self._consumables.get(one.resource)
            if resource is not None:
                more.append(Comparison(resource.key, (), Operator.GE, resource.floor + one.amount))
        return (*conditions, *more)


def _if_else(conditions: Conditions, then: Element, otherwise: Element) -> Element:
    if not conditions:
        return then
    return _element("IfThenElse", None, _holds_element(conditions), then, otherwise)


def _rankings(utilities: Sequence[Utility]) -> list[tuple[int, tuple[int, ...]]]:
    """Return from which time on (milliseconds, the first has no beginning) utilities rank in which order."""
    points = sorted({t for u in utilities if isinstance(u, UtilityTable) for t, _ in u.points})
    instants = {0, *points, *(t - 1 for t in points), *(t + 1 for t in points)}
    for left, right in pairwise(points):
        for one, other in combinations(utilities, 2):
            gap, last = (utility_at(one, t) - utility_at(other, t) for t in (left, right))
            if gap * last < 0:
                crossing = left + (right - left) * gap / (gap - last)
                instants.update(math.floor(crossing) + step for step in (-1, 0, 1, 2))
    found: list[tuple[int, tuple[int, ...]]] = []
    for instant in sorted(instants):
        order = tuple(sorted(range(len(utilities)), key=lambda n: -utility_at(utilities[n], instant)))
        if not found or found[-1][1] != order:
            found.append((instant, order))
    return found


def _best_first(choices: list[_Choice]) -> list[_Choice]:
    return sorted(choices, key=lambda choice: -utility_at(choice.utility, 0))


def _below(node: Node) -> list[Node]:
    found: list[Node] = []
    stack = [*children(node)]
    while stack:
        found.append(stack.pop())
        stack.extend(children(found[-1]))
    return found


def action_id(action: str) -> str:
    """Return the name of the leaf of an action; one that BehaviorTree.CPP has itself is told apart."""
    return f"{action}_" if action in BUILT_IN or action in MODEL else action
