"""`outcrop plan ci`: every check of a plan, as one report with an exit status."""

from __future__ import annotations

import contextlib
from pathlib import Path

import typer

from ground.cli.failure import fail, refusals
from ground.cli.terminal import Interrupt, ProgressLine

FAILED = 1
STOPPED = 130


def ci(
    plan: Path = typer.Argument(..., help="CRL file of the plan."),
    world: Path = typer.Option(..., "--world", help="world/1, or the planning problem."),
    approved: Path | None = typer.Option(None, "--approved", help="CRL file of the plan approved before."),
    runs: int = typer.Option(1000, "--runs", help="Futures on the abstract rover."),
    seed: int = typer.Option(1, "--seed", help="The first seed; the others follow."),
    second: str = typer.Option(
        "",
        "--second",
        help="A second rover that flies the plan too: subframe or full (the world needs a terrain).",
    ),
    second_runs: int = typer.Option(1, "--second-runs", help="Runs of the second rover; each must succeed."),
    not_worse: bool = typer.Option(
        False, "--not-worse", help="Fail if the plan earns less than the approved one beyond chance."
    ),
    strict: bool = typer.Option(
        False, "--strict", help="Fail by the validator's warnings and by rules whose facts are not given too."
    ),
    any_world: bool = typer.Option(
        False, "--any-world", help="Take a world other than the one the plan was made for."
    ),
    workers: int = typer.Option(1, "--workers", min=1, max=256, help="Processes of this machine."),
    json_out: Path | None = typer.Option(None, "--json", help="Write the report as plan-check/1."),
    html_out: Path | None = typer.Option(
        None, "--html", help="Write the report as a page that loads nothing."
    ),
    junit_out: Path | None = typer.Option(None, "--junit", help="Write the report as JUnit's XML."),
) -> None:
    """Check a plan for a pipeline: validator, futures, flight rules, second rover, approved plan.

    Exit status 0: it passed, 1: it failed, 2: a file cannot be used. Needs no server.
    """
    from ground.campaigns.engines import Engine, HereEngine, PoolEngine
    from ground.checks.check_plan import CheckOrder, check_plan
    from ground.checks.report import CHECKED
    from ground.checks.show import html_page, junit_xml, text_lines

    with contextlib.ExitStack() as held, refusals(), Interrupt() as stop, ProgressLine() as line:
        order = CheckOrder(
            plan=plan,
            world=world,
            runs=runs,
            seed=seed,
            second=second,
            second_runs=second_runs,
            approved=approved,
            not_worse=not_worse,
            strict=strict,
            any_world=any_world,
        )
        fleet: Engine = HereEngine() if workers == 1 else PoolEngine(workers)
        engine = held.enter_context(contextlib.closing(fleet))
        found = check_plan(order, engine, lambda stage, share: line.show(share, stage), stop.wanted)
        if found is not None and json_out is not None:
            json_out.write_text(CHECKED.write(found, indent=1) + "\n", encoding="utf-8")
        if found is not None and html_out is not None:
            html_out.write_text(html_page(found), encoding="utf-8")
        if found is not None and junit_out is not None:
            junit_out.write_text(junit_xml(found), encoding="utf-8")
    if found is None:
        fail("stopped", STOPPED)
    for text in text_lines(found):
        typer.echo(text)
    if not found.passed:
        raise typer.Exit(FAILED)
