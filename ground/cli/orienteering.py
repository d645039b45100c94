"""`outcrop orienteering`: goal selection alone, on the benchmark formats."""

from __future__ import annotations

from pathlib import Path

import typer

from ground.cli.failure import fail, refusals


def register(app: typer.Typer) -> None:
    """Add the command."""
    app.command("orienteering")(orienteering)


def orienteering(
    file: Path = typer.Argument(
        help="OPLib, classic (Tmax P; x y score), OPTW or rover-orienteering-1 file."
    ),
    out: Path = typer.Option(..., "--out", help="Where the solution goes (JSON)."),
    time_limit: float = typer.Option(
        10.0, "--time-limit", help="Seconds of a processor, reckoned from the steps that are done."
    ),
    iterations: int | None = typer.Option(
        None, "--iterations", min=1, help="Limit in the engine's own steps; makes the answer repeatable."
    ),
    seed: int = typer.Option(0, "--seed", min=0, help="Seed of the local search."),
    threads: int = typer.Option(1, "--threads", min=1, help="Threads for CP-SAT; the other engines use one."),
    engine: str = typer.Option("auto", "--engine", help="auto, exact, cp-sat, survey or branch-and-cut."),
) -> None:
    """Choose targets with prizes under budgets, and the order in which to visit them."""
    if not 0 < time_limit < float("inf"):
        fail(f"--time-limit is {time_limit:g}; it must be > 0")
    import json

    from planner.orienteering import read_routing_file, solution_document, solve

    with refusals():
        read = read_routing_file(file)
        solution = solve(
            read.problem,
            time_limit_s=time_limit,
            iterations=iterations,
            seed=seed,
            threads=threads,
            engine=engine,
        )
    document = solution_document(read, solution)
    try:
        out.write_text(json.dumps(document) + "\n", encoding="utf-8")
    except OSError as err:
        fail(f"{out}: {err.strerror or err}")
    if solution.value is None:
        typer.echo(f"no route: {'proven impossible' if solution.proven else 'none found in time'}")
        raise typer.Exit(3 if solution.proven else 4)
    bound = (
        "optimal"
        if solution.proven
        else f"upper bound {solution.upper}"
        if solution.upper is not None
        else "no bound"
    )
    typer.echo(
        f"{read.problem.name}: value {solution.value} ({bound}), {len(solution.route)} of "
        f"{len(read.problem.experiments)} chosen, {solution.engine}, {solution.wall_s:.3f} s"
    )
