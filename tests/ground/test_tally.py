"""What workers count of their jobs reaches the metrics of a server that has none itself."""

from __future__ import annotations

import json
import os
import time
from concurrent.futures import ProcessPoolExecutor
from dataclasses import replace
from multiprocessing import get_context
from pathlib import Path

import pytest
from prometheus_client.parser import text_string_to_metric_families

from ground.app.exposition import exposition
from ground.gdr.repository import Repository
from ground.jobs import presence
from ground.jobs.executors import forget_peak, peak_bytes
from ground.jobs.presence import GONE_S, Beat, Presence
from ground.jobs.tally import Tally, tallies
from ground.jobs.worker import Worker
from ground.resources.upkeep.store_size import StoreSize
from tests.ground.test_jobs import KINDS, claim_job, let_lease_run_out, queue, row_of


def values(repo: Repository) -> dict[tuple[str, tuple[str, ...]], float]:
    """Return what a scrape gives, each by its name and the values of its labels, sorted."""
    text = exposition(repo, StoreSize(repo.data_dir))[0].decode()
    return {
        (sample.name, tuple(sorted(sample.labels.values()))): sample.value
        for family in text_string_to_metric_families(text)
        for sample in family.samples
    }


def done_by(worker: Worker) -> None:
    worker.run_until_idle()
    worker._beat.say(worker._presence(), worker._tally.text)


def test_a_server_tells_what_workers_elsewhere_counted(repo: Repository) -> None:
    for what in ("succeed", "succeed", "fail"):
        queue(repo, what)
    worker = Worker(repo, KINDS, slots=1)
    done_by(worker)
    told = values(repo)
    name = worker.name.replace(":", "-")
    of = tuple(sorted((name, "count")))
    assert told["outcrop_job_attempts_total", of] == 3
    assert told["outcrop_job_leases_lost_total", of] == 0
    assert told["outcrop_job_seconds_count", of] == 3
    assert told["outcrop_job_seconds_bucket", tuple(sorted((*of, "+Inf")))] == 3
    assert told["outcrop_job_memory_bytes_count", of] == 2, "of one that failed it is not known"
    assert told["outcrop_job_memory_bytes_sum", of] > 2 * 20e6, "an interpreter with numpy holds more"


def test_a_job_that_another_worker_lost_is_counted_by_the_one_that_takes_it_over(repo: Repository) -> None:
    lost, kept = queue(repo, "succeed"), queue(repo, "succeed")
    assert claim_job(repo, KINDS, "killed") is not None
    let_lease_run_out(repo, lost)
    worker = Worker(repo, KINDS, slots=1)
    done_by(worker)
    assert {row_of(repo, job).state for job in (lost, kept)} == {"succeeded"}
    of = tuple(sorted((worker.name.replace(":", "-"), "count")))
    assert values(repo)["outcrop_job_leases_lost_total", of] == 1


def test_a_job_that_was_lost_too_often_is_counted_also_when_nobody_begins_it_again(repo: Repository) -> None:
    job = queue(repo, "succeed", max_attempts=1)
    assert claim_job(repo, KINDS, "killed") is not None
    let_lease_run_out(repo, job)
    worker = Worker(repo, KINDS, slots=1)
    done_by(worker)
    assert row_of(repo, job).state == "failed"
    assert worker._tally["count"].leases_lost == 1


def test_what_a_worker_counted_goes_with_it(tmp_path: Path) -> None:
    tally, beat = Tally(), Beat(tmp_path)
    tally["plan"].attempts = 4
    tally["plan"].ended(31.0, 3 * 2**30)
    beat.say(Presence("near:1", "process", 0), tally.text)
    assert tallies(tmp_path) == {"near-1": tally}
    (path,) = tmp_path.glob("*.tally")
    os.utime(path, (0, time.time() - GONE_S - 1.0))
    assert tallies(tmp_path) == {}
    beat.leave()
    assert list(tmp_path.iterdir()) == []


def test_trouble_is_told_at_once_and_how_much_is_done_a_while_after_the_last_word(
    tmp_path: Path, monkeypatch: pytest.MonkeyPatch
) -> None:
    beat, idle, busy = Beat(tmp_path), Presence("near:1", "process", 0), Presence("near:1", "process", 1)
    away = replace(busy, trouble="OSError: no scheduler")
    monkeypatch.setattr(presence, "HASTE_S", 600.0)
    for said, told in ((idle, idle), (busy, idle), (away, away), (replace(away, running=2), away)):
        beat.say(said)
        assert presence.present(tmp_path) == [told]
    monkeypatch.setattr(presence, "HASTE_S", 0.0)
    beat.say(idle)
    assert presence.present(tmp_path) == [idle]


SHORT = {"counts": [1], "total": 1.0}
OTHER_BOUNDS = json.dumps({"plan": {"attempts": 1, "leases_lost": 0, "seconds": SHORT, "memory": SHORT}})


@pytest.mark.parametrize("text", ["", "[]", '{"plan": 3}', '{"plan": {"attempts": 1}}', OTHER_BOUNDS])
def test_a_damaged_or_foreign_count_is_left_out(tmp_path: Path, text: str) -> None:
    (tmp_path / "odd-1.tally").write_text(text)
    assert tallies(tmp_path) == {}


def _peaks() -> tuple[int, int, int]:
    """Return the peak after much was held, after that was let go and forgotten, and after less was held."""
    large = bytearray(b"x" * 300_000_000)
    much = peak_bytes()
    del large
    forget_peak()
    before = peak_bytes()
    less = bytearray(b"x" * 50_000_000)
    after = peak_bytes()
    del less
    return much, before, after


def test_the_peak_of_memory_is_that_of_the_work_and_not_of_what_was_done_before() -> None:
    # In a process of its own, as work is done: the heap of one that ran other tests may hold so much that
    # was freed that 50 MB more need nothing of the system.
    with ProcessPoolExecutor(1, mp_context=get_context("spawn")) as pool:
        much, before, after = pool.submit(_peaks).result()
    assert much > 300_000_000
    assert 40_000_000 < after - before < 150_000_000
