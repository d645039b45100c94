"""`outcrop image`: what a flight image and its label hold."""

from __future__ import annotations

from pathlib import Path
from typing import TYPE_CHECKING, Annotated, Any

import typer

from ground.cli.failure import fail
from ground.cli.geo_group.calibrate import calibrate

if TYPE_CHECKING:
    import numpy.typing as npt

image = typer.Typer(name="image", help="Look at images of missions and their labels.", no_args_is_help=True)

DARKEST, BRIGHTEST = 1.0, 99.0
"""Percentiles of the samples that become black and white: hot pixels and the sky do not set the contrast."""


def register(app: typer.Typer) -> None:
    """Add the group to the program."""
    app.add_typer(image)
    image.command()(calibrate)


@image.callback()
def about() -> None:
    """Look at images of missions and their labels."""


@image.command()
def show(
    file: Annotated[Path, typer.Argument(help="PDS3 (.img, .lbl), VICAR or Mars 2020 JSON; also gzipped")],
    out: Annotated[Path | None, typer.Option(help="PNG: the image, stretched to 8 bits")] = None,
) -> None:
    """Show the camera of a flight image, and how its samples lie; with --out as a picture."""
    import math

    import numpy as np

    from rover_iface.cameras.labels import read_product
    from rover_iface.errors import CameraError

    try:
        product = read_product(file)
    except CameraError as err:
        fail(str(err))
    except OSError as err:
        fail(f"{file}: {err.strerror or err}")
    camera = product.camera
    border = [[0.0, camera.height / 2], [camera.width - 1.0, camera.height / 2]]
    left, right = camera.back_project(np.array(border))[1]
    field = math.degrees(math.acos(float(np.clip(left @ right, -1.0, 1.0))))
    rows = {
        "image": product.name,
        "instrument": product.instrument or "not told",
        "camera": f"{camera.kind.value}, {camera.width} x {camera.height} pixels, {field:.1f} degrees wide",
        "centre": f"({', '.join(f'{v:.3f}' for v in camera.C)}) m, {product.frame}",
        "axis": f"({', '.join(f'{v:.4f}' for v in camera.A)})",
        "samples": "none beside the label",
    }
    if product.image is not None:
        low, middle, high = np.percentile(product.image.astype(np.float64), (DARKEST, 50.0, BRIGHTEST))
        rows["samples"] = f"{product.image.dtype}, {low:.4g} to {high:.4g}, median {middle:.4g}"
    for name, value in rows.items():
        typer.echo(f"{name:<11} {value}")
    if out is None:
        return
    if product.image is None:
        fail(f"{file} has no samples to make a picture of")
    _write_png(out, product.image)
    typer.echo(str(out))


def _write_png(out: Path, samples: npt.NDArray[Any]) -> None:
    """Write samples (height, width) or (height, width, bands), stretched between two percentiles."""
    import numpy as np
    from PIL import Image

    low, high = np.percentile(samples, (DARKEST, BRIGHTEST))
    stretched = np.clip((samples - low) / max(float(high - low), 1e-12), 0.0, 1.0)
    out.parent.mkdir(parents=True, exist_ok=True)
    Image.fromarray(np.round(255.0 * stretched).astype(np.uint8)).save(out)
