"""One trace from the request to the work of its job, wherever that is done; none where nobody traces."""

from __future__ import annotations

import json
import logging
import os
import subprocess
import sys
from collections.abc import Callable, Iterator
from pathlib import Path
from typing import Any

import pytest
from distributed import Client
from opentelemetry.sdk.trace import ReadableSpan, TracerProvider
from opentelemetry.sdk.trace.export import SimpleSpanProcessor
from opentelemetry.sdk.trace.export.in_memory_span_exporter import InMemorySpanExporter
from opentelemetry.trace import SpanKind

from ground import tracing
from ground.app.job_kinds import job_kinds
from ground.app.service import JOB_KINDS
from ground.gdr.repository import Repository
from ground.jobs.row import JobRow
from ground.jobs.worker import Worker
from ground.logs import JsonFormatter
from ground.resources.jobs.cancel_job import retry_job
from ground.resources.missions.value import Mission
from ground.settings import ExecutorKind
from tests.ground.conftest import PLANNER, Api, yard
from tests.ground.planning import file_requests, planned
from tests.ground.test_cluster import Dask, dask
from tests.ground.test_jobs import KINDS, SETTLED, queue, row_of, with_settings
from tests.waiting import until

__all__ = ["dask"]

Named = Callable[[str], ReadableSpan]
CALLER = "00-4bf92f3577b34da6a3ce929d0e0e4736-00f067aa0ba902b7-01"
COLLECTOR = "OTEL_EXPORTER_OTLP_ENDPOINT"


@pytest.fixture
def spans() -> Iterator[InMemorySpanExporter]:
    """What was traced, in the order in which it ended."""
    exporter = InMemorySpanExporter()
    provider = TracerProvider()
    provider.add_span_processor(SimpleSpanProcessor(exporter))
    tracing.trace_with(provider)
    yield exporter
    tracing.trace_with(None)
    provider.shutdown()


def named(spans: InMemorySpanExporter, name: str) -> ReadableSpan:
    (found,) = [span for span in spans.get_finished_spans() if span.name == name]
    return found


def ids(span: ReadableSpan) -> tuple[int, int, int | None]:
    """Return the trace of a span, its own id, and that of its parent."""
    parent = span.parent
    return span.context.trace_id, span.context.span_id, None if parent is None else parent.span_id


def ask_for_paths(api: Api, mission: Mission, **headers: str) -> str:
    (sol,) = api.get(f"/missions/{mission.id}/sols")["items"]
    job = api.post(f"/missions/{mission.id}/path-networks", {"sol_id": sol["id"]}, 202, headers=headers)
    return str(job["id"])


def test_one_trace_leads_from_the_request_of_a_caller_to_the_work(
    api: Api, mission: Mission, spans: InMemorySpanExporter
) -> None:
    job = ask_for_paths(api, mission, traceparent=CALLER)
    api.jobs()
    request = named(spans, "POST /api/v1/missions/{mission_id}/path-networks")
    attempt, work = named(spans, "job build_path_network"), named(spans, "work build_path_network")
    trace, request_id, caller = ids(request)
    assert (trace, caller) == (int(CALLER[3:35], 16), int(CALLER[36:52], 16))
    assert ids(attempt)[::2] == (trace, request_id)
    assert ids(work)[::2] == (trace, ids(attempt)[1])
    assert request.kind is SpanKind.SERVER
    assert request.attributes is not None
    assert request.attributes["http.response.status_code"] == 202
    assert attempt.attributes == {"outcrop.job.id": job, "outcrop.job.attempt": 1}
    assert attempt.status.is_ok or attempt.status.is_unset
    times = [span.start_time or 0 for span in (request, attempt, work)]
    assert times == sorted(times)
    assert (work.end_time or 0) <= (attempt.end_time or 0)


def test_a_request_without_a_caller_or_with_a_malformed_one_begins_a_trace(
    sqlite_api: Api, spans: InMemorySpanExporter
) -> None:
    for sent in (None, "", "00-0-0-01", CALLER.replace("4bf9", "4BF9"), f"00-{'0' * 32}-{'1' * 16}-01"):
        spans.clear()
        sqlite_api("GET", "/missions", headers={} if sent is None else {"traceparent": sent})
        (span,) = spans.get_finished_spans()
        assert span.parent is None
    assert tracing.trace_id() == ""


def test_every_line_of_the_log_names_the_trace(
    sqlite_api: Api, sqlite_repo: Repository, spans: InMemorySpanExporter, caplog: pytest.LogCaptureFixture
) -> None:
    lines: list[dict[str, Any]] = []

    class Kept(logging.Handler):
        def emit(self, record: logging.LogRecord) -> None:
            lines.append(json.loads(JsonFormatter().format(record)))

    handler = Kept()
    logging.getLogger("ground").addHandler(handler)
    caplog.set_level(logging.DEBUG, logger="ground")
    try:
        sqlite_api("GET", "/missions", headers={"traceparent": CALLER})
        with tracing.within(CALLER):
            queue(sqlite_repo, "break")
        Worker(sqlite_repo, KINDS, slots=1).run_until_idle()
    finally:
        logging.getLogger("ground").removeHandler(handler)
    told = {line["message"]: line.get("trace_id") for line in lines}
    assert told == dict.fromkeys(("answered", "job begun", "job failed"), CALLER[3:35])
    assert named(spans, "job count").status.description == "it has no result"


