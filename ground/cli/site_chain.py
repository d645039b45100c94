"""`outcrop frame|solution|site-map|traverse`: the site chain of a mission."""

from __future__ import annotations

import math
from pathlib import Path
from typing import Any

import typer

from ground.cli.failure import fail
from ground.cli.resources import PERSON, SERVER, connected, fetch, follow, group_of


def register(app: typer.Typer) -> None:
    """Add the commands to the program."""
    _frames(app)
    _solutions(app)
    _maps(app)
    _traverses(app)


def _frames(app: typer.Typer) -> None:
    group = group_of(app, "frame", "Sites, ends of drives and poses, and which solution of each is in use.")

    @group.command("import")
    def import_file(
        mission: str = typer.Argument(...),
        source: Path = typer.Argument(..., help="mission frame file, .svf or .rvf"),
        server: str = SERVER,
        person: str | None = PERSON,
    ) -> None:
        """Take in a frame file; what is here already is not taken in twice. Needs a server."""
        if not source.is_file():
            fail(f"{source} is no file")
        with connected(server, person) as client:
            body = {"upload_id": client.upload(source).id}
            made = client.request("POST", f"/missions/{mission}/frame-files", json=body).json()
            typer.echo(f"{made['id']}  {made['added']} solutions, {made['known']} known before")

    @group.command("export")
    def export_file(
        mission: str = typer.Argument(...),
        out: Path = typer.Argument(..., help="file to write"),
        site: int | None = typer.Option(None, help="rover poses in this site; without, all sites"),
        server: str = SERVER,
        person: str | None = PERSON,
    ) -> None:
        """Write all sites, or the rover poses in one, as a frame file. Needs a server."""
        asked = "" if site is None else f"?site={site}"
        fetch(f"/missions/{mission}/frame-files/export{asked}", out, server, person)

    @group.command("files")
    def files(mission: str = typer.Argument(...), server: str = SERVER, person: str | None = PERSON) -> None:
        """List the frame files that were taken in. Needs a server."""
        with connected(server, person) as client:
            for file in client.request("GET", f"/missions/{mission}/frame-files?limit=1000").json()["items"]:
                typer.echo(f"{file['id']}  {file['file_name']}  {file['added']} new, {file['known']} known")

    @group.command("use")
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
        body = {
            "solution_id": None if solution == "none" else solution,
            "preview": preview,
            "reason": reason,
        }
        headers = {"If-Match": "*" if revision is None else f'"{revision}"'}
        with connected(server, person) as client:
            done = client.request("PUT", f"/frames/{frame}/solution", json=body, headers=headers).json()
        place = done["frame"]["place"]
        if place is not None:
            where = f"{place['east_m']:.3f} {place['north_m']:.3f} {place['up_m']:.3f}"
            typer.echo(f"{frame}  {where}")
        for moved in done["moved"]:
            typer.echo(
                f"  {moved['kind']}  {moved['id']}  {moved['name']}  moved {moved['shift_m']:.3f} m, "
                f"deviation {moved['sigma_before_m']:.3f} -> {moved['sigma_after_m']:.3f} m"
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
    group = group_of(app, "solution", "Answers to where a frame lies; every one is kept.")

    @group.command("add")
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
            typer.echo(client.request("POST", f"/frames/{frame}/solutions", json=body).json()["id"])


def _maps(app: typer.Typer) -> None:
    group = group_of(app, "site-map", "Maps made at a site.")

    @group.command("add")
    def add(
        mission: str = typer.Argument(...),
        frame: str = typer.Argument(..., help="id of the site"),
        source: Path = typer.Argument(..., help="GeoTIFF in metres east and north of the site's origin"),
        name: str | None = typer.Option(None),
        server: str = SERVER,
        person: str | None = PERSON,
    ) -> None:
        """File a map of a site; it moves with the site. Needs a server."""
        if not source.is_file():
            fail(f"{source} is no file")
        with connected(server, person) as client:
            body = {"frame_id": frame, "upload_id": client.upload(source).id}
            body |= {} if name is None else {"name": name}
            typer.echo(client.request("POST", f"/missions/{mission}/site-maps", json=body).json()["id"])

    @group.command("get")
    def get(
        identifier: str = typer.Argument(...),
        out: Path = typer.Argument(...),
        server: str = SERVER,
        person: str | None = PERSON,
    ) -> None:
        """Write the GeoTIFF of a map. Needs a server."""
        fetch(f"/site-maps/{identifier}/file", out, server, person)


def _traverses(app: typer.Typer) -> None:
    group = group_of(app, "traverse", "Stops adjusted together.")

    @group.command("adjust")
    def adjust(
        mission: str = typer.Argument(...),
        name: str = typer.Argument(...),
        stops: list[str] = typer.Argument(
            ...,
            help="FRAME=SOURCE in the order driven; SOURCE is a run (RUN or RUN:PANORAMA), a zipped panorama "
            "folder or a point file",
        ),
        odometry: float = typer.Option(0.05, help="error of odometry, share of the way"),
        heading: float = typer.Option(3.0, help="error of heading between stops, degrees"),
        sun: float | None = typer.Option(None, help="error of each stop's own heading, degrees"),
        longest: float = typer.Option(30.0, help="longest leg, metres"),
        server: str = SERVER,
        person: str | None = PERSON,
    ) -> None:
        """Match rocks between stops and adjust them; wait for the solutions. Needs a server."""
        from ground.jobs.value import Job

        with connected(server, person) as client:
            listed = []
            for stop in stops:
                frame, sign, source = stop.partition("=")
                if not sign or not source:
                    fail(f"{stop!r}: give stops as FRAME=SOURCE")
                if Path(source).is_file():
                    listed.append({"frame_id": frame, "upload_id": client.upload(Path(source)).id})
                else:
                    run, _, panorama = source.partition(":")
                    listed.append({"frame_id": frame, "run_id": run, "panorama": panorama})
            body = {
                "name": name,
                "stops": listed,
                "odometry": odometry,
                "heading_rad": math.radians(heading),
                "sun_rad": None if sun is None else math.radians(sun),
                "longest_m": longest,
            }
            answer = client.request("POST", f"/missions/{mission}/traverses", json=body).json()
            done = follow(client, client.get(Job, answer["id"]))
            found = client.request("GET", str(done.result_url)).json()
        for leg in found["document"]["legs"]:
            typer.echo(f"{leg['first']} to {leg['second']}: {leg['verdict']}")
        for stop, solution in zip(found["stops"][1:], found["solution_ids"], strict=True):
            typer.echo(f"{solution}  for {stop['frame_id']}  {stop['name']}")

    @group.command("picture")
    def picture(
        identifier: str = typer.Argument(...),
        stop: int = typer.Argument(..., min=0, help="number of the stop, from 0"),
        out: Path = typer.Argument(..., help="PNG to write"),
        server: str = SERVER,
        person: str | None = PERSON,
    ) -> None:
        """Write what a stop of a traverse saw, as one picture. Needs a server."""
        fetch(f"/traverses/{identifier}/pictures/{stop}", out, server, person)
