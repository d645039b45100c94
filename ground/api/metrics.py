"""What one server process counts of its requests, for Prometheus; `ground.app.exposition` adds the rest."""

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
