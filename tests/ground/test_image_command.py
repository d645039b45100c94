"""`outcrop image show` on flight images."""

from __future__ import annotations

from pathlib import Path

import numpy as np
import pytest
from PIL import Image
from typer.testing import CliRunner

from ground.cli.main import app, register_all
from tests.shared import shared

FRAME = "data/imagery/mer/2n292280938effb100p0703l0m1.img.gz"


@pytest.fixture(scope="module", autouse=True)
def _registered() -> None:
    if not any(group.name == "image" for group in app.registered_groups):
        register_all()


def test_a_flight_image_is_shown_with_its_camera(tmp_path: Path) -> None:
    out = tmp_path / "frame.png"
    run = CliRunner().invoke(app, ["image", "show", str(shared(FRAME)), "--out", str(out)])
    assert run.exit_code == 0, run.output
    assert "camera      CAHVOR, 1024 x 1024 pixels, 45.8 degrees wide" in run.output
    with Image.open(out) as picture:
        pixels = np.asarray(picture)
    assert pixels.shape == (1024, 1024)
    assert (pixels.min(), pixels.max()) == (0, 255)


def test_a_label_without_samples_says_so(tmp_path: Path) -> None:
    label = shared("data/imagery/msl/RLB_701384675RAS_F0933408RHAZ00337M1.LBL")
    run = CliRunner().invoke(app, ["image", "show", str(label)])
    assert run.exit_code == 0, run.output
    assert "none beside the label" in run.output
    run = CliRunner().invoke(app, ["image", "show", str(label), "--out", str(tmp_path / "x.png")])
    assert run.exit_code == 2
    assert "has no samples" in run.output


@pytest.mark.parametrize("content", ["{}", "no label at all", '{"camera_model_type": "CAHV"}'])
def test_a_file_that_is_no_label_is_named(tmp_path: Path, content: str) -> None:
    file = tmp_path / "frame.img"
    file.write_text(content)
    run = CliRunner().invoke(app, ["image", "show", str(file)])
    assert run.exit_code == 2
    assert run.output.startswith("outcrop: frame.img")
