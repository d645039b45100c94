"""`outcrop frame|solution|site-map|traverse`: the site chain of a mission."""

from __future__ import annotations

import math
from pathlib import Path
from typing import Any

import typer

from ground.cli.connection import PERSON, SERVER, connected, follow, uploaded
from ground.cli.failure import fail
from ground.cli.resources import group_of


def register(app: typer.Typer) -> None:
    """Add the commands to the program."""
    _frames(app)
    _solutions(app)
    _traverses(app)


def _frames(app: typer.Typer) -> None:
    @group_of(app, "frame").command("use")
    def use(
        frame: str = typer.Argument(...),
        solution: str = typer.Argument(..., help="id of one of its solutions, or `none`"),
        preview: bool = typer.Option(False, "--preview", help="say what it would move, and change nothing"),
        reason: str = typer.Option("", help="why, for the history"),
        revision: int | None = typer.Option(None, help="only if the frame is still at this revision"),
        server: str = SERVER,
        person: str | None = PERSON,
    ) -> None:
        """Put a solution in use; targets, keep-outs and maps tied to the frame move along. Needs a server."""
        chosen = None if solution == "none" else solution
        with connected(server, person) as client:
            done = client.choose_solution(
                frame, solution_id=chosen, preview=preview, reason=reason, revision=revision
            )
        place = done.frame.place
        if place is not None:
            typer.echo(f"{frame}  {place.east_m:.3f} {place.north_m:.3f} {place.up_m:.3f}")
        for moved in done.moved:
            typer.echo(
                f"  {moved.kind}  {moved.id}  {moved.name}  moved {moved.shift_m:.3f} m, "
                f"deviation {moved.sigma_before_m:.3f} -> {moved.sigma_after_m:.3f} m"
            )


def _numbers(text: str, count: int, what: str) -> list[float]:
    try:
        numbers = [float(part) for part in text.split(",")]
    except ValueError:
        numbers = []
    if len(numbers) != count or not all(map(math.isfinite, numbers)):
        fail(f'{what} "{text}" is not {count} numbers with commas between')
    return numbers


def _solutions(app: typer.Typer) -> None:
    @group_of(app, "solution").command("add")
    def add(
        frame: str = typer.Argument(...),
        reference: str = typer.Argument(..., help="id of the frame it lies in"),
        offset: str = typer.Argument(..., help="north,east,nadir in metres; -- before a negative first"),
        quaternion: str = typer.Option("1,0,0,0", help="s,v1,v2,v3"),
        sigma: str | None = typer.Option(
            None, help="deviations about and along the frame's axes, rad,rad,rad,m,m,m"
        ),
        label: str = typer.Option("ground", help="who found it, as in the missions' files"),
        server: str = SERVER,
        person: str | None = PERSON,
    ) -> None:
        """Add a solution to a frame; it is not in use before it is chosen. Needs a server."""
        body: dict[str, Any] = {
            "label": label,
            "reference_id": reference,
            "offset_m": _numbers(offset, 3, "offset"),
            "quaternion": _numbers(quaternion, 4, "quaternion"),
        }
        if sigma is not None:
            values = _numbers(sigma, 6, "sigma")
            body["covariance"] = [
                [value**2 if k == row else 0.0 for k in range(6)] for row, value in enumerate(values)
            ]
        with connected(server, person) as client:
            typer.echo(client.create_solution(frame, **body).id)


def _traverses(app: typer.Typer) -> None:
    @group_of(app, "traverse").command("adjust")
    def adjust(
        mission: str = typer.Argument(...),
        name: str = typer.Argument(...),
        stops: list[str] = typer.Argument(
            ...,
            help="FRAME=SOURCE in the order driven; SOURCE is a run (RUN or RUN:PANORAMA), a zipped panorama "
            "folder or a point file",
        ),
        odometry: float = typer.Option(0.05, help="error of odometry, share of the distance"),
        heading: float = typer.Option(3.0, help="error of heading between stops, degrees"),
        sun: float | None = typer.Option(None, help="error of each stop's own heading, degrees"),
        longest: float = typer.Option(30.0, help="longest leg, metres"),
        server: str = SERVER,
        person: str | None = PERSON,
    ) -> None:
        """Match rocks between stops and adjust them; wait for the solutions. Needs a server."""
        with connected(server, person) as client:
            listed = []
            for stop in stops:
                frame, sign, source = stop.partition("=")
                if not sign or not source:
                    fail(f"{stop!r}: give stops as FRAME=SOURCE")
                if Path(source).is_file():
                    listed.append({"frame_id": frame, "upload_id": uploaded(client, Path(source))})
                else:
                    run, _, panorama = source.partition(":")
                    listed.append({"frame_id": frame, "run_id": run, "panorama": panorama})
            job = client.create_traverse(
                mission,
                name=name,
                stops=listed,
                odometry=odometry,
                heading_rad=math.radians(heading),
                sun_rad=None if sun is None else math.radians(sun),
                longest_m=longest,
            )
            found = client.get_traverse(follow(client, job).subject_id)
        for leg in (found.document or {"legs": []})["legs"]:
            typer.echo(f"{leg['first']} to {leg['second']}: {leg['verdict']}")
        for driven, solution in zip(found.stops[1:], found.solution_ids, strict=True):
            typer.echo(f"{solution}  for {driven.frame_id}  {driven.name}")
