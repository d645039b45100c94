"""A cluster that is away, slow or killed: what the worker says, to whom, and that nothing is doubled."""

from __future__ import annotations

import logging
import os
import pickle
import subprocess
import sys
import threading
import time
from collections.abc import Iterator
from datetime import UTC, datetime, timedelta
from ipaddress import ip_address
from pathlib import Path
from typing import Any

import pytest
from cryptography import x509
from cryptography.hazmat.primitives import hashes, serialization
from cryptography.hazmat.primitives.asymmetric import ec
from cryptography.x509.oid import NameOID

from ground.campaigns.dask_engine import DaskEngine
from ground.cluster import Cluster, do_as, program
from ground.errors import OtherProgramError, UnavailableError
from ground.gdr.repository import Repository
from ground.jobs.engine import of_engine
from ground.jobs.executors import ClusterExecutor, is_news
from ground.jobs.presence import FORGOTTEN_S, GONE_S, Beat, Presence, present
from ground.jobs.worker import Worker
from ground.settings import ExecutorKind, SettingsError, load_settings
from studies.service_kills import free_port
from tests.ground.conftest import Api
from tests.ground.test_jobs import (
    KINDS,
    SETTLED,
    claim_job,
    let_lease_run_out,
    queue,
    row_of,
    with_settings,
)
from tests.waiting import until

ROOT = Path(__file__).resolve().parents[2]
AWAY = Presence(
    "far:7", "distributed", 0, "OSError: the Dask scheduler does not answer", "2026-11-23T09:00:00Z"
)


def open_files() -> int:
    return len(list(Path("/proc/self/fd").iterdir()))


def test_a_scheduler_that_is_away_is_told_within_seconds_and_leaves_nothing_open() -> None:
    """Dask itself tries for 30 s and leaves a thread and three files open each time."""
    port, threads = free_port(), threading.active_count()
    files = open_files()
    began = time.monotonic()
    with pytest.raises(
        OSError, match=rf"the Dask scheduler tcp://127.0.0.1:{port} does not answer \(Connection"
    ):
        ClusterExecutor(Cluster(f"tcp://127.0.0.1:{port}"))
    assert time.monotonic() - began < 5.0
    assert (threading.active_count(), open_files()) == (threads, files)


@pytest.mark.parametrize(("error", "told"), [("FutureCancelledError", False), ("ValueError", True)])
def test_work_that_a_lost_scheduler_drops_is_told_by_the_worker_alone(error: str, told: bool) -> None:
    kind = type(error, (Exception,), {})
    record = logging.LogRecord(
        "tornado.application", logging.ERROR, "", 0, "in callback", (), (kind, kind(), None)
    )
    assert is_news(record) is told
    assert is_news(logging.LogRecord("tornado.application", logging.ERROR, "", 0, "no traceback", (), None))


def test_a_server_without_a_worker_says_how_the_engine_of_another_process_fares(api: Api) -> None:
    beat = Beat(api.repo.job_dir())
    beat.say(AWAY)
    told = api.get("/readyz")
    assert told["status"] == "degraded"
    assert told["checks"]["workers"] == (
        "degraded: far:7: OSError: the Dask scheduler does not answer since 2026-11-23T09:00:00Z, tried again"
    )
    metrics = api("GET", "/metrics").text
    assert 'outcrop_workers{engine="down"} 1.0' in metrics
    beat.say(Presence("far:7", "distributed", 2))
    told = api.get("/readyz")
    assert (told["status"], told["checks"]["workers"]) == ("ok", "ok")
    beat.leave()
    assert "workers" not in api.get("/readyz")["checks"]


def test_a_worker_that_is_not_heard_of_is_gone_and_forgotten_in_the_end(sqlite_repo: Repository) -> None:
    folder = sqlite_repo.job_dir()
    Beat(folder).say(AWAY)
    (path,) = folder.glob("*.worker")
    assert present(folder) == [AWAY]
    os.utime(path, (0, time.time() - GONE_S - 1.0))
    assert present(folder) == []
    os.utime(path, (0, time.time() - FORGOTTEN_S - 1.0))
    Beat(folder).say(Presence("near:1", "process", 0))
    assert [p.name for p in present(folder)] == ["near:1"]
    assert not path.exists()


def test_work_of_an_attempt_before_is_asked_to_stop_by_whoever_takes_the_job_over(
    sqlite_repo: Repository,
) -> None:
    job = queue(sqlite_repo, "succeed")
    assert claim_job(sqlite_repo, KINDS, "killed") is not None
    let_lease_run_out(sqlite_repo, job)
    assert Worker(sqlite_repo, KINDS, slots=1).run_until_idle() == 1
    assert row_of(sqlite_repo, job).token == 2
    assert (sqlite_repo.job_dir() / f"{job}-1.stop").exists()
    assert not (sqlite_repo.job_dir() / f"{job}-2.stop").exists()


