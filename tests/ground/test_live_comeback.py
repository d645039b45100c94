"""Live runs that come back, are told to stop, or are watched: what is believed, fetched, said."""

from __future__ import annotations

import configparser
import errno
import json
import threading
from collections.abc import Iterator
from contextlib import contextmanager
from pathlib import Path
from typing import Any

import pytest

from executive.errors import JournalError, WireError
from executive.runtime.control import CONTROL_SOCKET, RunControl
from executive.runtime.live import LiveRuntime, LiveSettings
from executive.runtime.wire import About, Address, RoverServer, WireRover
from executive.runtime.wire.address import listen
from executive.runtime.wire.downloads import Downloads
from ground.errors import ArchiveError, InvalidInputError, StateError
from ground.uplink import live as live_module
from ground.uplink import onboard
from ground.uplink.live import (
    DICTIONARY,
    JOURNAL,
    LiveOptions,
    LivePlace,
    execute_live,
    run_id_of,
    run_live,
    stop_run,
)
from ground.uplink.verify import read_package
from tests.executive.wire.servers import JumpingClock, Waiter
from tests.ground.live_site import ROOT, Site, live_site, rover_process
from tests.waiting import until

LOOK = """(plan :id day :node (block :id all :node-list (
  (task :id look :action image)
  (task :id rest :action wait :parameters (duration_s = {})))))"""
SETTINGS = LiveOptions().settings(1.0)


# ---- products


@pytest.mark.parametrize(("rest_s", "when"), [(60.0, "in mid-plan"), (0.1, "after its last task")])
def test_products_of_a_run_that_was_killed_come_down_when_it_comes_back(
    rest_s: float, when: str, tmp_path: Path, monkeypatch: pytest.MonkeyPatch
) -> None:
    address, out = Address(tmp_path / "r.sock"), tmp_path / "run"
    began: list[RunControl] = []

    def first() -> None:
        run_live(
            LOOK.format(rest_s),
            rover,
            out,
            settings=SETTINGS,
            resume=False,
            about={},
            on_runtime=began.append,
        )

    with rover_process(address):
        with monkeypatch.context() as nothing_comes_down:
            nothing_comes_down.setattr(Downloads, "request", lambda *_: None)
            rover = WireRover(address, run="killed", out=out)
            rover.wait_ready(30)
            thread = threading.Thread(target=first)
            thread.start()
            until(lambda: '"e":"product"' in journal_text(out))
            if rest_s > 1:
                began[0].runtime.shut_down()  # what is in memory is gone now
            thread.join(30)
            rover.close()
        products = [p for p in json_lines(out) if p]
        assert products
        assert not any((out / p).exists() for p in products)
        rover = WireRover(address, run="killed", out=out)
        thread = threading.Thread(
            target=lambda: run_live(
                LOOK.format(rest_s),
                rover,
                out,
                settings=SETTINGS,
                resume=True,
                about={},
                on_runtime=began.append,
            )
        )
        thread.start()
        until(lambda: all((out / p).is_file() for p in products))
        until(lambda: len(began) == 2)
        began[1].runtime.stop()
        thread.join(60)
        assert not thread.is_alive()
        rover.close()


def journal_text(out: Path) -> str:
    path = out / JOURNAL
    return path.read_text("utf-8") if path.exists() else ""


def json_lines(out: Path) -> list[str]:
    """Return the paths of the products that a journal tells of."""
    steps = [json.loads(line) for line in journal_text(out).splitlines()]
    return [e["path"] for r in steps if r.get("k") == "step" for e in r["events"] if e["e"] == "product"]


# ---- what a run believes


@contextmanager
def telling_rover(site: Site, dictionary: tuple[str, str, str], rate: float = 1.0) -> Iterator[Waiter]:
    """Give a rover that tells its dictionary and the rate of its clock."""
    rover = Waiter(JumpingClock())
    told = dict(zip(("name", "version", "sha256"), dictionary, strict=True))
    door = listen(site.address)
    server = RoverServer(rover, About("waiter", rate, told), rover.clock)
    thread = threading.Thread(target=server.serve, args=(door,), daemon=True)
    thread.start()
    try:
        yield rover
    finally:
        server.stop_serving()
        thread.join(timeout=5)
        door.close()


