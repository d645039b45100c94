"""`outcrop campaign`: one plan flown many times, without a server."""

from __future__ import annotations

import contextlib
from pathlib import Path
from typing import TYPE_CHECKING

import typer

from ground.cli.failure import fail, refusals
from ground.cli.resources import group_of
from ground.cli.terminal import Interrupt, ProgressLine

if TYPE_CHECKING:
    from ground.campaigns.engines import Engine

STOPPED = 130
"""Exit status after Ctrl-C, as a shell gives it; what was flown stays."""


def register(app: typer.Typer) -> None:
    """Add the group to the program."""
    group = group_of(app, "campaign")
    for command in (run, report, replay, compare, rare):
        group.command()(command)


def run(
    plan: Path = typer.Argument(..., help="CRL file of the plan."),
    world: Path = typer.Option(..., "--world", help="world/1, or the planning problem."),
    rover: str = typer.Option("abstract", "--rover", help="Name of the simulated rover."),
    runs: int = typer.Option(1000, "--runs", help="Number of runs, one for each seed."),
    seed: int = typer.Option(1, "--seed", help="The first seed; the others follow."),
    workers: int = typer.Option(1, "--workers", help="Processes of this machine."),
    out: Path = typer.Option(..., "--out", help="Folder for campaign.json, runs.csv and the rows."),
    resume: bool = typer.Option(False, "--resume", help="Go on with the campaign in the folder."),
    vary: Path | None = typer.Option(None, "--vary", help="campaign-variants/1: other worlds and plans."),
    engine: str = typer.Option("pool", "--engine", help="pool, or dask (OUTCROP_DASK_SCHEDULER)."),
    until_se: float | None = typer.Option(
        None, "--until-se", help="Stop when the mean utility's standard error is at most this."
    ),
    help_runs: int = typer.Option(
        1000, "--help-runs", min=0, help="Seeds for each question of what would help most; 0 asks none."
    ),
    any_world: bool = typer.Option(
        False, "--any-world", help="Take a world other than the one the plan was made for."
    ),
) -> None:
    """Fly a plan many times and say how many runs go wrong, which, and why. Needs no server."""
    from ground.campaigns.conduct import Conduct, Plan, make_order
    from ground.campaigns.folder import CampaignFolder
    from ground.campaigns.inputs import expected_utility, read_case
    from ground.campaigns.report import summary_lines
    from ground.campaigns.variant import read_variants

    if engine not in ("pool", "dask"):
        fail(f'--engine is "{engine}"; it must be pool or dask')
    if not 1 <= workers <= 256:
        fail(f"--workers is {workers}; it must be 1 to 256")
    with contextlib.ExitStack() as held, refusals(), Interrupt() as stop, ProgressLine() as line:
        wanted = Plan(runs, until_se)
        base = read_case(plan, world, rover, any_world=any_world)
        variants = () if vary is None else read_variants(vary, base)
        order = make_order(
            base,
            seed,
            variants=variants,
            help_runs=min(help_runs, runs),
            expected_utility=expected_utility(plan),
        )
        fleet = held.enter_context(contextlib.closing(_engine(engine, workers)))
        folder = CampaignFolder(out)
        folder.open(order, resume=resume)
        flown = Conduct(
            folder, order, wanted, lambda n, of: line.show(n / of, f"{n:,} of {of:,} runs"), stop.wanted
        ).run(fleet)
    if flown is None:
        fail(f"stopped; --resume goes on with what is in {out}", STOPPED)
    for text in summary_lines(flown):
        typer.echo(text)


def _engine(name: str, workers: int) -> Engine:
    import os

    from ground.campaigns.dask_engine import DaskEngine
    from ground.campaigns.engines import HereEngine, PoolEngine
    from ground.cluster import Cluster

    if name == "dask":
        names = ("SCHEDULER", "CERTIFICATE", "KEY", "CA")
        return DaskEngine(Cluster(*(os.environ.get(f"OUTCROP_DASK_{name}", "") for name in names)))
    return HereEngine() if workers == 1 else PoolEngine(workers)


