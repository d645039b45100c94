"""Why a run went wrong: which task, which condition, which resource. Pure."""

from __future__ import annotations

from collections.abc import Iterator, Mapping
from dataclasses import dataclass, field
from typing import TYPE_CHECKING, Any

from ground.campaigns.row import Row

if TYPE_CHECKING:
    from executive.crl import Plan

FOLLOWED = frozenset({"child-failed", "parent-failed", "parent-ended", "not-chosen", "contingency-failed"})
"""Reasons that follow from another node's."""

GUARD = "maintain-violated"
"""Reason of a node whose maintain conditions broke."""
PLAN = "plan"
TIME, ENERGY = "time", "energy"
KEYS = {"time": TIME, "energy-used": ENERGY, "battery-energy": ENERGY}


@dataclass(frozen=True, slots=True, order=True)
class Cause:
    """A failing task, what failed, and the resource that was short (empty: none)."""

    task: str
    condition: str
    resource: str

    def __str__(self) -> str:
        short = f" ({self.resource})" if self.resource and self.resource not in self.condition else ""
        return f"{self.task}: {self.condition}{short}"


@dataclass(frozen=True, slots=True)
class _Test:
    """A comparison that a node's conditions hold, with its text."""

    key: str
    argument: str
    operator: str
    value: Any
    text: str


@dataclass(frozen=True)
class Causes:
    """Finds the causes of rows of one plan."""

    tests: Mapping[tuple[str, str], tuple[_Test, ...]] = field(default_factory=dict)
    texts: Mapping[tuple[str, str], str] = field(default_factory=dict)

    @staticmethod
    def of(plan: Plan) -> Causes:
        """Return the finder for a plan."""
        from executive.crl.nodes import walk_plan
        from executive.crl.printer import conditions_text

        tests: dict[tuple[str, str], tuple[_Test, ...]] = {}
        texts: dict[tuple[str, str], str] = {}
        for node in walk_plan(plan):
            for reason, conditions in (
                ("start-condition", node.start_conditions),
                (GUARD, node.maintain_conditions),
                ("end-condition", node.end_conditions),
            ):
                if conditions:
                    tests[node.id, reason] = tuple(t for c in conditions for t in _tests(c))
                    texts[node.id, reason] = conditions_text(conditions)
        return Causes(tests, texts)

    def of_row(self, row: Row) -> tuple[Cause, ...]:
        """Return the causes in a row, in the order in which they came up, budgets last.

        A run that a guard of time or energy ended is over that budget too, or it would not have been ended:
        that is one failure, and the guard names it.
        """
        found = [
            self._cause(row, task, why) for task, why in row.reasons.items() if _first(why) not in FOLLOWED
        ]
        guarded = {
            KEYS[test.key]
            for task, why in row.reasons.items()
            if _first(why) == GUARD
            for test in self.tests.get((task, GUARD), ())
            if test.key in KEYS and _is_false(test, row)
        }
        over = [name for name in row.exceeded if name not in guarded]
        found += [Cause(PLAN, f"over the budget of {name}", name) for name in over]
        return tuple(dict.fromkeys(found))

    def _cause(self, row: Row, task: str, why: str) -> Cause:
        reason = _first(why)
        if reason.endswith("window-missed"):
            return Cause(task, reason.replace("-", " "), TIME)
        if (task, reason) not in self.texts:
            said = why.partition(": ")[2]
            lost = next((t for t in row.lost if f"target {t} is not tracked" == said), None)
            return Cause(task, why.replace("-", " ", 1), "" if lost is None else f"track of {lost}")
        for test in self.tests[task, reason]:
            if test.key == "trackerstate" and test.argument in row.lost:
                return Cause(task, f"track of {test.argument} lost", f"track of {test.argument}")
            if reason == GUARD and _is_false(test, row):
                return Cause(task, f"{test.text} no longer held", KEYS[test.key])
        resources = {KEYS[t.key] for t in self.tests[task, reason] if t.key in KEYS}
        words = "did not hold" if reason != GUARD else "no longer held"
        return Cause(
            task, f"{self.texts[task, reason]} {words}", resources.pop() if len(resources) == 1 else ""
        )

    def why(self, row: Row) -> str:
        """Return in a line why a run earned what it did."""
        causes = [str(cause) for cause in self.of_row(row)]
        return "; ".join(causes) if causes else f"{row.outcome}, nothing failed"


def _first(why: str) -> str:
    return why.partition(": ")[0]


def _tests(condition: Any) -> Iterator[_Test]:
    from executive.crl.printer import conditions_text
    from executive.crl.values import And, Comparison

    match condition:
        case Comparison(key=key, arguments=arguments, operator=operator, value=value):
            argument = str(arguments[0]) if arguments else ""
            yield _Test(key, argument, str(operator), value, conditions_text((condition,)))
        case And(parts=parts):
            for part in parts:
                yield from _tests(part)


def _is_false(test: _Test, row: Row) -> bool:
    """Return whether a bound on time or energy is broken at the end of a run."""
    if test.key not in ("time", "energy-used") or test.operator not in ("<", "<="):
        return False
    found = row.end_s if test.key == "time" else row.energy_used_j
    return bool(found > float(test.value))