def traced_job(repo: Repository, what: str = "succeed") -> str:
    with tracing.within(CALLER):
        return queue(repo, what)


def of_the_caller(spans: InMemorySpanExporter) -> str:
    """Return where the one job of the caller was done, whose spans hang together."""
    attempt, work = named(spans, "job count"), named(spans, "work count")
    assert ids(attempt)[::2] == (int(CALLER[3:35], 16), int(CALLER[36:52], 16))
    assert ids(work)[::2] == ids(attempt)[:2]
    assert work.attributes is not None
    return str(work.attributes["outcrop.work.place"])


def test_work_in_another_process_belongs_to_the_trace(
    sqlite_repo: Repository, spans: InMemorySpanExporter
) -> None:
    repo = with_settings(sqlite_repo, executor=ExecutorKind.PROCESS)
    traced_job(repo)
    Worker(repo, KINDS, slots=1).run_until_idle()
    assert not of_the_caller(spans).endswith(f":{os.getpid()}")


def test_a_line_that_work_logs_in_its_process_names_the_trace(sqlite_repo: Repository) -> None:
    repo = with_settings(sqlite_repo, executor=ExecutorKind.PROCESS, log_format="json")
    traced, plain = traced_job(repo, "log"), queue(repo, "log")
    Worker(repo, KINDS, slots=1).run_until_idle()
    lines = {job: json.loads(result["line"]) for job, result in SETTLED if job in (traced, plain)}
    assert lines[traced]["message"] == "nearly done"
    assert [lines[job].get("trace_id") for job in (traced, plain)] == [CALLER[3:35], None]


@pytest.mark.slow
def test_work_on_a_cluster_belongs_to_the_trace(
    sqlite_repo: Repository, dask: Dask, spans: InMemorySpanExporter
) -> None:
    repo = with_settings(
        sqlite_repo, executor=ExecutorKind.DISTRIBUTED, dask_scheduler=dask.address, workers=1
    )
    worker = Worker(repo, KINDS, slots=1)
    worker.start()
    try:
        job = traced_job(repo)
        until(lambda: row_of(repo, job).state == "succeeded")
        until(lambda: len(spans.get_finished_spans()) == 2)
    finally:
        worker.stop()
    assert of_the_caller(spans).endswith(f":{dask.processes[1].pid}")


@pytest.mark.slow
def test_a_campaign_on_a_cluster_is_flown_by_all_of_it_and_each_unit_has_its_span(
    sqlite_api: Api, terrain_folder: Path, dask: Dask, spans: InMemorySpanExporter
) -> None:
    api = sqlite_api
    mission = yard(api.repo, terrain_folder)
    file_requests(api, mission)
    plan = planned(api, mission)
    order = {"plan_id": plan["id"], "runs": 1000, "seed": 5}
    here = api.post(f"/missions/{mission.id}/campaigns", order, status=202)["subject_id"]
    api.jobs()
    dask.more_workers(1)
    with Client(dask.address, set_as_default=False) as client:
        client.wait_for_workers(2)
    spans.clear()
    asked = api.post(f"/missions/{mission.id}/campaigns", order, 202, headers={"traceparent": CALLER})
    there = asked["subject_id"]
    repo = with_settings(api.repo, executor=ExecutorKind.DISTRIBUTED, dask_scheduler=dask.address, workers=1)
    worker = Worker(repo, job_kinds(), slots=1)
    worker.start()
    try:
        until(lambda: api.get(f"/campaigns/{there}")["state"] == "succeeded")
        until(lambda: any(span.name == "work fly_campaign" for span in spans.get_finished_spans()))
    finally:
        worker.stop()
    rows = [api("GET", f"/campaigns/{name}/runs.csv").text for name in (here, there)]
    assert rows[0] == rows[1]
    work = named(spans, "work fly_campaign")
    units = [span for span in spans.get_finished_spans() if span.name.startswith("unit main ")]
    assert sorted(span.name for span in units) == sorted(f"unit main {k}" for k in range(10))
    assert {ids(span)[::2] for span in units} == {ids(work)[:2]}
    places = {str(span.attributes and span.attributes["outcrop.work.place"]) for span in units}
    assert {int(place.rpartition(":")[2]) for place in places} == {p.pid for p in dask.processes[1:]}


