"""`outcrop bench contingency`: contingency planners side by side on checked instances."""

from __future__ import annotations

import json
from collections.abc import Iterator
from pathlib import Path
from typing import TYPE_CHECKING

import typer

from ground.cli.failure import fail, refusals

if TYPE_CHECKING:
    from mission.codec import Document

BOARD = typer.Option(Path("board.jsonl"), "--board", help="file of the board, a line for each plan")
FUTURES = typer.Option(1_000_000, min=1_000, max=100_000_000, help="futures over which a plan is valued")


def register_contest(app: typer.Typer) -> None:
    """Add the group."""
    bench = typer.Typer(name="bench", no_args_is_help=True, help="Measure planners against each other.")
    contest = typer.Typer(
        name="contingency", no_args_is_help=True, help="Contingent plans on checked instances."
    )
    contest.command("run")(run)
    contest.command("check")(check)
    contest.command("board")(board_command)
    contest.command("generate")(generate_command)
    bench.add_typer(contest)
    app.add_typer(bench)


def run(
    instances: list[Path] | None = typer.Argument(None, help="contingency/1 files, or folders of them"),
    planner: list[str] = typer.Option(
        ["outcrop", "straight", "pico2005", "greedy"],
        "--planner",
        help="outcrop, straight, pico2005, greedy, or a command that reads an instance and writes a plan",
    ),
    count: int = typer.Option(0, "--generate", min=0, max=10_000, help="draw so many instances instead"),
    sizes: str = typer.Option("4,6,8", help="numbers of targets of drawn instances"),
    seed: int | None = typer.Option(None, min=0, help="of what is drawn; a fresh one is printed"),
    max_branches: int = typer.Option(6, min=0, max=200, help="most branches in a plan"),
    time_limit: float = typer.Option(60.0, min=0.1, max=86_400.0, help="seconds for each plan"),
    futures: int = FUTURES,
    board: Path = BOARD,
) -> None:
    """Let planners plan instances, check and value their plans, and add them to the board. Needs no server.

    The bound on every policy comes from the planner `outcrop`, whether or not it takes part.
    """
    import platform
    import secrets
    from importlib.metadata import version

    from planner.contest.board import Entry, append, read_board, table
    from planner.contest.checker import read_plan, value_plan
    from planner.contest.entrants import ask
    from planner.contest.instance import read_instance
    from planner.errors import PlannerError

    drawn = secrets.randbelow(2**31) if seed is None else seed
    machine = f"{platform.machine()}, Python {platform.python_version()}"
    with refusals():
        documents = list(_drawn(count, sizes, drawn) if count else _read(instances or []))
    if count:
        typer.echo(f"seed {drawn}")
    if not documents:
        fail("there is no instance: name files or folders, or --generate N")
    for document in documents:
        with refusals():
            instance = read_instance(document)
            own = ask("outcrop", document, max_branches, time_limit)
        upper = own.upper or 0.0
        for name in planner:
            refused, cpu_s, value, error, used, over = "", 0.0, 0.0, 0.0, 0, 0.0
            try:
                answer = own if name == "outcrop" else ask(name, document, max_branches, time_limit)
                cpu_s = answer.cpu_s
                verdict = value_plan(instance, read_plan(answer.plan, instance, max_branches), futures, drawn)
                value, error, used = verdict.value, verdict.standard_error, verdict.branches
                over = verdict.overruns
            except PlannerError as err:
                refused = str(err)
            entry = Entry(
                planner=name,
                instance=instance.name,
                digest=instance.digest,
                branches=used,
                max_branches=max_branches,
                value=value,
                standard_error=error,
                futures=futures,
                seed=drawn,
                upper=upper,
                overruns=over,
                cpu_s=round(cpu_s, 3),
                version=f"outcrop {version('outcrop')}",
                machine=machine,
                refused=refused,
            )
            with refusals():
                append(board, entry)
            told = (
                refused
                or f"{value:8.3f} +- {error:.3f}, {entry.per_cent:6.2f} % of the bound, {used} branches"
            )
            typer.echo(f"{instance.name:24} {name[:24]:24} {told}")
    with refusals():
        typer.echo("\n" + table(read_board(board)))


def _drawn(count: int, sizes: str, seed: int) -> Iterator[Document]:
    from planner.contest.instance import FAMILIES, generate
    from planner.errors import ProblemError

    try:
        targets = [int(size) for size in sizes.split(",")]
    except ValueError:
        raise ProblemError(f"--sizes is {sizes!r}; numbers of targets are needed, such as 4,6,8") from None
    for number in range(count):
        family = FAMILIES[number % len(FAMILIES)]
        yield generate(family, targets[number // len(FAMILIES) % len(targets)], seed + number)


def _read(places: list[Path]) -> Iterator[Document]:
    from planner.contest.instance import load_document

    for place in places:
        for file in sorted(place.glob("*.json")) if place.is_dir() else [place]:
            yield load_document(file)


def check(
    instance: Path = typer.Argument(..., help="contingency/1 file"),
    plan: Path = typer.Argument(..., help="plan-tree/1 file"),
    max_branches: int | None = typer.Option(None, min=0, help="most branches in the plan"),
    futures: int = FUTURES,
    seed: int = typer.Option(1, min=0, help="of the futures"),
) -> None:
    """Check a plan against an instance and say what it is worth; exit status 2 if it is refused."""
    from planner.contest.checker import read_plan, value_plan
    from planner.contest.instance import load_document, read_instance

    with refusals():
        told = read_instance(load_document(instance))
        verdict = value_plan(told, read_plan(load_document(plan), told, max_branches), futures, seed)
    typer.echo(
        f"{told.name}: {verdict.value:.4f} +- {verdict.standard_error:.4f} over {verdict.futures} futures, "
        f"{verdict.branches} branches, {verdict.overruns:.1%} end over a budget"
    )
    for place in verdict.failing:
        typer.echo(f"  {place} fails in every future that reaches it")


def board_command(board: Path = typer.Argument(Path("board.jsonl"), help="file of the board")) -> None:
    """Print a board as a table in Markdown."""
    from planner.contest.board import read_board, table

    with refusals():
        typer.echo(table(read_board(board)))


def generate_command(
    out: Path = typer.Argument(..., help="folder for the instances"),
    count: int = typer.Option(5, min=1, max=10_000, help="how many; the five families in turn"),
    sizes: str = typer.Option("4,6,8", help="numbers of targets"),
    seed: int = typer.Option(1, min=0, help="of the first; the others follow"),
) -> None:
    """Write instances drawn from a seed, contingency/1, for a planner of your own."""
    with refusals():
        out.mkdir(parents=True, exist_ok=True)
        for document in _drawn(count, sizes, seed):
            file = out / f"{document['name']}.json"
            file.write_text(json.dumps(document, indent=1) + "\n", encoding="utf-8")
            typer.echo(str(file))