@pytest.mark.parametrize("resume", [False, True])
@pytest.mark.parametrize("stale", ["of another run", "torn"])
def test_a_dictionary_that_lies_in_the_folder_is_not_taken_for_the_rovers(
    resume: bool, stale: str, tmp_path: Path
) -> None:
    site = live_site(tmp_path)
    site.run.mkdir()
    told = dict(zip(("name", "version", "sha256"), site.dictionary, strict=True))
    text = json.dumps({"run": "another", **told}) if stale == "of another run" else '{"name": "ou'
    (site.run / DICTIONARY).write_text(text)
    place = LivePlace(site.address, site.world, site.trust)
    with (
        telling_rover(site, ("other", "1", "0" * 64)),
        pytest.raises(ArchiveError, match="this rover has other 1"),
    ):
        execute_live(site.package, place, site.run, resume=resume, signals=False)


def test_a_run_that_comes_back_knows_its_rovers_dictionary_and_rate_without_it(
    tmp_path: Path, monkeypatch: pytest.MonkeyPatch
) -> None:
    site = live_site(tmp_path)
    place = LivePlace(site.address, site.world, site.trust)
    package = read_package(site.package.read_bytes())
    found: list[LiveSettings] = []

    def conducted(crl: str, rover: WireRover, out: Path, **more: Any) -> object:
        found.append(more["settings"])
        run = LiveRuntime(
            crl, Waiter(JumpingClock()), run_id=rover.run, journal=out / JOURNAL, settings=found[-1]
        )
        run.shut_down()
        raise KeyboardInterrupt

    monkeypatch.setattr(live_module, "run_live", conducted)
    with telling_rover(site, site.dictionary, rate=8.0), pytest.raises(KeyboardInterrupt):
        execute_live(site.package, place, site.run, resume=True, signals=False)
    assert json.loads((site.run / DICTIONARY).read_text())["run"] == run_id_of(package)

    def again(_crl: str, _rover: WireRover, _out: Path, **more: Any) -> object:
        found.append(more["settings"])
        raise KeyboardInterrupt

    monkeypatch.setattr(live_module, "run_live", again)
    with pytest.raises(KeyboardInterrupt):  # nobody answers at the address
        execute_live(site.package, place, site.run, resume=True, signals=False)
    assert found[0] == found[1]
    assert found[1].silence_ms == 8 * 60_000


# ---- stops


def test_a_stop_is_not_called_done_before_the_rover_says_so(tmp_path: Path) -> None:
    site = live_site(tmp_path)
    rover = Waiter(JumpingClock())
    door = listen(site.address)
    server = RoverServer(rover, About("waiter"), rover.clock)
    thread = threading.Thread(target=server.serve, args=(door,), daemon=True)
    thread.start()
    line = WireRover(site.address, run="run", out=site.run)
    line.wait_ready(30)
    plan = LOOK.format(600).replace("(task :id look :action image)", "")
    run = threading.Thread(
        target=lambda: run_live(plan, line, site.run, settings=SETTINGS, resume=False, about={})
    )
    run.start()
    busy = threading.Event()
    try:
        until(lambda: rover.running and (site.run / CONTROL_SOCKET).exists())
        server._lead.do(lambda: busy.wait(60) and None)  # the rover hangs
        (site.run / "live.json").write_text(json.dumps({"connect": str(site.address), "keys": None}))
        with pytest.raises(StateError, match="has not said that it has stopped"):
            stop_run(site.run, rover_s=0.5)
        busy.set()
        assert "says that it has stopped" in stop_run(site.run)
        assert not rover.running
    finally:
        busy.set()
        run.join(30)
        line.close()
        server.stop_serving()
        thread.join(5)
        door.close()


# ---- supervision


