"""Days of the full rover: drawn once, kept, and counted as the truth has them."""

from __future__ import annotations

import json
from pathlib import Path
from typing import Any

import pytest

from studies.common.day_fates import NO_PRODUCT, PLACED, REFUSED, WRONG, Fate
from studies.common.full_days import drawn_days, fly_days, line, report, row_of
from studies.common.judged_fates import Judged
from studies.common.true_surface import OUT_OF_REACH, SAFE, UNSAFE, Possible


def fate(what: str, off_m: float | None = None, why: str = "why") -> Fate:
    return Fate("T1", what, why, 1.5, off_m)


def came(what: str, off_m: float | None = None, truth: str = "", why: str = "why") -> Judged:
    return Judged(fate(what, off_m, why), approached=True, truth=Possible(truth) if truth else None)


def day(*judged: Judged, ground: str = "generated", seed: int = 1, used_s: float = 200.0) -> dict[str, Any]:
    told = {"stages": {"day": (300.0, used_s)}, "driven_m": 30.0, "failures": []}
    return row_of(ground, seed, judged) | told


RAISED = {"ground": "generated", "seed": 3, "exception": "TypeError: of two", "traceback": []}


def test_a_target_that_was_approached_comes_to_one_end() -> None:
    ends = [
        came(PLACED, 0.004),
        came(PLACED, 0.012, SAFE),
        came(NO_PRODUCT, 0.004, SAFE),
        came(WRONG, 0.03, SAFE),
        came(REFUSED, 0.02, UNSAFE),
        came(REFUSED, 0.02, OUT_OF_REACH),
        came(REFUSED, 0.02, SAFE),
        came("lost on arrival", 0.02, UNSAFE),
        Judged(fate("did not arrive"), approached=False),
    ]
    row = day(*ends)
    assert [one["end"] for one in row["targets"]] == [
        "measured",
        "failed",
        "failed",
        "failed",
        "refused_rightly",
        "refused_rightly",
        "refused_wrongly",
        "failed",
        "not approached",
    ]
    counted = (row["asked"], row["approached"], row["measured"], row["refused_rightly"])
    assert counted == (9, 8, 1, 2)
    assert (row["refused_wrongly"], row["failed"], row["wrong"], row["untold"]) == (1, 4, 1, 0)


def test_the_line_of_the_issue_counts_days_exceptions_and_shares() -> None:
    rows = [
        day(came(PLACED, 0.004), came(REFUSED, 0.02, UNSAFE), used_s=250.0),
        day(came(PLACED, 0.002), came("lost on arrival", 0.3, SAFE, why=""), seed=2) | {"internal_errors": 2},
        RAISED,
    ]
    text = line(rows)
    assert "3 days, 3 exceptions, 1 failures without a reason." in text
    assert "Of 4 targets 4 were approached. Measured within 1 cm: 2 (50 %; 50 asked)." in text
    assert "both together 75 % (85 asked)" in text
    assert "250 at most (360 asked)" in text


def test_the_report_shows_every_day_and_every_target_that_was_not_measured() -> None:
    text = report([day(came(PLACED, 0.004), came(REFUSED, 0.02, UNSAFE, "too rough")), RAISED])
    assert "| generated | 1 | 200 s | 30 m | 2 | 2 | 1 | 1 | 0 | 0 | 0 | nothing |" in text
    assert "**exception** TypeError: of two" in text
    assert f"| generated | 1 | T1 | {REFUSED} | 2.0 | unsafe | too rough |" in text
    assert "0.40 cm off in the median" in text


def test_days_are_drawn_once_and_more_when_more_are_asked_for(tmp_path: Path) -> None:
    first = drawn_days(tmp_path, 2, "generated")
    assert [ground for ground, _ in first] == ["generated", "generated"]
    assert first[0][1] != first[1][1]
    assert drawn_days(tmp_path, 3, "generated")[:2] == first
    assert drawn_days(tmp_path, 1, "generated") == first[:1]


def test_what_a_day_raises_is_told_and_kept(tmp_path: Path, capsys: pytest.CaptureFixture[str]) -> None:
    days = [("no such ground", 5)]
    (row,) = fly_days(tmp_path, days)
    assert "no such ground" in row["exception"]
    assert "no target was approached" in line([row])
    kept = tmp_path / "no such ground-5" / "day.json"
    kept.write_text(json.dumps(row | {"exception": "as it was kept"}), "utf-8")
    assert fly_days(tmp_path, days)[0]["exception"] == "as it was kept"
    assert "as it was kept" in capsys.readouterr().out
