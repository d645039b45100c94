"""`outcrop exchange ...`: targets and keep-outs as files, drawings of plans, products and reports of runs."""

from __future__ import annotations

from pathlib import Path

import typer

from ground.cli.failure import fail
from ground.cli.resources import PERSON, SERVER, connected, fetch


def _form(path: Path, forms: tuple[str, ...]) -> str:
    """Return the form that a file's ending names."""
    form = path.suffix.removeprefix(".").lower()
    if form not in forms:
        fail(f"{path}: the ending says the form; known are {', '.join('.' + f for f in forms)}")
    return form


def register(app: typer.Typer) -> None:
    group = typer.Typer(help="Files in and out.", no_args_is_help=True)
    app.add_typer(group, name="exchange")

    @group.command("export-geometry")
    def export_geometry(
        mission: str = typer.Argument(...),
        out: Path = typer.Argument(..., help="FILE.geojson or FILE.csv"),
        server: str = SERVER,
        person: str | None = PERSON,
    ) -> None:
        """Write all targets and keep-outs of a mission into a file. Needs a server."""
        fetch(f"/missions/{mission}/geometry?form={_form(out, ('geojson', 'csv'))}", out, server, person)

    @group.command("import-geometry")
    def import_geometry(
        mission: str = typer.Argument(...),
        source: Path = typer.Argument(..., help="GeoJSON in site metres, or CSV"),
        server: str = SERVER,
        person: str | None = PERSON,
    ) -> None:
        """Take in targets and keep-outs from a file, all or none. Needs a server."""
        if not source.is_file():
            fail(f"{source} is no file")
        with connected(server, person) as client:
            body = {"upload_id": client.upload(source).id}
            made = client.request("POST", f"/missions/{mission}/geometry", json=body).json()
            typer.echo(f"{len(made['targets'])} targets, {len(made['keep_outs'])} keep-outs")

    @group.command("draw-plan")
    def draw_plan(
        plan: str = typer.Argument(...),
        out: Path = typer.Argument(..., help="FILE.svg or FILE.dot"),
        server: str = SERVER,
        person: str | None = PERSON,
    ) -> None:
        """Write the tree of a plan as a drawing. Needs a server."""
        fetch(f"/plans/{plan}/drawing?form={_form(out, ('svg', 'dot'))}", out, server, person)

    @group.command("products")
    def products(
        run: str = typer.Argument(...),
        out: Path = typer.Argument(..., help="zip to write"),
        server: str = SERVER,
        person: str | None = PERSON,
    ) -> None:
        """Write the data products of a run into a zip with a manifest. Needs a server."""
        fetch(f"/runs/{run}/products", out, server, person)

    @group.command("report")
    def report(
        run: str = typer.Argument(...),
        out: Path = typer.Argument(..., help="HTML file to write"),
        server: str = SERVER,
        person: str | None = PERSON,
    ) -> None:
        """Write the report of a run as one page that loads nothing. Needs a server."""
        fetch(f"/runs/{run}/report", out, server, person)
