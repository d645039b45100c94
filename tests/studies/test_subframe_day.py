"""Every task of a day that came to nothing is told with its reason, those that never began too."""

from __future__ import annotations

import json
from pathlib import Path

from rover_iface.simulator.truth import TrackRecord
from studies.common.day_fates import not_begun

WHERE = (0.0, 0.0, 0.0)


def test_a_drive_to_a_lost_target_is_told_with_what_the_tracker_said(tmp_path: Path) -> None:
    rows = [
        [20.0, "end", "trackstart-T1", "SUCCEEDED"],
        [90.0, "end", "navigate-T1", "FAILED", "start-condition"],
        [90.0, "end", "at-R1", "FAILED", "start-condition"],
        [95.0, "end", "navigate-T2", "FAILED", "start-condition"],
        [99.0, "end", "navigate-T3", "SUCCEEDED"],
    ]
    (tmp_path / "trace.jsonl").write_text("".join(json.dumps(r) + "\n" for r in rows), "utf-8")
    history = [
        TrackRecord(20.0, "T1", "tracked", 0.9, 8.0, 0.01, (), WHERE),
        TrackRecord(60.0, "T1", "failed", 0.0, 10.52, 0.4, ("correlation 0.50 is below 0.7", "more"), WHERE),
        TrackRecord(97.0, "T1", "tracked", 0.9, 3.0, 0.01, (), WHERE),
    ]
    assert not_begun(tmp_path, history) == [
        "navigate-T1: not begun, T1 failed 10.5 m away, correlation 0.50 is below 0.7",
        "navigate-T2: not begun, T2 never tracked",
    ]
