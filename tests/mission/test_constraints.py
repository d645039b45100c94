"""Constraints of an observation, and the times of a day that they leave."""

from __future__ import annotations

import math

from hypothesis import given
from hypothesis import strategies as st

from mission import MissionError, Sky, SunElevation, Window

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
