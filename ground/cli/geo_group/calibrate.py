"""`outcrop image calibrate`: a stereo pair from pictures of a chessboard."""

from __future__ import annotations

from pathlib import Path
from typing import Annotated

import typer

from ground.cli.failure import fail, refusals


def calibrate(
    folder: Annotated[Path, typer.Argument(help="folder with the pictures of the board")],
    out: Annotated[Path, typer.Option(help="file to write (form stereo-calibration/1)")],
    square: Annotated[float, typer.Option(help="side of a square of the board, metres")],
    columns: Annotated[int, typer.Option(help="inner corners along the board")] = 9,
    rows: Annotated[int, typer.Option(help="inner corners across the board")] = 6,
    left: Annotated[str, typer.Option(help="names of the left pictures")] = "left*",
    right: Annotated[str, typer.Option(help="names of the right pictures, in the same order")] = "right*",
) -> None:
    """Calibrate a stereo pair from pictures of a chessboard, and say what its ranges may be off."""
    import numpy as np

    from rover_iface.cameras.board_calibration import Board, calibrate
    from rover_iface.cameras.calibrated import CALIBRATIONS
    from rover_iface.terrain.outside import opened_image

    with refusals():
        if not folder.is_dir():
            fail(f"{folder} is not a folder")
        pictures = []
        for pattern in (left, right):
            files = sorted(p for p in folder.glob(pattern) if p.is_file())
            images = []
            for file in files:
                with opened_image(file, "picture") as opened:
                    images.append(np.asarray(opened.convert("L")))
            pictures.append((files, images))
        (files, lefts), (_, rights) = pictures
        made = calibrate(lefts, rights, Board(columns, rows, square))
        pair = made.pair
        out.write_text(CALIBRATIONS.write(pair, indent=1) + "\n", encoding="utf-8")
        ranges = np.array([1.0, 2.0, 5.0, 10.0])
        ahead = np.column_stack((np.zeros((4, 2)), ranges))
        sigma = np.sqrt(pair.point_errors(ahead)[:, 2, 2])
    for k in made.without_board:
        typer.echo(f"not used: {files[k].name}: the whole board is not in both pictures")
    baseline = float(np.linalg.norm(pair.right.center_m))
    deviations = np.sqrt(np.diag(np.array(pair.covariance)))
    typer.echo(f"{out}: {pair.boards} boards, corners fit to {pair.rms_px:.2f} px")
    for name, camera, at in (("left", pair.left, 0), ("right", pair.right, 8)):
        typer.echo(f"{name:<9} focal length {camera.focal_px[0]:.2f} +- {deviations[at]:.2f} px")
    typer.echo(f"baseline  {1000 * baseline:.2f} +- {1000 * deviations[19]:.2f} mm")
    told = ", ".join(f"{100 * s:.1f} cm at {r:g} m" for s, r in zip(sigma, ranges, strict=True))
    typer.echo(f"ranges    off by the calibration alone: {told}")