class Dask:
    """A scheduler and a worker of Dask on loopback."""

    def __init__(self, folder: Path) -> None:
        self.folder, self.port = folder, free_port()
        self.address = f"tcp://127.0.0.1:{self.port}"
        self.processes: list[subprocess.Popen[bytes]] = []
        self.more: list[str] = []

    def start(self) -> None:
        """Start a scheduler and a worker."""
        self._run("scheduler", "--host", "127.0.0.1", "--port", str(self.port))
        self.more_workers(1)

    def more_workers(self, count: int) -> None:
        """Start so many workers."""
        for _ in range(count):
            own = ["--nthreads", "2", "--no-nanny", "--local-directory", str(self.folder)]
            self._run("worker", self.address, *own)

    def _run(self, *given: str) -> None:
        with (self.folder / "dask.log").open("ab") as log:
            command = [sys.executable, "-m", "dask", *given, *self.more, "--no-dashboard"]
            environment = {**os.environ, "PYTHONPATH": str(ROOT)}
            self.processes.append(subprocess.Popen(command, stdout=log, stderr=log, env=environment))

    def kill(self) -> None:
        """Kill all of it."""
        for process in self.processes:
            process.kill()
            process.wait()
        self.processes.clear()


@pytest.fixture
def dask(tmp_path: Path) -> Iterator[Dask]:
    made = Dask(tmp_path)
    made.start()
    yield made
    made.kill()


@pytest.mark.slow
def test_a_worker_outlives_a_cluster_that_is_killed_and_away_for_ten_seconds(
    sqlite_repo: Repository, dask: Dask
) -> None:
    """A real scheduler and worker: the job in its middle is begun again, later ones wait."""
    repo = with_settings(
        sqlite_repo, executor=ExecutorKind.DISTRIBUTED, dask_scheduler=dask.address, workers=2
    )
    worker = Worker(repo, KINDS)
    worker.start()
    try:
        first = queue(repo, "succeed")
        until(lambda: row_of(repo, first).state == "succeeded")
        middle = queue(repo, "hang-once")
        until(lambda: row_of(repo, middle).progress == 0.5)
        dask.kill()
        meanwhile = [queue(repo, "succeed") for _ in range(3)]
        until(lambda: "does not answer" in worker.engine.trouble)
        threading.Event().wait(10.0)
        assert worker.alive
        assert {row_of(repo, job).state for job in (middle, *meanwhile)} == {"queued"}
        dask.start()
        until(lambda: {row_of(repo, job).state for job in (middle, *meanwhile)} == {"succeeded"})
        assert not worker.engine.trouble
        mine = [first, middle, *meanwhile]
        assert sorted(i for i, _ in SETTLED if i in mine) == sorted(mine)  # each once
    finally:
        worker.stop()


# ---- TLS, and the same program on both sides


def certificates(folder: Path, name: str) -> dict[str, str]:
    """Make an authority and a certificate of it for loopback; return their files as settings name them."""
    folder.mkdir()
    now = datetime.now(UTC)

    def made(subject: str, issuer: str, key: Any, signer: Any, authority: bool) -> x509.Certificate:
        named = [x509.Name([x509.NameAttribute(NameOID.COMMON_NAME, who)]) for who in (subject, issuer)]
        builder = (
            x509.CertificateBuilder()
            .subject_name(named[0])
            .issuer_name(named[1])
            .public_key(key.public_key())
            .serial_number(x509.random_serial_number())
            .not_valid_before(now - timedelta(hours=1))
            .not_valid_after(now + timedelta(hours=1))
            .add_extension(x509.BasicConstraints(ca=authority, path_length=None), critical=True)
            .add_extension(x509.SubjectAlternativeName([x509.IPAddress(ip_address("127.0.0.1"))]), False)
        )
        return builder.sign(signer, hashes.SHA256())

    root, own = (ec.generate_private_key(ec.SECP256R1()) for _ in range(2))
    texts = {
        "ca": made(name, name, root, root, True).public_bytes(serialization.Encoding.PEM),
        "certificate": made("node", name, own, root, False).public_bytes(serialization.Encoding.PEM),
        "key": own.private_bytes(
            serialization.Encoding.PEM, serialization.PrivateFormat.PKCS8, serialization.NoEncryption()
        ),
    }
    for part, text in texts.items():
        (folder / f"{part}.pem").write_bytes(text)
    return {f"dask_{part}": str(folder / f"{part}.pem") for part in texts}


class SecureDask(Dask):
    """The same, with TLS on every line."""

    def __init__(self, folder: Path, files: dict[str, str]) -> None:
        super().__init__(folder)
        self.address = f"tls://127.0.0.1:{self.port}"
        names = (("--tls-ca-file", "ca"), ("--tls-cert", "certificate"), ("--tls-key", "key"))
        secure = [word for option, part in names for word in (option, files[f"dask_{part}"])]
        self.more = ["--protocol", "tls", *secure]


