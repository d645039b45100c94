"""Constraints of an observation, and the times of a day that they leave."""

from __future__ import annotations

import math

import pytest
from hypothesis import given
from hypothesis import strategies as st

from mission import MissionError, MustDo, Request, Sky, SunElevation, Tracked, Window

DAY_S = 88_775.0


@given(st.floats(0, 23.9), st.floats(-60, 60), st.floats(0, 359), st.floats(-0.3, 1.2), st.floats(0, DAY_S))
def test_the_sun_stands_as_asked_exactly_within_the_windows(
    lmst_h: float, latitude_deg: float, ls_deg: float, at_least_rad: float, t_s: float
) -> None:
    sky = Sky(ls_deg, latitude_deg, lmst_h)
    elevation = sky.clock().elevation_rad(t_s)
    try:
        windows = SunElevation(at_least_rad).reduced(sky, DAY_S)
    except MissionError:
        windows = ()
    inside = any(w.opens_s <= t_s <= w.closes_s for w in windows if isinstance(w, Window))
    # A sun that crosses the limit within a minute and comes back may be missed: 0.25 degrees.
    if abs(elevation - at_least_rad) > math.radians(0.3):
        assert inside is (elevation > at_least_rad)


def test_the_day_of_a_request_is_what_all_its_constraints_leave() -> None:
    sky = Sky(start_lmst_h=6.0)
    (sun,) = SunElevation(math.radians(20)).reduced(sky, 40_000.0)
    assert isinstance(sun, Window)
    request = Request(
        "R",
        "T",
        "mi",
        1.0,
        (
            Tracked(),
            MustDo(),
            Window(0.0, 10_000.0),
            Window(30_000.0, 39_000.0),
            SunElevation(math.radians(20)),
        ),
    )
    assert request.windows_s(sky, 40_000.0) == (
        (sun.opens_s, 10_000.0),
        (30_000.0, min(39_000.0, sun.closes_s)),
    )
    assert request.tracked
    assert request.must_do
    assert Request("R", "T", "mi", 1.0, (Tracked(),)).windows_s(sky, 1.0) is None


def test_a_request_that_can_be_made_at_no_time_says_so() -> None:
    night = Request("R7", "T", "mi", 1.0, (SunElevation(math.radians(85)),))
    with pytest.raises(
        MissionError, match=r"observation request R7: the sun stands at 85 to 90 degrees at no"
    ):
        night.windows_s(Sky(latitude_deg=50.0), DAY_S)
    apart = Request("R8", "T", "mi", 1.0, (Window(0.0, 60.0), SunElevation(math.radians(20))))
    with pytest.raises(MissionError, match="R8: its time constraints leave no time in common"):
        apart.windows_s(Sky(start_lmst_h=5.0), DAY_S)
