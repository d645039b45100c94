"""`outcrop plan`: from a planning problem to a contingent plan, without a server."""

from __future__ import annotations

from pathlib import Path
from typing import TYPE_CHECKING, Any

import typer

from ground.cli.failure import BAD_INPUT, fail

if TYPE_CHECKING:
    from planner.problem import Problem
    from planner.solve import PlanResult, Progress

INFEASIBLE = 3
NO_PLAN = 4


def register(app: typer.Typer) -> None:
    """Add the command."""
    app.command("plan")(plan)


def plan(
    file: Path = typer.Argument(..., help="A problem/1 or contingency/1 document."),
    out: Path = typer.Option(..., "--out", help="Folder for plan.crl, plan_tree.json and summary.json."),
    strategy: str = typer.Option(
        "optimal", help="How branches are chosen: optimal, pico2005, or that of a package."
    ),
    options: Path | None = typer.Option(
        None, "--options", help="TOML file with numbers that steer planning (docs/planner.md)."
    ),
    max_branches: int = typer.Option(6, min=0, max=200, help="Most options in the whole plan."),
    time_limit: float = typer.Option(60.0, help="Seconds of wall time."),
    iterations: int | None = typer.Option(None, min=1, help="A limit that does not depend on the machine."),
    seed: int = typer.Option(0, min=0, help="Of the Monte Carlo check."),
    least_taken: float = typer.Option(
        0.0, min=0.0, max=1.0, help="Leave out options taken in a smaller share of the futures."
    ),
) -> None:
    """Plan a day: which observations, in which order, and what to do when things go otherwise.

    Exit status 0: a plan (perhaps an empty one that says why), 2: bad input, 3: infeasible, 4: no plan in
    time.
    """
    from planner.errors import PlannerError
    from planner.options import load_options
    from planner.problem import load_problem
    from planner.solve import PlanStatus, solve

    with _Interrupt() as interrupt, _Line() as line:
        try:
            problem = load_problem(file)
            result = solve(
                problem,
                strategy=strategy,
                max_branches=max_branches,
                time_limit_s=time_limit,
                iterations=iterations,
                seed=seed,
                least_taken=least_taken,
                options=None if options is None else load_options(options),
                report=line.show,
                should_stop=interrupt.wanted,
            )
        except PlannerError as err:
            fail(str(err), BAD_INPUT)
    try:
        write_plan(problem, result, out)
    except OSError as err:
        fail(f"{out}: {err.strerror or err}", BAD_INPUT)
    for reason in result.reasons:
        typer.echo(f"outcrop: {reason}", err=True)
    if result.status is PlanStatus.INFEASIBLE:
        raise typer.Exit(INFEASIBLE)
    if result.status is PlanStatus.TIMEOUT:
        fail(f"no plan within {time_limit:g} s", NO_PLAN)
    if result.status is PlanStatus.EMPTY:
        typer.echo(f"the plan is empty; no plan can earn more than {result.upper:.4g}")
        return
    check = result.check
    sampled = f"{check.mean:.4f} +- {check.standard_error:.2g}" if check is not None else "none"
    typer.echo(
        f"expected utility {result.expected_utility:.4f} (Monte Carlo: {sampled}), "
        f"no policy earns more than {result.upper:.4f}; {result.branches} branches, {result.wall_s:.1f} s"
    )


def summary(problem: Problem, result: PlanResult, crl_digest: str) -> dict[str, Any]:
    """Return the content of summary.json."""
    check = result.check
    return {
        "format": "plan-summary/1",
        "status": result.status.value,
        "strategy": result.strategy,
        "evaluator": result.evaluator,
        "expected_utility": result.expected_utility,
        "standard_error": check.standard_error if check is not None else 0.0,
        "monte_carlo": check.mean if check is not None else 0.0,
        "overrun_probability": check.overrun if check is not None else 0.0,
        "max_overrun_probability": problem.max_overrun_probability,
        "lower": result.lower,
        "upper": result.upper,
        "optimum_estimate": result.optimum_estimate,
        "branches": result.branches,
        "value_by_branches": list(result.curve),
        "wall_s": round(result.wall_s, 3),
        "first_plan_s": round(result.first_plan_s, 3),
        "seed": result.seed,
        "reasons": list(result.reasons),
        "problem_sha256": problem.digest(),
        "crl_sha256": crl_digest,
    }


def write_plan(problem: Problem, result: PlanResult, out: Path) -> None:
    """Write plan.crl, plan_tree.json and summary.json into a folder, made if absent.

    Without a plan (infeasible, out of time) only summary.json is written.
    """
    import json

    from executive.crl.printer import digest, readable_text
    from planner.emit_crl import emit
    from planner.plan_tree import plan_tree_to_dict
    from planner.solve import PlanStatus

    out.mkdir(parents=True, exist_ok=True)
    crl_digest = ""
    if result.status in (PlanStatus.PLANNED, PlanStatus.EMPTY):
        crl = emit(problem, result.tree)
        crl_digest = digest(crl)
        (out / "plan.crl").write_text(readable_text(crl), encoding="utf-8")
        document = plan_tree_to_dict(result.tree, problem)
        (out / "plan_tree.json").write_text(json.dumps(document, indent=1) + "\n", encoding="utf-8")
    text = json.dumps(summary(problem, result, crl_digest), indent=1)
    (out / "summary.json").write_text(text + "\n", encoding="utf-8")


class _Interrupt:
    """Turns the first Ctrl-C into a wish to stop with the best plan so far; the second ends the program."""

    def __init__(self) -> None:
        self._wanted = False

    def wanted(self) -> bool:
        return self._wanted

    def __enter__(self) -> _Interrupt:
        import signal

        self._before = signal.getsignal(signal.SIGINT)

        def handler(_number: int, _frame: object) -> None:
            if self._wanted:
                raise KeyboardInterrupt
            self._wanted = True

        signal.signal(signal.SIGINT, handler)
        return self

    def __exit__(self, *_: object) -> None:
        import signal

        signal.signal(signal.SIGINT, self._before)


class _Line:
    """One line of progress on stderr, rewritten in place; nothing where stderr is no terminal."""

    def __init__(self) -> None:
        import sys

        self._stream = sys.stderr
        self._on = sys.stderr.isatty()

    def show(self, progress: Progress) -> None:
        if not self._on:
            return
        value = "" if progress.value is None else f"  best {progress.value:.3f}, {progress.branches} branches"
        self._stream.write(f"\r\x1b[K{100 * progress.fraction:3.0f} %  {progress.phase}{value}")
        self._stream.flush()

    def __enter__(self) -> _Line:
        return self

    def __exit__(self, *_: object) -> None:
        if self._on:
            self._stream.write("\r\x1b[K")
            self._stream.flush()
