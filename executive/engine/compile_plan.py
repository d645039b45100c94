"""From the nodes of the language to what the engine runs."""

from __future__ import annotations

from collections.abc import Callable, Sequence

from executive.crl import nodes as crl
from executive.crl import values
from executive.engine.conditions import (
    TIME_KEY,
    Guard,
    Test,
    all_of,
    any_of,
    comparison,
    is_number,
    known,
    negation,
)
from executive.engine.spec import (
    BLOCK,
    BRANCH,
    CONCURRENT,
    END,
    INFINITY,
    PLAN_CLOCK,
    RELATIVE,
    START,
    TASK,
    AlternateSpec,
    ContingencySpec,
    NodeSpec,
    OptionSpec,
    PlanSpec,
    ResourceSpec,
    Window,
)


def compile_plan(
    plan: crl.Plan, *, identity: Callable[[str], str], digest: str = "", text: str = ""
) -> PlanSpec:
    """Return the plan as the engine runs it.

    `identity` gives the canonical text of a task by its id; it is asked only when a running plan is replaced.
    The plan must be valid.
    """
    root = compile_node(plan.node)
    resources: dict[str, ResourceSpec] = {}
    for resource in plan.resources:
        match resource:
            case values.UnitResource():
                resources[resource.name] = ResourceSpec(resource.name, 1.0)
            case values.CapacityResource():
                resources[resource.name] = ResourceSpec(resource.name, float(resource.capacity))
            case values.ConsumableResource():
                resources[resource.name] = ResourceSpec(
                    resource.name, None, resource.key, float(resource.floor)
                )
    contingencies = tuple(
        ContingencySpec(
            id=c.id,
            node=compile_node(c.node),
            trigger=compile_guard(c.trigger_conditions) or Guard(lambda _: True, {}),
            utility=c.utility,
            interrupt=c.mode is values.Mode.INTERRUPT,
            scope=c.scope if c.scope is not None else root.id,
            max_insertions=c.max_insertions,
            continue_on_failure=c.continue_on_failure,
        )
        for c in plan.floating
    )
    alternates = tuple(
        AlternateSpec(
            id=a.id,
            node=compile_node(a.node),
            eligible=compile_guard(a.eligible_conditions),
            utility=a.utility,
            requires=amounts(a.requires),
        )
        for a in plan.library
    )
    return PlanSpec(
        id=plan.id or "",
        root=root,
        epoch=plan.epoch,
        resources=resources,
        contingencies=contingencies,
        alternates=alternates,
        overrun_penalty=plan.overrun_penalty,
        budgets=tuple((b.resource, b.amount) for b in plan.budgets),
        digest=digest,
        text=text,
        identity=identity,
    )


def compile_node(top: crl.Node) -> NodeSpec:
    """Return one tree; children are compiled before their parents, to any depth."""
    done: dict[str, NodeSpec] = {}
    for node in reversed(list(crl.walk(top))):
        spec = _common(node)
        match node:
            case crl.Task():
                spec.action = node.action
                spec.parameters = dict(node.parameters)
                spec.retries = node.retries
                spec.retry_delay_ms = node.retry_delay_ms
                spec.interruptible = node.interruptible
                spec.on_resume = node.on_resume
            case crl.Block():
                spec.kind = BLOCK
                spec.children = tuple(done[child.id] for child in node.node_list)
            case crl.ConcurrentBlock():
                spec.kind = CONCURRENT
                spec.children = tuple(done[child.id] for child in node.node_list)
            case crl.Branch():
                spec.kind = BRANCH
                spec.if_none = node.if_none
                spec.constant_utilities = not any(
                    isinstance(option.utility, values.UtilityTable) for option in node.options
                )
                spec.next_on_failure = node.on_option_failure is values.OnOptionFailure.NEXT
                spec.options = tuple(
                    OptionSpec(
                        id=option.id,
                        node=done[option.node.id],
                        utility=option.utility,
                        eligible=compile_guard(option.eligible_conditions),
                        requires=amounts(option.requires),
                    )
                    for option in node.options
                )
                spec.children = tuple(option.node for option in spec.options)
        done[node.id] = spec
    return done[top.id]


