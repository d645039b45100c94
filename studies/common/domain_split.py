"""Which seeds and which real frames may set constants, and which may be reported.

The two sets share nothing, and the tables are written by `reported`, which refuses whatever a constant could
have been set on.
"""

from __future__ import annotations

import secrets
from dataclasses import dataclass
from enum import StrEnum

TUNING_SEEDS = range(1000)
"""Seeds below this set what there is to set in trackers and odometry. Reporting seeds are drawn above."""


class Purpose(StrEnum):
    """What a run of the study is for."""

    TUNING = "tuning"
    REPORTING = "reporting"


GRAIN = {
    Purpose.TUNING: (
        "mer/1n579700548ffld2fcp1981l0m1.img.gz",
        "msl/NRB_701384494RAD_F0933408NCAM00200M1.LBL",
    ),
    Purpose.REPORTING: ("mer/2n295663162fflb1dnp1902l0m1.img.gz", "mer/2n292280989effb100p0703l0m1.img.gz"),
}
"""Real frames whose ground is draped over the renderer's surfaces, below the folder of the imagery."""

PAIRS = {Purpose.TUNING: ("devon1", "aloe"), Purpose.REPORTING: ("devon2",)}
"""Real stereo pairs that are warped. `aloe` sets as the disparity of every pixel is known."""


@dataclass(frozen=True, slots=True)
class Seeds:
    """Seeds of one run of the study and what it is for."""

    purpose: Purpose
    values: tuple[int, ...]

    def __post_init__(self) -> None:
        tuned = [seed for seed in self.values if seed in TUNING_SEEDS]
        if self.purpose is Purpose.REPORTING and tuned:
            raise ValueError(
                f"seeds {tuned} are tuning seeds (below {TUNING_SEEDS.stop}); no table reports them"
            )
        if self.purpose is Purpose.TUNING and len(tuned) < len(self.values):
            raise ValueError(f"tuning takes seeds below {TUNING_SEEDS.stop}, not {self.values}")

    def require_reporting(self) -> None:
        """Refuse to write a page of results.

        Raises
        ------
        ValueError
            If the seeds are those that constants were set on.
        """
        if self.purpose is not Purpose.REPORTING:
            raise ValueError("figures of tuning seeds are not reported")


def tuning(count: int, first: int = 0) -> Seeds:
    """Return seeds to tune with."""
    return Seeds(Purpose.TUNING, tuple(range(first, first + count)))


def reporting(count: int, first: int | None = None) -> Seeds:
    """Return fresh seeds to report; `first` repeats an earlier report.

    Raises
    ------
    ValueError
        If one of them is a tuning seed.
    """
    start = TUNING_SEEDS.stop + secrets.randbelow(2**30) if first is None else first
    return Seeds(Purpose.REPORTING, tuple(range(start, start + count)))
