"""Traces for OpenTelemetry (extra `otel`): a span for each request, each attempt at a job, and its work.

Nothing of it is imported before `set_up` finds that the environment names a collector. The trace that
something belongs to is known by its `traceparent` (W3C Trace Context, 2021), which needs no OpenTelemetry: it
stands in the row of a job and, by its trace id, in each line of the log. Work in another process or on a
cluster says when and where it was done, and the worker that asked for it makes the span.
"""

from __future__ import annotations

import os
import re
import socket
import time
from collections.abc import Iterator, Mapping
from contextlib import contextmanager
from contextvars import ContextVar, Token
from dataclasses import dataclass
from typing import Any

from ground.errors import UnavailableError
from ground.extras import how_to_get

COLLECTORS = ("OTEL_EXPORTER_OTLP_TRACES_ENDPOINT", "OTEL_EXPORTER_OTLP_ENDPOINT")
"""The variables of OpenTelemetry that say where to send."""
TRACEPARENT: ContextVar[str] = ContextVar("traceparent", default="")
"""What is being done here and now, for what it asks others to do; empty where nobody traces."""
_FORM = re.compile(r"00-(?!0{32})[0-9a-f]{32}-(?!0{16})[0-9a-f]{16}-[0-9a-f]{2}", re.ASCII)
_tracer: Any = None

Attributes = Mapping[str, str | int | float]


def set_up() -> None:
    """Trace from now on, if the environment names a collector.

    Raises
    ------
    UnavailableError
        If it does and the extra is not installed.
    """
    named = next((name for name in COLLECTORS if os.environ.get(name)), "")
    if not named or os.environ.get("OTEL_SDK_DISABLED", "").lower() == "true":
        return
    try:
        from opentelemetry.exporter.otlp.proto.http.trace_exporter import OTLPSpanExporter
        from opentelemetry.sdk.resources import Resource
        from opentelemetry.sdk.trace import TracerProvider
        from opentelemetry.sdk.trace.export import BatchSpanProcessor
    except ModuleNotFoundError as err:
        raise UnavailableError(f"{named} needs {how_to_get('opentelemetry')}") from err
    name = os.environ.get("OTEL_SERVICE_NAME") or "outcrop"
    provider = TracerProvider(resource=Resource.create({"service.name": name}))
    provider.add_span_processor(BatchSpanProcessor(OTLPSpanExporter()))
    trace_with(provider)


def trace_with(provider: Any) -> None:
    """Make spans of a provider of OpenTelemetry's from now on; with None none any more."""
    global _tracer
    _tracer = None if provider is None else provider.get_tracer("outcrop")


def trace_id() -> str:
    """Return the id of the trace that what is being done belongs to; empty without one."""
    return TRACEPARENT.get()[3:35]


@contextmanager
def within(traceparent: str) -> Iterator[None]:
    """Have what is done meanwhile belong to a trace."""
    mark = TRACEPARENT.set(traceparent)
    try:
        yield
    finally:
        TRACEPARENT.reset(mark)


@dataclass(frozen=True, slots=True)
class Part:
    """What a part of some work was, between two times (ns since 1970), and in which process it was done."""

    name: str
    began_ns: int
    ended_ns: int
    place: str


MOST_PARTS = 1000
"""Of one work that are noted: a trace of more is no longer looked at, and each is sent with the result."""
_PARTS: ContextVar[list[Part] | None] = ContextVar("parts", default=None)


@contextmanager
def noting_parts(wanted: bool) -> Iterator[list[Part]]:
    """Yield a list that fills with the parts done meanwhile, if they are wanted."""
    parts: list[Part] = []
    mark = _PARTS.set(parts if wanted else None)
    try:
        yield parts
    finally:
        _PARTS.reset(mark)


def note_part(part: Part) -> None:
    """Note a part that is done, where somebody wants to know it."""
    parts = _PARTS.get()
    if parts is not None and len(parts) < MOST_PARTS:
        parts.append(part)


def this_place() -> str:
    """Return the name of this process: its host and number."""
    return f"{socket.gethostname()}:{os.getpid()}"


class RequestSpan:
    """The span of a request that is being answered; what it asks for belongs to it."""

    def __init__(self, span: Any, mark: Token[str]) -> None:
        self._span, self._mark = span, mark

    def end(self, method: str, route: str, status: int) -> None:
        """End it; 0 is the status of what was not answered."""
        self._span.update_name(f"{method} {route}")
        told = {"http.request.method": method, "http.route": route, "http.response.status_code": status}
        self._span.set_attributes(told)
        if status >= 500 or not status:
            _fault(self._span, "")
        self._span.end()
        TRACEPARENT.reset(self._mark)


def begin_request(method: str, sent: str | None) -> RequestSpan | None:
    """Begin the span of a request, within the trace that it was `sent` with; None where nobody traces."""
    if _tracer is None:
        return None
    from opentelemetry.trace import SpanKind

    span = _tracer.start_span(method, context=_context(sent or ""), kind=SpanKind.SERVER)
    return RequestSpan(span, TRACEPARENT.set(_traceparent(span)))


def record(
    name: str, parent: str, began_ns: int, ended_ns: int, attributes: Attributes, fault: str = ""
) -> str:
    """Make a span of what was done between two times (since 1970); return its traceparent.

    Nothing is made, and the answer is empty, where nobody traces.
    """
    if _tracer is None:
        return ""
    context = _context(parent)
    span = _tracer.start_span(name, context=context, start_time=began_ns, attributes=dict(attributes))
    if fault:
        _fault(span, fault)
    span.end(ended_ns)
    return _traceparent(span)


def now_ns() -> int:
    """Return the time as spans tell it."""
    return time.time_ns()


def _fault(span: Any, what: str) -> None:
    from opentelemetry.trace import Status, StatusCode

    span.set_status(Status(StatusCode.ERROR, what or None))


def _context(traceparent: str) -> Any:
    """Return the context of a span elsewhere, or that of a new trace if it is none."""
    from opentelemetry.context import Context
    from opentelemetry.trace import NonRecordingSpan, SpanContext, TraceFlags, set_span_in_context

    if not _FORM.fullmatch(traceparent):
        return Context()
    _, trace, span, flags = traceparent.split("-")
    parent = SpanContext(
        int(trace, 16), int(span, 16), is_remote=True, trace_flags=TraceFlags(int(flags, 16))
    )
    return set_span_in_context(NonRecordingSpan(parent), Context())


def _traceparent(span: Any) -> str:
    context = span.get_span_context()
    return f"00-{context.trace_id:032x}-{context.span_id:016x}-{int(context.trace_flags):02x}"