def _common(node: crl.Node) -> NodeSpec:
    return NodeSpec(
        kind=TASK,
        id=node.id,
        wait_for=compile_guard(node.wait_for_conditions),
        start=compile_guard(node.start_conditions),
        maintain=compile_guard(node.maintain_conditions),
        end=compile_guard(node.end_conditions),
        start_windows=tuple(map(compile_window, node.start_temporal_conditions)),
        end_windows=tuple(map(compile_window, crl.end_temporals(node))),
        continue_on_failure=node.continue_on_failure,
        uses=amounts(node.uses),
        requires=tuple((a.resource, a.amount) for a in node.requires),
        priority=node.priority,
        reward=node.reward,
        metadata=node.metadata,
    )


def amounts(entries: Sequence[values.Amount]) -> tuple[tuple[str, float], ...]:
    """Return names and amounts; entries of the same resource are added up."""
    if not entries:
        return ()
    total: dict[str, float] = {}
    for entry in entries:
        total[entry.resource] = total.get(entry.resource, 0) + entry.amount
    return tuple(total.items())


def compile_window(temporal: values.Temporal) -> Window:
    interval = temporal.interval
    lo = -INFINITY if interval.lo_ms is None else interval.lo_ms
    hi = INFINITY if interval.hi_ms is None else interval.hi_ms
    match temporal:
        case values.Absolute():
            return Window(PLAN_CLOCK, START, lo, hi)
        case values.Relative():
            return Window(RELATIVE, START, lo, hi)
        case values.Reference():
            return Window(temporal.node, START if temporal.point is values.Point.START else END, lo, hi)


def database_key(keyword: str, arguments: Sequence[str | float]) -> str:
    """Return the key of the database: keyword and arguments joined with blanks, numbers in shortest form."""
    if not arguments:
        return keyword
    return " ".join([keyword, *(a if isinstance(a, str) else shortest(a) for a in arguments)])


def shortest(number: float) -> str:
    """Return a number in its shortest form: 10 for 10.0."""
    if isinstance(number, float) and number.is_integer() and abs(number) < 1e16:
        return str(int(number))
    return repr(number)


def compile_guard(conditions: values.Conditions) -> Guard | None:
    """Return the conjunction of conditions, or None where there is nothing to ask."""
    if not conditions:
        return None
    limits: dict[str, tuple[float, ...] | None] = {}
    top = values.And(conditions)
    order: list[values.Condition] = []
    stack: list[values.Condition] = [top]
    while stack:
        condition = stack.pop()
        order.append(condition)
        match condition:
            case values.And() | values.Or():
                stack.extend(condition.parts)
            case values.Not():
                stack.append(condition.part)
    made: dict[int, Test] = {}
    for condition in reversed(order):
        match condition:
            case values.Comparison():
                key = database_key(condition.key, condition.arguments)
                _add_limit(limits, key, condition.value)
                made[id(condition)] = comparison(key, condition.operator.value, condition.value)
            case values.Known():
                key = database_key(condition.key, condition.arguments)
                limits.setdefault(key, ())
                made[id(condition)] = known(key)
            case values.And():
                made[id(condition)] = all_of(tuple(made[id(part)] for part in condition.parts))
            case values.Or():
                made[id(condition)] = any_of(tuple(made[id(part)] for part in condition.parts))
            case values.Not():
                made[id(condition)] = negation(made[id(condition.part)])
    instants = limits.pop(TIME_KEY, ())
    return Guard(made[id(top)], limits, instants or ())


def _add_limit(limits: dict[str, tuple[float, ...] | None], key: str, value: values.Value) -> None:
    """Add what a key is compared with; what is not a number makes every change of the key matter."""
    before = limits.get(key, ())
    if key == TIME_KEY and not is_number(value):
        return
    limits[key] = (*before, float(value)) if is_number(value) and before is not None else None