def report(
    folder: Path = typer.Argument(..., help="Folder of a campaign."),
    out: Path | None = typer.Option(None, "--out", help="HTML file; default: report.html in the folder."),
) -> None:
    """Write one HTML file: distribution, tree with frequencies, failures, convergence. Needs no server."""
    from ground.campaigns.compare import result_in
    from ground.campaigns.folder import CampaignFolder
    from ground.campaigns.report import report_page

    with refusals():
        held = CampaignFolder(folder)
        path = out or folder / "report.html"
        path.write_text(report_page(held, result_in(held)), encoding="utf-8")
    typer.echo(str(path))


def replay(
    folder: Path = typer.Argument(..., help="Folder of a campaign."),
    seed: int = typer.Argument(..., help="Seed of the run."),
    out: Path = typer.Option(..., "--out", help="Folder for the run, of the form run/1."),
    series: str = typer.Option("", "--series", help="Of a variant: variants/NAME."),
) -> None:
    """Fly a counted run again into a whole run/1 folder with journal and products. Needs no server."""
    from ground.campaigns.folder import CampaignFolder
    from ground.campaigns.pilot import replay_row
    from ground.errors import InvalidInputError

    with refusals():
        held = CampaignFolder(folder)
        order = held.order()
        if series not in [s.name for s in order.series]:
            known = ", ".join(s.name for s in order.series if s.name) or "no other"
            raise InvalidInputError(f'{folder} has no series "{series}"; it has {known}')
        counted = held.row(seed, series)
        if out.exists() and (not out.is_dir() or any(out.iterdir())):
            raise InvalidInputError(f"{out} is not empty; a run begins in a folder of its own")
        row = replay_row(order.case(series), counted, out)
    typer.echo(f"{out}: seed {seed}, {row.outcome}, utility {row.utility:g}, trace {row.trace}")


def compare(
    first: Path = typer.Argument(..., help="Folder of a campaign, or of one of its variants."),
    second: Path = typer.Argument(..., help="Another, of the same seeds or of wholly different ones."),
) -> None:
    """Say what the second campaign earns more than the first, in pairs where the seeds are the same.

    Needs no server.
    """
    from ground.campaigns.compare import compare as compare_folders
    from ground.campaigns.compare import comparison_lines
    from ground.campaigns.folder import CampaignFolder

    with refusals():
        found = compare_folders(CampaignFolder(first), CampaignFolder(second))
    for text in comparison_lines(found):
        typer.echo(text)


def rare(
    plan: Path = typer.Argument(..., help="CRL file of the plan."),
    world: Path = typer.Option(..., "--world", help="world/1, or the planning problem."),
    event: str = typer.Option(
        ..., "--event", help='What is rare: "end_s > 12600", "failed observe-R4 and lost T4", ...'
    ),
    runs: int = typer.Option(20_000, "--runs", help="Runs in all, pilots included."),
    seed: int = typer.Option(1, "--seed", min=0, help="The first seed."),
    out: Path | None = typer.Option(None, "--out", help="JSON file (campaign-rare/1)."),
    any_world: bool = typer.Option(
        False, "--any-world", help="Take a world other than the one the plan was made for."
    ),
) -> None:
    """Estimate the probability of a rare failure by importance sampling on the abstract rover.

    Needs no server.
    """
    from ground.campaigns.events import read_event
    from ground.campaigns.inputs import read_case
    from ground.campaigns.rare import RARE, RareSampler, summary_line
    from ground.campaigns.tree import names_in

    with refusals():
        case = read_case(plan, world, "abstract", any_world=any_world)
        found = RareSampler(case, read_event(event, names_in(case))).estimate(runs, seed)
        if out is not None:
            out.write_text(RARE.write(found, indent=1) + "\n", encoding="utf-8")
    typer.echo(summary_line(found))
    for tilt in found.tilts:
        typer.echo(f"  {tilt}")
