"""`outcrop plan export-problem` and `read-plan`: a problem for the engines of others, and their plans."""

from __future__ import annotations

import json
from enum import StrEnum
from pathlib import Path
from typing import Annotated

import typer

from ground.cli.failure import refusals

FUTURES = 20_000
"""A standard error of 1/141 of the standard deviation of what one future earns."""


class ProblemForm(StrEnum):
    """What a problem is written as."""

    PDDL = "pddl"
    ANML = "anml"


def export_problem(
    file: Annotated[Path, typer.Argument(help="A problem: problem/2, problem/1 or contingency/1.")],
    out: Annotated[Path, typer.Option("--out", help="Folder for the files.")],
    form: Annotated[ProblemForm, typer.Option("--as", help="What is written.")] = ProblemForm.PDDL,
    goal: Annotated[
        list[str] | None,
        typer.Option("--goal", help="Observation that has to be made, beside those that must. Repeatable."),
    ] = None,
) -> None:
    """Write a planning problem as PDDL 2.1 (domain.pddl, problem.pddl) or ANML (problem.anml).

    What the language cannot say (chances, branches) stands in the file's head and is listed here. Needs the
    extra formats. Exit status 0: written, 2: refused.
    """
    from neighbours.planning.documents import Language, problem_text
    from planner.problem import load_problem

    with refusals():
        text = problem_text(load_problem(file), Language(form.value), goal or ())
        out.mkdir(parents=True, exist_ok=True)
        for name, content in text.files:
            (out / name).write_text(content, encoding="utf-8")
    for one in text.unsaid:
        typer.echo(f"not said: {one}", err=True)
    typer.echo(f"wrote {' and '.join(name for name, _ in text.files)} to {out}")


def read_plan(
    problem: Annotated[Path, typer.Argument(help="The problem that was exported.")],
    plan: Annotated[
        Path, typer.Argument(help="Plan as engines print it: lines `time: (action) [duration]`.")
    ],
    out: Annotated[Path | None, typer.Option("--out", help="Folder for plan.crl and plan_tree.json.")] = None,
    certify: Annotated[
        float | None,
        typer.Option("--certify", help="Plan ourselves for so many seconds, and say what no plan exceeds."),
    ] = None,
    seed: Annotated[int, typer.Option(min=0, help="Of the Monte Carlo check.")] = 0,
) -> None:
    """Read a plan that an engine made from an exported problem, and say what it is worth here.

    It is valued with all the chances that the export left out. Exit status 0: read, 2: refused.
    """
    from executive.crl.printer import readable_text
    from neighbours.planning.plan_back import plan_of_text
    from planner.emit_crl import emit
    from planner.evaluate.model import Model
    from planner.evaluate.monte_carlo import estimate
    from planner.evaluate.propagate import Evaluator
    from planner.plan_tree import PlanTree, plan_tree_to_dict, planned_observations
    from planner.problem import load_problem
    from planner.solve import solve

    with refusals():
        day = load_problem(problem)
        steps = plan_of_text(plan.read_text(encoding="utf-8", errors="replace"), day)
        model = Model.of(day)
        earned, check = Evaluator(model).value(steps).value, estimate(model, steps, FUTURES, seed=seed)
        if out is not None:
            tree = PlanTree(day.name, steps, "foreign")
            out.mkdir(parents=True, exist_ok=True)
            (out / "plan.crl").write_text(readable_text(emit(day, tree)), encoding="utf-8")
            text = json.dumps(plan_tree_to_dict(tree, day), indent=1)
            (out / "plan_tree.json").write_text(text + "\n", encoding="utf-8")
        bound = ""
        if certify is not None:
            ours = solve(day, time_limit_s=certify)
            bound = f"; ours {ours.expected_utility:.4f}, no policy earns more than {ours.upper:.4f}"
    held = len(planned_observations(steps))
    sampled = f"(Monte Carlo: {check.mean:.4f} +- {check.standard_error:.2g})"
    typer.echo(f"{held} observations, expected utility {earned:.4f} {sampled}{bound}")
