"""`outcrop terrain from-images`: pictures of a real site as terrain, panorama and mission."""

from __future__ import annotations

from pathlib import Path
from typing import TYPE_CHECKING, Annotated

import typer

from ground.cli.failure import fail, refusals
from ground.cli.geo_group.new_terrain import Replace, refuse_over

if TYPE_CHECKING:
    from rover_iface.reconstruction.site_model import SiteModel


def from_images(
    folder: Annotated[
        Path, typer.Argument(help="folder of labelled products, or of pictures and pairs.toml")
    ],
    out: Annotated[Path, typer.Option(help="folder to write (form terrain/1), with the panorama in it")],
    spacing: Annotated[float, typer.Option(help="metres between posts")] = 0.05,
    reach: Annotated[float, typer.Option(help="metres from the cameras: nothing farther is taken")] = 30.0,
    nearest: Annotated[
        float | None, typer.Option(help="metres to what is nearest; else as matched points tell")
    ] = None,
    most_sigma: Annotated[
        float, typer.Option(help="metres: heights that may be off by more stay unknown")
    ] = 0.15,
    under_rover: Annotated[
        float,
        typer.Option(help="metres round the rover: holes there become the plane of its wheels"),
    ] = 0.0,
    mission: Annotated[str | None, typer.Option(help="open a mission of this name on it")] = None,
    rover: Annotated[str, typer.Option(help="rover profile of the mission")] = "k9",
    replace: Replace = False,
) -> None:
    """Make terrain of a real site from its stereo pictures; what nobody saw stays a hole."""
    from rover_iface.errors import PicturesError
    from rover_iface.reconstruction.pair_surface import SurfaceOptions
    from rover_iface.reconstruction.site_model import SiteOptions, reconstruct
    from rover_iface.terrain import write_terrain

    refuse_over(out, replace)
    with refusals():
        if not (reach > 0 and most_sigma > 0 and (nearest is None or 0 < nearest < reach)):
            raise PicturesError(
                f"reach {reach:g}, nearest {nearest} and most-sigma {most_sigma:g} m must be positive, "
                "nearest less than reach"
            )
        options = SiteOptions(
            spacing, most_sigma, under_rover, SurfaceOptions(nearest_m=nearest, reach_m=reach)
        )
        made = reconstruct(folder, options, lambda what: typer.echo(what, err=True))
        made.panorama.save(out)
        write_terrain(made.terrain_in(out), out)
        _tell(made, out)
        if mission is not None:
            _open_mission(out, mission, rover)


def _tell(made: SiteModel, out: Path) -> None:
    import numpy as np

    for surface in made.surfaces:
        check = surface.check
        rows = f"rows differ by {check.apart_px:.2f} px at {check.matches} points"
        if check.after_px != check.apart_px:
            rows += f", {check.after_px:.2f} with the right camera turned"
        lost = max(surface.pair.lost)
        gone = f"; {100 * lost:.0f} % of a picture lost" if lost >= 0.005 else ""
        typer.echo(f"{surface.pair.name}: {100 * surface.matched:.0f} % of the pixels ranged; {rows}{gone}")
    for refusal in made.refused:
        typer.echo(f"not used: {refusal}")
    layer = made.terrain.layers[0]
    seen = layer.mask if layer.mask is not None else np.isfinite(layer.heights)
    low, high = np.percentile(layer.sigma[seen], (50, 95)) if layer.sigma is not None else (0.0, 0.0)
    typer.echo(
        f"{out}: {layer.heights.shape[1]} x {layer.heights.shape[0]} posts of {layer.spacing:g} m, "
        f"{100 * float(seen.mean()):.0f} % seen ({float(seen.sum()) * layer.spacing**2:.1f} square metres), "
        f"heights known to {100 * low:.1f} cm (median) and {100 * high:.1f} cm (95 %)"
    )
    if made.assumed_posts:
        area = made.assumed_posts * layer.spacing**2
        typer.echo(
            f"{area:.1f} square metres round the rover are unseen: the plane of its wheels stands there"
        )


def _open_mission(out: Path, name: str, rover: str) -> None:
    from ground.cli.repository import open_or_fail
    from ground.records.actor import SYSTEM_ACTOR
    from ground.resources.mission_setup.create_mission import FolderTerrain, create_mission
    from ground.resources.sols.create_sol import create_sol
    from rover_iface.terrain import load_terrain

    if not bool(load_terrain(out).inside(0.0, 0.0)):
        fail(
            f"{out} is written, but no mission is opened: the ground where the rover stands was not seen. "
            "Give --under-rover METRES with --replace to take the plane of its wheels there"
        )
    repo = open_or_fail()
    made = create_mission(repo, SYSTEM_ACTOR, name=name, source=FolderTerrain(out), rover_profile=rover)
    create_sol(repo, SYSTEM_ACTOR, made.id)
    typer.echo(f"mission {made.id} {made.name!r}")
