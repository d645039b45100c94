"""Prometheus metrics of one server process."""

from __future__ import annotations

from functools import lru_cache

from prometheus_client import (
    CollectorRegistry,
    Counter,
    Gauge,
    Histogram,
)

REGISTRY = CollectorRegistry()
REQUESTS = Counter(
    "outcrop_http_requests_total", "Requests answered", ["method", "route", "status"], registry=REGISTRY
)
DURATION = Histogram(
    "outcrop_http_request_seconds",
    "Time to answer a request",
    ["method"],
    buckets=(0.002, 0.005, 0.01, 0.02, 0.05, 0.1, 0.2, 0.5, 1, 2, 5),
    registry=REGISTRY,
)
JOBS = Gauge("outcrop_jobs", "Jobs by kind and state", ["kind", "state"], registry=REGISTRY)
JOB_WAIT = Gauge("outcrop_job_oldest_waiting_seconds", "Age of the job that waits longest", registry=REGISTRY)
DISK_FREE = Gauge("outcrop_disk_free_bytes", "Room on the disk of the data folder", registry=REGISTRY)
DATABASE_SIZE = Gauge("outcrop_database_bytes", "Size of the database", registry=REGISTRY)
PRODUCTS_SIZE = Gauge("outcrop_product_bytes", "Size of all data products", registry=REGISTRY)
EVENTS = Gauge("outcrop_history_events", "Events in the histories", registry=REGISTRY)
SINCE = Gauge(
    "outcrop_upkeep_age_seconds",
    "Since the last backup, audit or check of contents",
    ["act"],
    registry=REGISTRY,
)
FAULTS = Gauge("outcrop_upkeep_faults", "Faults that the last of it found", ["act"], registry=REGISTRY)
MISSIONS = Gauge("outcrop_missions", "Missions in the repository", registry=REGISTRY)
ENGINE_UP = Gauge("outcrop_engine_up", "1 while this worker's engine takes work", registry=REGISTRY)
ENGINE_FAILURES = Gauge("outcrop_engine_failures", "Failures of this worker's engine", registry=REGISTRY)
WORKER_UP = Gauge("outcrop_worker_up", "1 while this worker looks for jobs", registry=REGISTRY)
WORKERS = Gauge(
    "outcrop_workers",
    "Workers that say they are there, by how their engine fares",
    ["engine"],
    registry=REGISTRY,
)
STREAMS = Gauge("outcrop_event_streams", "Open event streams", registry=REGISTRY)


_METHODS = {"GET", "HEAD", "POST", "PATCH", "PUT", "DELETE", "OPTIONS"}


@lru_cache(maxsize=2048)
def _children(method: str, route: str, status: int) -> tuple[Counter, Histogram]:
    return REQUESTS.labels(method, route, status), DURATION.labels(method)


def observe(method: str, route: str, status: int, seconds: float) -> None:
    """Count one answered request."""
    counter, histogram = _children(method if method in _METHODS else "other", route, status)
    counter.inc()
    histogram.observe(seconds)
