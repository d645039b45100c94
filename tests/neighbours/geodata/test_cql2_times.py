"""Moments at the ends of the calendar."""

from __future__ import annotations

import pytest

from neighbours.geodata.cql2.errors import Cql2Error
from neighbours.geodata.cql2.times import instant


@pytest.mark.parametrize("text", ["0001-01-01T00:00:00+14:00", "9999-12-31T23:59:59-14:00"])
def test_a_moment_whose_utc_leaves_the_calendar_is_refused_by_name(text: str) -> None:
    with pytest.raises(Cql2Error, match=text[:10]):
        instant(text)
