"""`outcrop plan`: from a planning problem to a contingent plan, without a server."""

from __future__ import annotations

from collections.abc import Mapping
from pathlib import Path
from typing import TYPE_CHECKING, Any

import typer
from typer.core import TyperGroup

from ground.cli.failure import BAD_INPUT, fail, refusals
from ground.cli.terminal import Interrupt, ProgressLine

if TYPE_CHECKING:
    from planner.problem import Problem
    from planner.sols.solve_path import SolPath
    from planner.solve import PlanResult, Progress

INFEASIBLE = 3
NO_PLAN = 4
SOLVE = "solve"
PLAN_FILES = ("plan.crl", "plan_tree.json")
SUMMARY = "summary.json"


class _PlanGroup(TyperGroup):
    """`outcrop plan FILE` plans; the first word may also be one of the group's commands."""

    def parse_args(self, ctx: Any, args: list[str]) -> list[str]:
        if args and args[0] not in (*self.commands, "--help"):
            args = [SOLVE, *args]
        return super().parse_args(ctx, args)


def register(app: typer.Typer) -> None:
    """Add the group; what is not a command of it is a problem that is to be planned."""
    from ground.cli.flight_group.sequence import plandev, sequence
    from ground.cli.plan_group.ci import ci
    from ground.cli.plan_group.contest import register_contest
    from ground.cli.plan_group.export_problem import export_problem, read_plan
    from ground.cli.plan_group.versions import register_versions

    group = typer.Typer(
        name="plan", cls=_PlanGroup, no_args_is_help=True, help="Plan a problem; look at plans as files."
    )
    group.command(SOLVE)(plan)
    group.command("ci")(ci)
    group.command("export-problem")(export_problem)
    group.command("read-plan")(read_plan)
    group.command("sequence")(sequence)
    group.command("plandev")(plandev)
    register_versions(group)
    app.add_typer(group)
    register_contest(app)


def plan(
    file: Path = typer.Argument(..., help="A problem: problem/2, problem/1 or contingency/1."),
    out: Path = typer.Option(..., "--out", help="Folder for plan.crl, plan_tree.json and summary.json."),
    strategy: str = typer.Option(
        "optimal", help="How branches are chosen: optimal, pico2005, or that of a package."
    ),
    options: Path | None = typer.Option(
        None, "--options", help="TOML file with numbers that steer planning (docs/reference/planner.md)."
    ),
    max_branches: int = typer.Option(6, min=0, max=200, help="Most options in the whole plan."),
    time_limit: float = typer.Option(
        60.0, help="Seconds of one processor, reckoned from the work done: the plan is the same at any load."
    ),
    iterations: int | None = typer.Option(None, min=1, help="A limit in candidates looked at instead."),
    seed: int = typer.Option(0, min=0, help="Of the Monte Carlo check."),
    least_taken: float = typer.Option(
        0.0, min=0.0, max=1.0, help="Leave out options taken in a smaller share of the futures."
    ),
    sols: int | None = typer.Option(
        None, "--sols", help="Plan so many sols that follow each other (docs/reference/sol-paths.md)."
    ),
    power: Path | None = typer.Option(
        None, "--power", help="A sol-series/1 document: battery, times and power of the sols."
    ),
) -> None:
    """Plan a day: which observations, in which order, and what to do when things go otherwise.

    `outcrop plan FILE ...` is short for it.

    With --sols or --power it is the first of several sols; sol_path.json says what the later ones are for.
    Where the first sol has nothing to do, there is no plan.

    Exit status 0: a plan (perhaps an empty one that says why) or a path, 2: bad input, 3: infeasible (a
    single day), 4: no plan in time. What an earlier run left of a plan in the folder is removed.
    """
    from ground.day.plan_summary import told_band
    from planner.options import load_options
    from planner.problem import load_problem
    from planner.solve import PlanStatus, solve

    if sols is not None or power is not None:
        given = {
            "--strategy": strategy != "optimal",
            "--options": options is not None,
            "--iterations": iterations is not None,
            "--least-taken": least_taken > 0.0,
        }
        if any(given.values()):
            named = ", ".join(name for name, is_given in given.items() if is_given)
            fail(f"{named}: not for several sols (--sols, --power)", BAD_INPUT)
        plan_sols(file, power, sols, out, time_limit, max_branches, seed)
        return

    with Interrupt() as interrupt, ProgressLine() as line, refusals():
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
            report=lambda progress: line.show(progress.fraction, _told(progress)),
            should_stop=interrupt.wanted,
        )
    try:
        summary = write_plan(problem, result, out)
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
        + ("" if result.searched >= 1.0 else f"; {100.0 * result.searched:.0f} % of the search was done")
    )
    typer.echo(told_band(summary))