@pytest.mark.slow
def test_jobs_are_done_over_tls_and_strangers_are_turned_away(
    sqlite_repo: Repository, tmp_path: Path
) -> None:
    files, strange = certificates(tmp_path / "ours", "ours"), certificates(tmp_path / "theirs", "theirs")
    dask = SecureDask(tmp_path, files)
    dask.start()
    there: dict[str, Any] = {"executor": ExecutorKind.DISTRIBUTED, "dask_scheduler": dask.address}
    try:
        repo = with_settings(sqlite_repo, **there, **files)
        worker = Worker(repo, KINDS, slots=1)
        job = queue(repo, "succeed")
        worker.start()
        until(lambda: row_of(repo, job).state == "succeeded")
        worker.stop()
        stranger = Cluster(dask.address, *(strange[f"dask_{part}"] for part in ("certificate", "key", "ca")))
        plain = Cluster(f"tcp://127.0.0.1:{dask.port}")
        for refused in (stranger, plain):
            with pytest.raises(OSError, match=rf"the Dask scheduler .*:{dask.port} cannot be used \("):
                ClusterExecutor(refused)
    finally:
        dask.kill()


@pytest.mark.parametrize(
    ("address", "given", "said"),
    [
        (
            "tcp://10.0.0.7:8786",
            (),
            "the Dask scheduler tcp://10.0.0.7:8786 is beyond loopback, where TLS is needed: use tls:// and "
            "set OUTCROP_DASK_CERTIFICATE, OUTCROP_DASK_KEY and OUTCROP_DASK_CA",
        ),
        ("dask.example:8786", (), "the Dask scheduler dask.example:8786 is beyond loopback, where"),
        ("tcp://[::2]:1", (), "beyond loopback"),
        ("tcp://127.0.0.1.example:1", (), "beyond loopback"),
        ("tls://10.0.0.7:1", (), "the Dask scheduler tls://10.0.0.7:1 needs OUTCROP_DASK_CERTIFICATE"),
        ("tls://10.0.0.7:1", ("a.pem", "b.pem"), "the Dask scheduler tls://10.0.0.7:1 needs OUTCROP_DASK_CA"),
        ("tls://10.0.0.7:1", ("a", "b", "c"), "OUTCROP_DASK_CERTIFICATE='a': there is no such file"),
        (
            "tcp://127.0.0.1:1",
            ("a",),
            "the Dask scheduler tcp://127.0.0.1:1 takes no certificate: use tls://",
        ),
    ],
)
def test_beyond_loopback_a_cluster_without_tls_is_refused_everywhere(
    address: str, given: tuple[str, ...], said: str, tmp_path: Path
) -> None:
    cluster = Cluster(address, *given)
    assert cluster.refusal().startswith(said) or said in cluster.refusal()
    names = ("dask_certificate", "dask_key", "dask_ca")
    with pytest.raises(SettingsError) as at_start:
        load_settings(
            data_dir=tmp_path,
            executor="distributed",
            dask_scheduler=address,
            **dict(zip(names, given, strict=False)),
        )
    assert str(at_start.value) == cluster.refusal()
    for use, error in ((ClusterExecutor, OSError), (DaskEngine, UnavailableError)):
        with pytest.raises(error) as refused:
            use(cluster)
        assert str(refused.value) == cluster.refusal()


@pytest.mark.parametrize(
    "address", ["tcp://127.0.0.1:8786", "127.1.2.3:8786", "tcp://[::1]:1", "localhost:1"]
)
def test_on_loopback_a_cluster_needs_no_tls(address: str) -> None:
    assert Cluster(address).refusal() == ""


def test_work_for_another_program_is_not_begun_and_its_job_waits(monkeypatch: pytest.MonkeyPatch) -> None:
    begun: list[int] = []
    assert do_as(program(), lambda x: begun.append(x), 1) is None
    with pytest.raises(
        OtherProgramError, match=r"^a Dask worker runs outcrop 0.* this program is 0.0.9 \(abc\)$"
    ) as told:
        do_as("0.0.9 (abc)", begun.append, 2)
    assert begun == [1]
    assert of_engine(pickle.loads(pickle.dumps(told.value)))


def test_the_program_is_another_where_a_dictionary_or_profile_is(
    tmp_path: Path, monkeypatch: pytest.MonkeyPatch
) -> None:
    ours = program()
    (tmp_path / "hound.toml").write_text("name = 'hound'\n")
    monkeypatch.setenv("OUTCROP_PROFILES", str(tmp_path))
    program.cache_clear()
    other = program()
    (tmp_path / "hound.toml").write_text("name = 'Hound'\n")
    program.cache_clear()
    assert len({ours, other, program()}) == 3
    monkeypatch.delenv("OUTCROP_PROFILES")
    program.cache_clear()
    assert program() == ours
