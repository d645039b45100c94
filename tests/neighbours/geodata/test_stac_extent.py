"""Bounding boxes and extents of STAC documents, also across 180 degrees."""

from __future__ import annotations

import pytest

from neighbours.geodata.stac import _around, box_of


@pytest.mark.parametrize(
    ("outline", "box"),
    [
        ([(1.0, 2.0)], [1.0, 2.0, 1.0, 2.0]),
        ([(1.0, 2.0), (3.0, 5.0)], [1.0, 2.0, 3.0, 5.0]),
        ([(179.9, 0.0), (-179.9, 1.0)], [179.9, 0.0, -179.9, 1.0]),
        ([(350.0, 0.0), (359.0, 0.0), (1.0, 0.0), (2.0, 1.0)], [-10.0, 0.0, 2.0, 1.0]),
    ],
)
def test_the_box_is_the_shortest_arc_that_holds_all(
    outline: list[tuple[float, float]], box: list[float]
) -> None:
    assert box_of(outline) == pytest.approx(box)


def test_an_extent_holds_items_on_both_sides_of_180_degrees() -> None:
    assert _around([[179.9, 0, -179.9, 1], [178, 0, 179, 1]]) == pytest.approx([178.0, 0, -179.9, 1])
    assert _around([[1, 2, 3, 4], [-5, 0, 2, 1]]) == pytest.approx([-5.0, 0, 3.0, 4])
    assert _around([[-180, -90, 180, 90], [1, 2, 3, 4]]) == [-180.0, -90, 180.0, 90]