@pytest.mark.parametrize(
    ("raised", "status"),
    [
        (WireError("no rover answers"), 75),
        (OSError(errno.ENOSPC, "No space left on device"), 75),
        (OSError(errno.ENOENT, "No such file or directory"), 2),
        (InvalidInputError("there is nothing to resume"), 2),
        (RuntimeError("a defect"), 70),
    ],
)
def test_a_supervisor_is_told_whether_trying_again_may_help(
    raised: Exception, status: int, tmp_path: Path, monkeypatch: pytest.MonkeyPatch
) -> None:
    def fails(*_args: object, **_more: object) -> object:
        raise raised

    monkeypatch.setattr(live_module, "execute_live", fails)
    nothing = str(tmp_path / "none")
    verb = ["execute", nothing, "--connect", "unix:" + nothing, "--world", nothing, "--trust", nothing]
    assert onboard.main([*verb, "--out", nothing]) == status
    assert onboard.main([*verb, "--out", nothing, "--connect", "nowhere"]) == 2


def test_a_journal_on_a_full_disk_is_tried_again(tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> None:
    def fails(*_args: object, **_more: object) -> object:
        raise JournalError("cannot be written") from OSError(errno.ENOSPC, "No space left on device")

    monkeypatch.setattr(live_module, "execute_live", fails)
    nothing = str(tmp_path / "none")
    verb = ["execute", nothing, "--connect", "unix:" + nothing, "--world", nothing, "--trust", nothing]
    assert onboard.main([*verb, "--out", nothing]) == 75


def test_the_unit_starts_again_what_may_be_mended_and_nothing_else() -> None:
    unit = configparser.ConfigParser(strict=False, interpolation=None)
    unit.optionxform = str  # type: ignore[assignment,method-assign]
    unit.read(ROOT / "deploy" / "outcrop-live.service")
    service = unit["Service"]
    over = {int(code) for code in service["SuccessExitStatus"].split()}
    refused = {int(code) for code in service["RestartPreventExitStatus"].split()}
    assert over == {onboard.SUCCEEDED, onboard.ENDED_OTHERWISE}
    assert refused == {onboard.REFUSED}
    assert not (over | refused) & {onboard.DEFECT, onboard.TRY_AGAIN}
    assert service["Restart"] == "on-failure"


# ---- who tells


class _Teller:
    """A teller whose disk is full now and then."""

    def __init__(self) -> None:
        self.told = 0

    def tell(self) -> None:
        self.told += 1
        if self.told % 2:
            raise OSError(errno.ENOSPC, "No space left on device")

    def line(self, _kind: str, _data: object) -> None:
        raise OSError(errno.ENOSPC, "No space left on device")


def test_a_job_that_is_given_up_aborts_its_run_even_if_nothing_can_be_told(tmp_path: Path) -> None:
    from ground.resources.runs.live_work import _Watch

    asked: list[object] = []
    runtime = LiveRuntime(LOOK.format(1), Waiter(JumpingClock()), run_id="run", journal=tmp_path / JOURNAL)
    control = RunControl(runtime)
    control.answer = lambda request: asked.append(request) or {"ok": True}  # type: ignore[method-assign,func-returns-value]
    wanted = iter([OSError("the database is busy"), True])

    def should_stop() -> bool:
        found = next(wanted, True)
        if isinstance(found, Exception):
            raise found
        return found

    def report(_share: float, _text: str) -> None:
        raise OSError("the database is away")

    watch = _Watch(_Teller(), 10.0, report, should_stop)  # type: ignore[arg-type]
    watch.begin(control)
    until(lambda: asked)
    watch.end()
    runtime.shut_down()
    assert asked == [{"m": "abort"}]


# ---- who serves


def test_a_rovers_door_is_not_there_before_the_rover(tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> None:
    from ground.uplink.serve_rover import Serving, serve_rover
    from rover_iface import registry
    from tests.ground.signed import small_world

    place = Address(tmp_path / "r.sock")

    def build(*_args: object, **_more: object) -> object:
        assert place.path is not None
        assert not place.path.exists()
        raise LookupError("nobody could build it")

    monkeypatch.setattr(registry, "find_rover", lambda _name: build)
    with pytest.raises(LookupError):
        serve_rover(Serving("abstract", small_world(tmp_path), place), lambda _line: None)
    assert place.path is not None
    assert not place.path.exists()
