"""The metrics of a server: what its process counted, and what database, disk and workers tell when asked."""

from __future__ import annotations

import shutil
from collections.abc import Iterable, Iterator
from itertools import accumulate

from prometheus_client import CONTENT_TYPE_LATEST, generate_latest
from prometheus_client.core import CounterMetricFamily, GaugeMetricFamily, HistogramMetricFamily, Metric
from prometheus_client.registry import Collector
from sqlalchemy import func, select

from ground.api.metrics import REGISTRY
from ground.gdr.base import utc_now
from ground.gdr.history import ChainRow
from ground.gdr.repository import Repository
from ground.jobs.presence import present
from ground.jobs.row import JobRow
from ground.jobs.tally import BYTES, SECONDS, Spread, tallies
from ground.jobs.worker import Worker
from ground.resources.missions.row import MissionRow
from ground.resources.products.row import ProductRow
from ground.resources.upkeep.noted import ACTS, noted
from ground.resources.upkeep.store_size import StoreSize


def exposition(repo: Repository, store: StoreSize, worker: Worker | None = None) -> tuple[bytes, str]:
    """Return the metrics as text and their media type."""
    return generate_latest(REGISTRY) + generate_latest(_Found(repo, store, worker)), CONTENT_TYPE_LATEST


class _Found(Collector):
    """What is read when somebody asks."""

    def __init__(self, repo: Repository, store: StoreSize, worker: Worker | None) -> None:
        self.repo, self.store, self.worker = repo, store, worker

    def collect(self) -> Iterable[Metric]:
        yield from self._rows()
        yield from self._sizes()
        yield from self._upkeep()
        yield from self._workers()
        yield from self._work()

    def _rows(self) -> Iterator[Metric]:
        jobs = GaugeMetricFamily("outcrop_jobs", "Jobs by kind and state", labels=["kind", "state"])
        with self.repo.database.read() as session:
            counts = select(JobRow.kind, JobRow.state, func.count()).group_by(JobRow.kind, JobRow.state)
            for kind, state, count in session.execute(counts):
                jobs.add_metric([kind, state], count)
            oldest = session.scalar(select(func.min(JobRow.created_utc)).where(JobRow.state == "queued"))
            missions = session.scalar(select(func.count()).select_from(MissionRow)) or 0
            products = session.scalar(select(func.sum(ProductRow.size_bytes))) or 0
            events = session.scalar(select(func.sum(ChainRow.seq))) or 0
        yield jobs
        waits_s = 0.0 if oldest is None else (utc_now() - oldest).total_seconds()
        yield _gauge("outcrop_job_oldest_waiting_seconds", "Age of the job that waits longest", waits_s)
        yield _gauge("outcrop_missions", "Missions in the repository", missions)
        yield _gauge("outcrop_product_bytes", "Size of all data products", products)
        yield _gauge("outcrop_history_events", "Events in the histories", events)

    def _sizes(self) -> Iterator[Metric]:
        yield _gauge("outcrop_database_bytes", "Size of the database", self.repo.database.size_bytes())
        free = shutil.disk_usage(self.repo.data_dir).free
        yield _gauge("outcrop_disk_free_bytes", "Room on the disk of the data folder", free)
        if (stored := self.store.known()) is not None:
            yield _gauge(
                "outcrop_store_bytes", "Size of the files in the data folder, counted lately", stored
            )

    def _upkeep(self) -> Iterator[Metric]:
        ages = GaugeMetricFamily(
            "outcrop_upkeep_age_seconds", "Since the last backup, audit or check of contents", labels=["act"]
        )
        faults = GaugeMetricFamily(
            "outcrop_upkeep_faults", "Faults that the last of it found", labels=["act"]
        )
        for act in ACTS:
            if (last := noted(self.repo, act)) is not None:
                ages.add_metric([act], (utc_now() - last[0]).total_seconds())
                faults.add_metric([act], last[1])
        yield ages
        yield faults

    def _workers(self) -> Iterator[Metric]:
        there = present(self.repo.job_dir())
        down = sum(bool(p.trouble) for p in there)
        workers = GaugeMetricFamily(
            "outcrop_workers", "Workers that say they are there, by how their engine fares", labels=["engine"]
        )
        workers.add_metric(["down"], down)
        workers.add_metric(["up"], len(there) - down)
        yield workers
        if self.worker is not None:
            up, alive = not self.worker.engine.trouble, self.worker.alive
            failures = self.worker.engine.failures
            yield _gauge("outcrop_engine_up", "1 while this worker's engine takes work", up)
            yield _gauge("outcrop_engine_failures", "Failures of this worker's engine", failures)
            yield _gauge("outcrop_worker_up", "1 while this worker looks for jobs", alive)

    def _work(self) -> Iterator[Metric]:
        labels = ["worker", "kind"]
        attempts = CounterMetricFamily("outcrop_job_attempts", "Attempts that were begun", labels=labels)
        lost = CounterMetricFamily(
            "outcrop_job_leases_lost", "Jobs taken over, their lease over", labels=labels
        )
        seconds = HistogramMetricFamily("outcrop_job_seconds", "Time that an attempt took", labels=labels)
        memory = HistogramMetricFamily(
            "outcrop_job_memory_bytes", "Most memory of the process while it did a job", labels=labels
        )
        for worker, kinds in tallies(self.repo.job_dir()).items():
            for kind, counted in kinds.items():
                of = [worker, kind]
                attempts.add_metric(of, counted.attempts)
                lost.add_metric(of, counted.leases_lost)
                seconds.add_metric(of, _buckets(SECONDS, counted.seconds), counted.seconds.total)
                memory.add_metric(of, _buckets(BYTES, counted.memory), counted.memory.total)
        yield from (attempts, lost, seconds, memory)


def _gauge(name: str, what: str, value: float) -> GaugeMetricFamily:
    return GaugeMetricFamily(name, what, value=float(value))


def _buckets(bounds: tuple[float, ...], spread: Spread) -> list[tuple[str, float]]:
    """Return how many values there are up to each bound, as a histogram of Prometheus has them."""
    names = [*(f"{bound:g}" if bound < 1e5 else f"{bound:.1f}" for bound in bounds), "+Inf"]
    return list(zip(names, accumulate(spread.counts), strict=True))
