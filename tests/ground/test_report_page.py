"""Charts of the printed reports."""

from __future__ import annotations

import xml.etree.ElementTree as ET

from ground.reports.page import confidence_chart
from ground.reports.plan_drawing import describe_when

SVG = "{http://www.w3.org/2000/svg}"


def test_confidence_is_drawn_over_the_distance_and_breaks_where_nothing_is_tracked() -> None:
    ways = [0.0, 1.0, None, 2.0, 3.0, 4.0, 5.0]
    curves = {"Big <rock>": [1.0, 0.9, 0.8, 0.7, 0.0, 0.6, 0.5], "never": [None] * 7}
    drawn = ET.fromstring(confidence_chart(ways, curves, "confidence"))
    lines = drawn.findall(f"{SVG}polyline")
    assert len(lines) == 2
    first = [tuple(map(float, p.split(","))) for p in lines[0].attrib["points"].split()]
    second = [tuple(map(float, p.split(","))) for p in lines[1].attrib["points"].split()]
    assert [x for x, _ in first + second] == sorted(x for x, _ in first + second)
    assert first[0] == (0.0, 0.0)
    assert second[-1][1] == 65.0
    words = [t.text for t in drawn.findall(f"{SVG}text")]
    assert "Big <rock>" in words
    assert "never" not in words
    assert "5.0 m" in words


def test_without_a_track_there_is_no_chart() -> None:
    assert confidence_chart([0.0, 1.0], {"T1": [0.0, 0.0]}, "confidence") == ""
    assert confidence_chart([None, None], {"T1": [1.0, 1.0]}, "confidence") == ""


def test_an_option_that_asks_what_was_done_says_so() -> None:
    late = [{"var": "done", "observation": "R1", "is": False}, {"var": "time_s", "ge": 3600.0}]
    assert describe_when(late, {}) == "R1 not done and time ≥ 1:00:00"
    hungry = [{"var": "energy_j", "ge": 532429.0}, {"var": "time_s", "lt": 59.9}]
    assert describe_when(hungry, {}) == "energy used ≥ 147.9 Wh and time < 0:01:00"
    assert describe_when([{"var": "tracked", "target": "T1", "is": False}], {"T1": "Clovis"}) == "Clovis lost"
    assert describe_when([], {}) == "else"
