"""Restart from anywhere: the plan clock goes on, nothing said is lost, nothing is carried out twice."""

from __future__ import annotations

import random
from datetime import UTC, datetime, timedelta
from pathlib import Path

import pytest

from executive.errors import JournalError
from executive.runtime import journal as journal_module
from executive.runtime.journal import JournalFile, never_began
from executive.runtime.live import LiveRuntime
from executive.runtime.recovery import recorded_trace
from tests.executive.killed_runs import DAY, QUIET, Fate, NumberingRover, live_through
from tests.executive.test_live import HandClock, Port

NOON = datetime(2031, 5, 4, 12, tzinfo=UTC)
LATE = "(task :id late :action image :start-temporal-conditions ((7200 9000)))"


def begin(path: Path, plan: str = LATE, *, at: datetime = NOON, resume: bool = True) -> LiveRuntime:
    return LiveRuntime(
        plan, Port(), run_id="live", journal=path, resume=resume, settings=QUIET, wall=lambda: at
    )


def test_the_header_says_when_plan_time_0_was_before_anything_else(tmp_path: Path) -> None:
    run = begin(tmp_path / "j")
    header = JournalFile(tmp_path / "j").header
    assert (header["clock"], header["rate"]) == ("wall", 1.0)
    assert datetime.fromisoformat(header["instant"]) == NOON
    run.shut_down()


def test_the_plan_clock_goes_on_while_the_process_is_away(tmp_path: Path) -> None:
    run = begin(tmp_path / "j")
    run.turn()
    run.shut_down()
    run = begin(tmp_path / "j", at=NOON + timedelta(hours=2, seconds=3))
    run.turn()
    starts = [r for r in run.session.trace if r.event == "start"]
    assert len(starts) == 1
    assert 7_203_000 <= starts[0].t_ms < 7_204_000
    run.shut_down()


def test_a_wall_clock_that_was_set_back_does_not_set_the_plan_clock_back(tmp_path: Path) -> None:
    run = begin(tmp_path / "j")
    run.turn()
    run.shut_down()
    run = begin(tmp_path / "j", at=NOON + timedelta(hours=1))
    run.turn()
    run.shut_down()
    run = begin(tmp_path / "j", at=NOON - timedelta(days=1))
    run.turn()
    assert 3_600_000 <= run.session.now_ms < 3_601_000
    assert any("the plan clock goes on from there" in note.text for note in run.session.notes)
    run.shut_down()


@pytest.mark.parametrize(("epoch", "begins_ms"), [("11:50:00", 600_000), ("12:10:00", 0)])
def test_a_plan_with_an_epoch_keeps_its_time_of_day(tmp_path: Path, epoch: str, begins_ms: int) -> None:
    run = begin(tmp_path / "j", f'(plan :id p :epoch "2031-05-04T{epoch}Z" :node {LATE})')
    assert run.session.start_ms == pytest.approx(begins_ms, abs=1_000)
    instant = datetime.fromisoformat(JournalFile(tmp_path / "j").header["instant"])
    assert instant == NOON - timedelta(milliseconds=begins_ms)
    run.shut_down()


def test_a_journal_cut_anywhere_in_its_header_is_a_run_that_never_began(tmp_path: Path) -> None:
    begin(tmp_path / "j").shut_down()
    header = (tmp_path / "j").read_bytes().splitlines(keepends=True)[0]
    for size in range(len(header)):
        path = tmp_path / f"cut-{size}"
        path.write_bytes(header[:size])
        assert never_began(path)
        run = begin(path)
        run.turn()
        assert recorded_trace(JournalFile(path).records) == run.session.trace
        run.shut_down()
    assert not never_began(tmp_path / "j")


@pytest.mark.parametrize("content", [b"hello", b'{"n":0,"k":"note"', b"\n", b"\x00" * 64])
def test_what_is_no_beginning_of_a_header_is_refused(tmp_path: Path, content: bytes) -> None:
    path = tmp_path / "j"
    path.write_bytes(content)
    with pytest.raises(JournalError):
        begin(path)
    assert path.read_bytes() == content


def test_the_rover_is_told_what_is_kept_only_once_it_is_durable(
    tmp_path: Path, monkeypatch: pytest.MonkeyPatch
) -> None:
    """What a process that died wrote may be in the system's memory alone when the next one reads it."""
    rover = NumberingRover(Fate(random.Random(0)))

    def process() -> LiveRuntime:
        return LiveRuntime(
            DAY, rover, run_id="day", journal=tmp_path / "j", resume=True, clock=HandClock(), settings=QUIET
        )

    process().turn()
    order: list[str] = []
    monkeypatch.setattr(journal_module.os, "fsync", lambda _file: order.append("fsync"))
    monkeypatch.setattr(rover, "commit", lambda _number: order.append("commit"))
    process().shut_down()
    assert order[:2] == ["fsync", "commit"]


# --- kills at any instant ------------------------------------------------------------


def test_what_two_deaths_leave_is_not_acknowledged_before_it_is_durable(
    tmp_path: Path, monkeypatch: pytest.MonkeyPatch
) -> None:
    live_through(200_614_151, tmp_path, monkeypatch)  # found by 63,000 crash points: a beat was lost


def test_a_run_killed_at_any_instant_comes_to_its_end(
    tmp_path: Path, monkeypatch: pytest.MonkeyPatch
) -> None:
    for seed in range(150):
        with monkeypatch.context() as patch:
            live_through(seed, tmp_path, patch)


@pytest.mark.slow
def test_a_run_killed_at_very_many_instants_comes_to_its_end(
    tmp_path: Path, monkeypatch: pytest.MonkeyPatch
) -> None:
    for seed in range(1_000, 1_600):
        with monkeypatch.context() as patch:
            live_through(seed, tmp_path, patch)
