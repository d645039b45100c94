"""The text of a planning problem in PDDL 2.1 and in ANML, as unified-planning writes it, with our head."""

from __future__ import annotations

import re
from collections.abc import Collection, Iterable
from dataclasses import dataclass
from enum import StrEnum

from neighbours.planning.model import Metric, foreign_problem, worth
from neighbours.planning.names import word
from neighbours.planning.unsaid import Unsaid, unsaid_of
from planner.problem import Problem


class Language(StrEnum):
    """What a problem is written in."""

    PDDL = "pddl"
    ANML = "anml"


@dataclass(frozen=True, slots=True)
class ProblemText:
    """A problem as files by their names, and what of it they do not say."""

    files: tuple[tuple[str, str], ...]
    unsaid: tuple[Unsaid, ...]


def problem_text(problem: Problem, language: Language, goals: Collection[str] = ()) -> ProblemText:
    """Return a problem as PDDL (`domain.pddl` and `problem.pddl`) or ANML (`problem.anml`).

    Raises
    ------
    PlanningFormatError
        If a goal names no observation, the problem is too large, or a number is none.
    """
    from unified_planning.io import ANMLWriter, PDDLWriter

    pddl = language is Language.PDDL
    made = foreign_problem(problem, goals, Metric.FINAL_STATE if pddl else Metric.NONE)
    left = unsaid_of(problem, goals, metric=pddl)
    head = _head(problem, left)
    if not pddl:
        return ProblemText((("problem.anml", _commented(head, "//") + ANMLWriter(made).get_problem()),), left)
    writer = PDDLWriter(made)
    files = (("domain.pddl", writer.get_domain()), ("problem.pddl", writer.get_problem()))
    return ProblemText(tuple((name, _commented(head, ";") + text) for name, text in files), left)


def _head(problem: Problem, unsaid: Iterable[Unsaid]) -> list[str]:
    lines = [
        f"{problem.name}: a planning problem of Outcrop, SHA-256 {problem.digest()}",
        "seconds, joules and kilobits; a capital is written as _ and its small letter",
        *(f"not said: {one}" for one in unsaid),
    ]
    return [*lines, *(f"observation {word(o.id)} is worth {float(worth(o)):g}" for o in problem.observations)]


def _commented(lines: Iterable[str], mark: str) -> str:
    """Return lines as comments; what would end a line or cannot be printed is replaced."""
    return "".join(f"{mark} {_printable(line)}\n" for line in lines) + "\n"


def _printable(line: str) -> str:
    return re.sub(r"[^\x20-\x7e]", "?", line)