def test_an_attempt_that_is_handed_back_has_its_span_and_the_next_one_too(
    sqlite_repo: Repository, spans: InMemorySpanExporter
) -> None:
    repo = with_settings(sqlite_repo, executor=ExecutorKind.PROCESS)
    traced_job(repo, "die-once")
    Worker(repo, KINDS, slots=1).run_until_idle()
    first, second = [span for span in spans.get_finished_spans() if span.name == "job count"]
    assert first.context.trace_id == second.context.trace_id
    assert [span.attributes and span.attributes["outcrop.job.attempt"] for span in (first, second)] == [1, 2]
    assert (first.status.is_ok, second.status.is_unset) == (False, True)


def test_a_job_asked_for_again_belongs_to_the_trace_of_who_asked_again(
    sqlite_repo: Repository,
) -> None:
    job = traced_job(sqlite_repo, "fail")
    Worker(sqlite_repo, KINDS, slots=1).run_until_idle()
    again = CALLER.replace("4bf9", "aaaa")
    with tracing.within(again):
        retry_job(sqlite_repo, PLANNER, job)
    assert row_of(sqlite_repo, job).traceparent == again


def test_tracing_changes_no_result(sqlite_repo: Repository, spans: InMemorySpanExporter) -> None:
    plain, traced = queue(sqlite_repo, "succeed"), traced_job(sqlite_repo)
    Worker(sqlite_repo, KINDS, slots=1).run_until_idle()
    results = dict(SETTLED)
    assert results[plain] == results[traced] == {"answer": 42}
    payloads = [row_of(sqlite_repo, job).payload for job in (plain, traced)]
    assert payloads[0] == payloads[1]


def test_jobs_of_a_service_that_does_not_trace_have_no_trace(api: Api, mission: Mission) -> None:
    job = ask_for_paths(api, mission, traceparent=CALLER)
    api.jobs()
    with api.repo.database.read() as session:
        assert session.get_one(JobRow, job).traceparent is None
    assert "build_path_network" in JOB_KINDS


def outcrop(program: str, **environment: str) -> subprocess.CompletedProcess[str]:
    env = {k: v for k, v in os.environ.items() if not k.startswith("OTEL_")} | environment
    return subprocess.run(
        [sys.executable, "-c", program], capture_output=True, text=True, env=env, check=False
    )


IMPORTED = (
    "import sys; from ground import tracing; import ground.app.service; tracing.set_up();"
    "print([m for m in sys.modules if m.startswith(('opentelemetry.sdk', 'opentelemetry.exporter'))],"
    "tracing._tracer is not None)"
)
"""Its mere interface is imported by the web framework itself, where that is installed."""


def test_nothing_of_it_is_imported_where_no_collector_is_named() -> None:
    assert outcrop(IMPORTED).stdout == "[] False\n"
    off = {COLLECTOR: "http://127.0.0.1:9", "OTEL_SDK_DISABLED": "true"}
    assert outcrop(IMPORTED, **off).stdout == "[] False\n"


def test_a_collector_that_is_named_is_traced_to() -> None:
    program = (
        "from http.server import BaseHTTPRequestHandler, HTTPServer; import os, threading\n"
        "class Collector(BaseHTTPRequestHandler):\n"
        "    def do_POST(self):\n"
        "        sent = self.rfile.read(int(self.headers['Content-Length']))\n"
        "        print(self.path, b'job count' in sent, b'outcrop' in sent, flush=True)\n"
        "        self.send_response(200); self.end_headers()\n"
        "    def log_message(self, *_): pass\n"
        "server = HTTPServer(('127.0.0.1', 0), Collector)\n"
        "threading.Thread(target=server.serve_forever, daemon=True).start()\n"
        f"os.environ[{COLLECTOR!r}] = f'http://127.0.0.1:{{server.server_port}}'\n"
        "from ground import tracing\n"
        "tracing.set_up()\n"
        "tracing.record('job count', '', 1, 2, {'outcrop.job.id': 'job-1'})\n"
    )
    done = outcrop(program)
    assert done.stdout == "/v1/traces True True\n", done.stderr


@pytest.mark.parametrize("command", [["worker", "--once"], ["serve", "--port", "0"]])
def test_a_collector_without_the_extra_is_one_line(command: list[str], sqlite_repo: Repository) -> None:
    program = (
        "import sys; sys.modules['opentelemetry'] = None; from ground.cli import main;"
        f"sys.argv = ['outcrop', *{command}]; main()"
    )
    folder = sqlite_repo.data_dir
    done = outcrop(
        program, OUTCROP_DATA_DIR=str(folder), OUTCROP_DATABASE_URL="", **{COLLECTOR: "http://127.0.0.1:9"}
    )
    assert done.returncode == 2, done.stderr
    (line,) = done.stderr.strip().splitlines()
    assert line == (
        f"outcrop: {COLLECTOR} needs the package opentelemetry, which is not installed: "
        "pip install 'outcrop[otel]'"
    )
    assert Path(folder).is_dir()
