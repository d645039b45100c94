"""What constants were set on is in no report."""

from __future__ import annotations

from pathlib import Path

import pytest

from studies.common.domain_split import GRAIN, PAIRS, TUNING_SEEDS, Purpose, Seeds, reporting, tuning
from studies.domains import Figures, report


def test_tuning_and_reporting_share_no_seed_and_no_frame() -> None:
    assert not set(reporting(50).values) & set(TUNING_SEEDS)
    assert not set(GRAIN[Purpose.TUNING]) & set(GRAIN[Purpose.REPORTING])
    assert not set(PAIRS[Purpose.TUNING]) & set(PAIRS[Purpose.REPORTING])


def test_a_tuning_seed_is_refused_as_a_reported_one() -> None:
    with pytest.raises(ValueError, match="tuning seeds"):
        reporting(3, TUNING_SEEDS.stop - 1)
    with pytest.raises(ValueError, match="below 1000"):
        Seeds(Purpose.TUNING, (5000,))


def test_figures_of_tuning_seeds_are_not_written(tmp_path: Path) -> None:
    with pytest.raises(ValueError, match="not reported"):
        report(Figures(), tuning(2), tmp_path)