def plan_sols(
    file: Path,
    power: Path | None,
    sols: int | None,
    out: Path,
    time_limit: float,
    max_branches: int,
    seed: int,
) -> None:
    """Plan several sols: the plan of the first one, and sol_path.json."""
    import json

    from mission.sol_timeline import SOL_SERIES
    from planner.problem import load_problem
    from planner.sols.path_document import path_to_dict
    from planner.sols.path_problem import same_budgets
    from planner.sols.solve_path import solve_sols

    with Interrupt() as interrupt, ProgressLine() as line, refusals():
        problem = load_problem(file)
        series = same_budgets(problem, 1) if power is None else SOL_SERIES.read_file(power)
        path = solve_sols(
            problem,
            series if sols is None else series.repeated(sols),
            time_limit_s=time_limit,
            max_branches=max_branches,
            seed=seed,
            report=lambda progress: line.show(progress.fraction, _told(progress)),
            should_stop=interrupt.wanted,
        )
    try:
        out.mkdir(parents=True, exist_ok=True)
        text = json.dumps(path_to_dict(path), indent=1)
        (out / "sol_path.json").write_text(text + "\n", encoding="utf-8")
        if path.first_sol is not None and path.plan is not None:
            write_plan(path.first_sol, path.plan, out)
        else:
            _remove(out, *PLAN_FILES, SUMMARY)
    except OSError as err:
        fail(f"{out}: {err.strerror or err}", BAD_INPUT)
    for sol in path.outline:
        typer.echo(
            f"sol {sol.sol}: {sol.utility:.2f}, {len(sol.observations)} observations, begins with "
            f"{sol.charge_j / 3600.0:.0f} Wh, draws {sol.drawn_j / 3600.0:.0f} Wh"
        )
    typer.echo(
        f"{path.mean:.4f} +- {path.standard_error:.2g} over {len(path.outline)} sols, no policy earns more "
        f"than {path.upper:.4f}; {path.wall_s:.1f} s" + ("; stopped" if path.stopped else "")
    )
    _end_of_sols(path, time_limit)


def _end_of_sols(path: SolPath, time_limit: float) -> None:
    """Say why the first sol has no plan, or an empty one, and leave with the status of it."""
    from planner.solve import PlanStatus

    for reason in () if path.plan is None else path.plan.reasons:
        typer.echo(f"outcrop: {reason}", err=True)
    if path.stopped and not path.order:
        fail("stopped before there was a path", NO_PLAN)
    if path.plan is None:
        typer.echo("sol 1 has nothing to do: no plan was written")
    elif path.plan.status is PlanStatus.TIMEOUT:
        fail(f"no plan of sol 1 within {time_limit:g} s", NO_PLAN)
    elif path.plan.status is PlanStatus.EMPTY:
        typer.echo("the plan of sol 1 is empty")


def write_plan(problem: Problem, result: PlanResult, out: Path) -> Mapping[str, object]:
    """Write plan.crl, plan_tree.json and summary.json into a folder, made if absent; return the summary.

    Without a plan (infeasible, out of time) only summary.json is written, and an older plan removed.
    """
    import json

    from executive.crl.printer import digest, readable_text
    from ground.day.plan_summary import summary_of
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
    else:
        _remove(out, *PLAN_FILES)
    summary = summary_of(problem, result, crl_digest)
    (out / SUMMARY).write_text(json.dumps(summary, indent=1) + "\n", encoding="utf-8")
    return summary


def _remove(out: Path, *names: str) -> None:
    """Remove what an earlier run left: nobody shall take it for the plan of this one."""
    for name in names:
        (out / name).unlink(missing_ok=True)


def _told(progress: Progress) -> str:
    value = "" if progress.value is None else f"  best {progress.value:.3f}, {progress.branches} branches"
    return f"{progress.phase}{value}"
