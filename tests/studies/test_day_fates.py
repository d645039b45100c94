"""What became of each target of a day is told by the run's own records, and judged by the truth."""

from __future__ import annotations

import json
from dataclasses import replace
from pathlib import Path
from typing import Any

from rover_iface.simulator.truth import TrackRecord
from studies.common.day_fates import fate_table, fates

WHERE = (0.0, 0.0, 0.0)


def result(task: str, *, success: bool, reason: str = "", **values: Any) -> dict[str, Any]:
    return {
        "e": "result",
        "command": ["day", task, 1],
        "success": success,
        "reason": reason,
        "values": values,
    }


def flown(folder: Path) -> Path:
    """Write the records of a day on which each target came to another end."""
    events = [
        result("navigate-T1", success=True),
        result("observe-R1", success=True, made=True, placement_error_m=0.004),
        result("navigate-T2", success=True),
        result("observe-R2", success=False, reason="no usable product", made=True, placement_error_m=0.003),
        result("navigate-T3", success=True),
        result("observe-R3", success=True, made=True, placement_error_m=0.05),
        result("navigate-T4", success=True),
        result("observe-R4", success=False, reason="known to 3.9 cm", made=False),
        result("navigate-T5", success=True),
        result("navigate-T6", success=False, reason="no safe path"),
    ]
    (folder / "journal.jsonl").write_text(json.dumps({"events": events}) + "\n", "utf-8")
    rows: list[list[Any]] = [[1.0, "end", f"navigate-T{k}", "SUCCEEDED"] for k in range(1, 7)]
    rows.append([2.0, "end", "navigate-T7", "FAILED", "start-condition"])
    (folder / "trace.jsonl").write_text("".join(json.dumps(r) + "\n" for r in rows), "utf-8")
    return folder


def record(target: str, state: str, off_m: float, *reasons: str) -> TrackRecord:
    return TrackRecord(1.0, target, state, 0.9, 2.5, off_m, reasons, WHERE)


def test_each_target_has_one_end_with_its_reason_and_what_is_true_of_it(tmp_path: Path) -> None:
    history = [
        *(record(f"T{k}", "tracked", 0.02) for k in range(1, 5)),
        record("T5", "lost", 0.3, "correlation 0.41 is below 0.7"),
        record("T7", "tracked", 0.02),
        record("T7", "failed", 0.4, "correlation 0.50 is below 0.7", "more"),
    ]
    names = [f"T{k}" for k in range(1, 10)]
    found = fates(flown(tmp_path), names, {"T9": "no stand"}, history)
    assert [(fate.what, fate.why) for fate in found] == [
        ("placed", ""),
        ("placed, no product", "no usable product"),
        ("claimed and wrong", ""),
        ("refused on arrival", "known to 3.9 cm"),
        ("lost on arrival", "correlation 0.41 is below 0.7"),
        ("did not arrive", "no safe path"),
        ("lost before its drive", "correlation 0.50 is below 0.7; more"),
        ("no drive in the plan", ""),
        ("not in the plan", "no stand"),
    ]
    assert [fate.off_m for fate in found] == [0.004, 0.003, 0.05, 0.02, 0.3, None, 0.4, None, None]
    assert [fate.placed for fate in found] == [True, True, *[False] * 7]
    assert [fate.target for fate in found if fate.wrong] == ["T3"]


def test_a_target_that_was_lost_on_arrival_has_the_reason_of_that_stop(tmp_path: Path) -> None:
    """It was followed on the next drives, and the mast could not look back to it there."""
    history = [
        replace(record("T5", "lost", 0.02, "correlation 0.41 is below 0.7"), t_s=0.9),
        replace(record("T5", "tracked", 0.1, "it needs pan -3.091 rad"), t_s=5.0),
    ]
    (found,) = fates(flown(tmp_path), ["T5"], {}, history)
    assert (found.what, found.why) == ("lost on arrival", "correlation 0.41 is below 0.7")
    assert found.off_m == 0.02


def test_a_target_of_several_branches_has_the_end_of_the_one_taken(tmp_path: Path) -> None:
    events = [
        result("navigate-T1-2", success=True),
        result("observe-R1-2", success=True, made=True, placement_error_m=0.004),
    ]
    (tmp_path / "journal.jsonl").write_text(json.dumps({"events": events}) + "\n", "utf-8")
    rows: list[list[Any]] = [
        [1.0, "end", "navigate-T1-2", "SUCCEEDED"],
        [2.0, "end", "navigate-T1", "SKIPPED"],
        [2.0, "end", "navigate-T2-3", "SKIPPED"],
        [2.0, "end", "navigate-T2", "FAILED", "start-condition"],
    ]
    (tmp_path / "trace.jsonl").write_text("".join(json.dumps(r) + "\n" for r in rows), "utf-8")
    found = fates(tmp_path, ["T1", "T2"], {}, [])
    assert [(fate.what, fate.why) for fate in found] == [
        ("placed", ""),
        ("drive not begun", "FAILED start-condition"),
    ]


def test_the_table_counts_the_ends_and_tells_every_target(tmp_path: Path) -> None:
    found = fates(flown(tmp_path), ["T1", "T4"], {}, [record("T4", "tracked", 0.0195)])
    text = fate_table({7: found})
    assert "| refused on arrival | 1 |" in text
    assert "| 7 | T4 | refused on arrival | 2.5 | 1.9 | known to 3.9 cm |" in text
    assert "| 7 | T1 | placed | - | 0.4 | - |" in text
