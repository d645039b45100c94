"""Templates carried between two real pictures: Navcam wedges of Spirit, rolled by 4 to 22 degrees."""

from __future__ import annotations

from dataclasses import replace

import numpy as np
import numpy.typing as npt

from rover_iface.cameras.labels import read_product
from rover_iface.vision.template import NccOptions, Template, TemplateMatcher
from tests.shared import shared


def offsets(options: NccOptions, spacing: int) -> npt.NDArray[np.float64]:
    """Return per target: predicted pixel (2), offset of the match (2), score, error of the way back."""
    first, second = (
        read_product(shared(f"data/imagery/mer/{name}effb100p0703l0m1.img.gz"))
        for name in ("2n292280938", "2n292280989")
    )
    assert first.image is not None
    assert second.image is not None
    images = [p.astype(np.float32) / np.float32(4095.0) for p in (first.image, second.image)]
    up = np.array([0.0, 0.0, -1.0])  # the mission's rover frame has z down; its ground is z = 0
    matcher = TemplateMatcher(replace(options, search_px=40))
    rows = []
    for y in range(60, 960, spacing):
        for x in range(60, 960, spacing):
            origin, ray = second.camera.back_project((x, y))
            if ray[2] < 0.08:
                continue
            point = origin - origin[2] / ray[2] * ray
            there = first.camera.project(point)
            if not np.isfinite(there).all() or not (75 <= there[0] <= 948 and 75 <= there[1] <= 948):
                continue
            away = [float(np.linalg.norm(point - c.C)) for c in (second.camera, first.camera)]
            before = Template(images[1], second.camera, np.array([x, y], float), point, up, away[0])
            template = matcher.predict(before, first.camera, there, point)
            assert template is not None
            found = matcher.search(images[0], template, there)
            assert found is not None
            now = Template(images[0], first.camera, found.pixel, point, up, away[1])
            rows.append((*there, *(found.pixel - there), found.score, matcher.back_error(now, before)))
    return np.array(rows)


def consensus_errors(rows: npt.NDArray[np.float64]) -> npt.NDArray[np.float64]:
    """Return how far each offset is from a smooth field fitted to most of them, pixels."""
    place = rows[:, :2] / 1024.0
    basis = np.column_stack((np.ones(len(place)), place, place**2, place[:, 0] * place[:, 1]))
    good = np.hypot(*(rows[:, 2:4] - np.median(rows[:, 2:4], axis=0)).T) < 8.0
    error = np.zeros(len(rows))
    for _ in range(10):
        field = np.linalg.lstsq(basis[good], rows[good, 2:4], rcond=None)[0]
        error = np.hypot(*(rows[:, 2:4] - basis @ field).T)
        good = error < 2.0
    return error


def test_predicted_templates_are_found_in_the_next_real_wedge() -> None:
    rows = offsets(NccOptions(), 36)
    error = consensus_errors(rows)
    assert len(rows) > 80
    assert (error < 2.0).mean() >= 0.97
    accepted = (rows[:, 4] >= 0.7) & (rows[:, 5] <= NccOptions().back_check_px)
    assert (accepted & (error > 3.0)).mean() <= 0.01
    assert accepted.mean() > 0.9


def test_templates_that_are_not_turned_are_mostly_not_found() -> None:
    turned, plain = (offsets(NccOptions.as_flown(warp), 48) for warp in ("similarity", "none"))
    error = np.hypot(*(plain[:, 2:4] - turned[:, 2:4]).T)
    assert (consensus_errors(turned) < 2.0).mean() > 0.9
    assert (error < 2.0).mean() < 0.6
