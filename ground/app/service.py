"""Join the parts: settings, repository, job kinds, worker, API, UI."""

from __future__ import annotations

import gc
import logging
import threading
from collections.abc import AsyncIterator, Mapping
from contextlib import asynccontextmanager

from fastapi import FastAPI
from starlette.concurrency import run_in_threadpool

from ground.api.context import look
from ground.api.hub import Hub
from ground.api.shared_reads import RowReads
from ground.app.api import build_api
from ground.app.compression import Compression
from ground.app.conditional import Conditional
from ground.app.courier import Courier
from ground.app.gate import Gate
from ground.app.job_kinds import job_kinds
from ground.app.pages import install_pages
from ground.app.warm_up import warm_up_quietly
from ground.gdr.repository import Repository, open_repository
from ground.jobs.queue import JobKind
from ground.jobs.worker import Worker
from ground.logs import set_up_logging
from ground.resources.kinds import KINDS
from ground.resources.mission_archives.copy_mission import sweep_copies
from ground.resources.people.accounts import ensure_profiles
from ground.resources.people.authentication import Identities
from ground.resources.people.first_administrator import invite
from ground.resources.people.log_in_limits import LogInLimits
from ground.resources.upkeep.store_size import StoreSize
from ground.settings import Settings, load_settings
from ground.spare_memory import SERVED_S, SpareMemory

logger = logging.getLogger(__name__)

JOB_KINDS: Mapping[str, JobKind] = job_kinds()
"""All long work that a worker can do."""


def make_worker(repo: Repository) -> Worker:
    """Return a worker for every kind of job."""
    return Worker(repo, JOB_KINDS)


def build_app(repo: Repository, *, with_worker: bool, warm: bool = False) -> FastAPI:
    """Return the whole service over a repository whose database is migrated.

    With `warm` the planner is got ready beside it, here for what-if and in a worker process for plans: the
    service does not wait for that.
    """
    worker = make_worker(repo) if with_worker else None
    courier = Courier(repo) if with_worker else None
    hub = Hub(repo)
    spare = SpareMemory(SERVED_S)

    @asynccontextmanager
    async def life(_app: FastAPI) -> AsyncIterator[None]:
        if worker is not None:
            worker.start(warm_up_quietly if warm else None)
        if courier is not None:
            courier.start()
        spare.start()
        if warm:
            threading.Thread(target=warm_up_quietly, name="warm-up", daemon=True).start()
        try:
            yield
        finally:
            if courier is not None:
                await run_in_threadpool(courier.stop)
            if worker is not None:
                await run_in_threadpool(worker.stop)
            await run_in_threadpool(hub.stop)
            await run_in_threadpool(spare.stop)
            repo.database.dispose()

    app = build_api(lifespan=life)
    identities = Identities(repo)
    app.state.repository = repo
    app.state.kinds = KINDS
    app.state.hub = hub
    app.state.reads = RowReads(repo, look)
    app.state.identities = identities
    app.state.limits = LogInLimits()
    app.state.worker = worker
    app.state.job_kinds = JOB_KINDS
    app.state.store_size = StoreSize(repo.data_dir)
    install_pages(app)
    app.add_middleware(Gate, repo=repo, identities=identities)
    app.add_middleware(Conditional)
    app.add_middleware(Compression)  # around the gate, which keeps answers as they were made
    return app


def say_how_to_begin(repo: Repository) -> None:
    """Write the token for the first administrator into the log, where nobody administers the service yet."""
    token = invite(repo)
    if token is not None:
        logger.critical(
            "nobody administers this service yet: open its page and make the first administrator with the "
            "one-time token %s",
            token,
        )


def create_app() -> FastAPI:
    """Return the service as `outcrop serve` runs it: settings from the environment, the database migrated."""
    settings: Settings = load_settings()
    set_up_logging(settings.log_format, settings.log_level)
    repo = open_repository(settings)
    ensure_profiles(repo)
    say_how_to_begin(repo)
    with repo.database.apart():
        sweep_copies(repo)
    app = build_app(repo, with_worker=settings.serve_worker, warm=settings.warm_up)
    spare_full_collections()
    return app


def spare_full_collections() -> None:
    """Make collections of all objects rare: each holds every answer of the process.

    Code and routes stay to the end, and are left out from now on (0.2 s each time). With a thousand streams
    open the rest takes as long again; what is garbage is nearly always found while it is young.
    """
    gc.collect()
    gc.freeze()
    gc.set_threshold(20_000, 10, 100)  # all objects once in 20 million allocations, not in 70,000
