"""Packages on the real clock: over the wire, killed and taken up again, stopped while all else hangs."""

from __future__ import annotations

import json
import os
import resource
import signal
import stat
import subprocess
import sys
import threading
import time
from datetime import timedelta
from functools import partial
from pathlib import Path

import pytest

from executive.errors import WireError
from executive.runtime.clocks import instant_of, utc_now
from executive.runtime.control import CONTROL_SOCKET, ask_run
from executive.runtime.journal import JournalFile
from executive.runtime.recovery import recorded_trace, replay
from executive.runtime.wire import WireRover
from ground.errors import AlreadyExecutedError, ArchiveError, InvalidInputError, StateError
from ground.uplink.flight import Flight
from ground.uplink.live import LiveOptions, LivePlace, complete, execute_live, run_id_of, run_live, stop_run
from ground.uplink.verify import read_package
from tests.ground.live_site import ROOT, Site, environment, live_site, lost_time, rover_process
from tests.waiting import until

LONG = """(plan :id day :node (block :id all :node-list (
  (task :id go :action navigate :parameters (x = 100.0 y = 0.0))
  (task :id rest :action wait :parameters (duration_s = 0.2)))))"""


def place_of(site: Site) -> LivePlace:
    return LivePlace(site.address, site.world, site.trust, dictionary=site.dictionary)


def sent(site: Site, task: str) -> bool:
    path = site.run / "journal.jsonl"
    return path.exists() and f'"{task}",1],"action"' in path.read_text("utf-8")


def ended(site: Site, task: str) -> bool:
    return f'"e":"end","a":["{task}"' in (site.run / "journal.jsonl").read_text("utf-8")


def wheel_speed(site: Site) -> float:
    """Return what the rover says its wheels do, asked as the run's own executive would not: by a new run."""
    line = WireRover(site.address, run="onlooker")
    try:
        line.wait_ready(60)
        return float(line.present_state()["wheel-speed"])
    finally:
        line.close()


def test_a_package_runs_on_the_real_clock_and_its_products_come_down(tmp_path: Path) -> None:
    site = live_site(tmp_path)
    with rover_process(site.address):
        begun = utc_now()
        with lost_time(tmp_path) as lost:
            package, flight = execute_live(site.package, place_of(site), site.run, signals=False)
        ended = utc_now()
        with pytest.raises(AlreadyExecutedError, match="was executed before"):
            execute_live(site.package, place_of(site), tmp_path / "again", signals=False)
    assert flight.outcome.outcome == "SUCCEEDED"
    assert flight.outcome.end_s is not None
    records = JournalFile(site.run / "journal.jsonl").records
    zero = instant_of(records[0]["instant"])
    assert begun <= zero <= zero + timedelta(seconds=flight.outcome.end_s) <= ended
    assert 1.8 < flight.outcome.end_s < 4.0 + 5.0 * sum(lost), f"the machine took {sum(lost):.1f} s"
    assert replay(records) == recorded_trace(records) == list(flight.outcome.trace)
    products = [json.loads(line) for line in (site.run / "products.jsonl").read_text().splitlines()]
    assert [p["task"] for p in products] == ["look"]
    assert (site.run / products[0]["path"]).is_file()
    document = json.loads((site.run / "run.json").read_text())
    assert document["products_missing"] == []
    assert document["run"] == run_id_of(package)
    samples = [json.loads(line) for line in (site.run / "telemetry.jsonl").read_text().splitlines()]
    assert samples[-1]["east_m"] == pytest.approx(0.4)
    assert not (site.run / CONTROL_SOCKET).exists()


def test_a_live_run_goes_back_to_ground_like_any_other(tmp_path: Path) -> None:
    from ground.gdr.files import FileStore
    from ground.resources.runs.work import read_run_folder

    site = live_site(tmp_path)
    with rover_process(site.address):
        execute_live(site.package, place_of(site), site.run, signals=False)
    (tmp_path / "files").mkdir()
    result = read_run_folder(site.run, FileStore(tmp_path / "files"))
    assert result["outcome"] == "SUCCEEDED"
    assert len(result["products"]) == 1


def test_a_package_for_another_dictionary_never_reaches_the_rover(tmp_path: Path) -> None:
    site = live_site(tmp_path)
    other = LivePlace(site.address, site.world, site.trust, dictionary=("other", "1", "0" * 64))
    with rover_process(site.address):
        with pytest.raises(ArchiveError, match="this rover has other 1"):
            execute_live(site.package, other, site.run, signals=False)
        nothing = LivePlace(site.address, site.world, site.trust)
        with pytest.raises(InvalidInputError, match="does not tell its dictionary"):
            execute_live(site.package, nothing, site.run, signals=False)


@pytest.mark.parametrize("stage", ["begun", "go", "rest"])
def test_a_killed_executive_comes_back_and_nothing_is_done_twice(stage: str, tmp_path: Path) -> None:
    site = live_site(tmp_path)
    with rover_process(site.address):
        process = subprocess.Popen(site.command(), env=environment(), stdout=subprocess.DEVNULL)
        until(lambda: (site.run / "journal.jsonl").exists() if stage == "begun" else sent(site, stage))
        process.kill()
        process.wait()
        time.sleep(0.6)
        done = subprocess.run(
            site.command("--resume"), env=environment(), capture_output=True, text=True, check=False
        )
        assert done.returncode == 0, done.stderr
    document = json.loads((site.run / "run.json").read_text())
    assert document["outcome"] == "SUCCEEDED"
    records = JournalFile(site.run / "journal.jsonl").records
    issued = [tuple(r["id"][1:]) for r in records if r["k"] == "send"]
    assert sorted(issued) == [("go", 1), ("look", 1), ("on", 1), ("rest", 1)]
    # plan time is that of the wall clock, however long nobody was there
    rest = next(r for r in records if r["k"] == "trace" and r["e"] == "start" and r["a"][0] == "on")
    assert rest["t"] < 60_000


def test_a_run_that_is_over_or_lost_is_not_gone_on_with(tmp_path: Path) -> None:
    site = live_site(tmp_path)
    with rover_process(site.address):
        execute_live(site.package, place_of(site), site.run, signals=False)
        with pytest.raises(InvalidInputError, match="came to its end"):
            execute_live(site.package, place_of(site), site.run, resume=True, signals=False)
        (site.run / "run.json").unlink()
        (site.run / "journal.jsonl").unlink()
        with pytest.raises(InvalidInputError, match=r"the journal in .* is gone"):
            execute_live(site.package, place_of(site), site.run, resume=True, signals=False)


def test_a_stop_reaches_the_wheels_even_when_the_executive_is_stopped(tmp_path: Path) -> None:
    site = live_site(tmp_path, LONG)
    with rover_process(site.address):
        process = subprocess.Popen(site.command(), env=environment(), stdout=subprocess.DEVNULL)
        try:
            until(lambda: sent(site, "go"))
            assert stat.S_IMODE((site.run / CONTROL_SOCKET).stat().st_mode) == 0o600
            os.kill(process.pid, signal.SIGSTOP)
            assert "told directly" in stop_run(site.run)
            os.kill(process.pid, signal.SIGCONT)
            assert process.wait(timeout=120) == 1  # its command was stopped: the plan failed
        finally:
            process.kill()
        assert wheel_speed(site) == 0.0


def test_hold_step_go_and_abort_go_to_the_runs_own_process(tmp_path: Path) -> None:
    site = live_site(tmp_path)
    rover = WireRover(site.address, run="held", out=site.run)
    flights: list[Flight] = []
    with rover_process(site.address):
        rover.wait_ready(60)
        ask = partial(ask_run, site.run, timeout_s=60)
        thread = threading.Thread(
            target=lambda: flights.append(
                run_live(HELD, rover, site.run, settings=LiveOptions().settings(1.0), resume=False, about={})
            )
        )
        thread.start()
        until(lambda: (site.run / CONTROL_SOCKET).exists())
        until(lambda: sent(site, "a"))
        ask({"m": "hold"})
        until(lambda: ended(site, "a"))
        time.sleep(0.3)
        state = ask({"m": "state"})
        assert state["held"] is True
        assert state["link"]["up"] is True
        assert not sent(site, "b")
        ask({"m": "step"})
        until(lambda: sent(site, "b"))
        time.sleep(0.6)
        assert not sent(site, "c")
        for wrong in ({"m": "dance"}, {}, {"m": "inject", "fault": {"kind": "silent"}}):
            with pytest.raises(WireError, match="refuses"):
                ask(wrong)
        ask({"m": "go"})
        until(lambda: sent(site, "c"))
        ask({"m": "abort"})
        thread.join(timeout=120)
    rover.close()
    flight = complete(flights[0])
    assert flight.outcome.outcome == "ABORTED"
    assert flight.document["stopped"] is True


HELD = """(block :id root :node-list (
  (task :id a :action wait :parameters (duration_s = 3))
  (task :id b :action wait :parameters (duration_s = 0.2))
  (task :id c :action wait :parameters (duration_s = 100))))"""


def test_stopping_what_does_not_run_says_so(tmp_path: Path) -> None:
    with pytest.raises(StateError, match="nor could its rover be told"):
        stop_run(tmp_path)


def test_a_simulated_rover_in_a_process_of_its_own_takes_faults_while_it_runs(tmp_path: Path) -> None:
    from tests.ground.signed import small_site

    package, place = small_site(tmp_path)
    run = tmp_path / "run"
    command = [sys.executable, "-m", "ground.cli", "execute", str(package), "--live", "--rover", "abstract"]
    command += ["--speed", "60", "--world", str(place.world), "--trust", str(place.trust), "--out", str(run)]
    process = subprocess.Popen(command, env=environment(), stdout=subprocess.PIPE, text=True)
    try:
        until(lambda: (run / CONTROL_SOCKET).exists())
        ask_run(run, {"m": "inject", "fault": {"kind": "novelty", "amount": 0.7}}, timeout_s=60)
        with pytest.raises(WireError, match=r"meteor|kind"):
            ask_run(run, {"m": "inject", "fault": {"kind": "meteor"}}, timeout_s=60)
        until(lambda: '"novelty":0.7' in (run / "journal.jsonl").read_text())
        stop_run(run)
        assert process.wait(timeout=120) == 1
        assert process.stdout is not None
        assert "ABORTED" in process.stdout.read()
    finally:
        process.kill()


# ---- the on-board file


def test_an_option_that_the_packer_does_not_know_is_no_file_name() -> None:
    done = subprocess.run(
        [ROOT / "scripts" / "build-onboard", "--nothing"],
        env={**os.environ, "PYTHON": sys.executable},
        capture_output=True,
        text=True,
        check=False,
    )
    assert done.returncode == 2
    assert "unrecognized arguments: --nothing" in done.stderr
    assert not (ROOT / "--nothing").exists()


@pytest.fixture(scope="module")
def onboard(tmp_path_factory: pytest.TempPathFactory) -> tuple[Path, list[str]]:
    """Give the on-board file and the command of a Python that has `cryptography` and nothing else."""
    import importlib.util

    folder = tmp_path_factory.mktemp("onboard")
    packed = folder / "outcrop-onboard.pyz"
    done = subprocess.run(
        [ROOT / "scripts" / "build-onboard", packed],
        env={**os.environ, "PYTHON": sys.executable},
        check=False,
    )
    assert done.returncode == 0
    subprocess.run([sys.executable, "-m", "venv", "--without-pip", folder / "venv"], check=True)
    target = next((folder / "venv").glob("lib/python*/site-packages"))
    for name in ("cryptography", "cffi", "_cffi_backend", "pycparser"):
        found = importlib.util.find_spec(name)
        if found is not None and found.origin is not None:
            path = Path(found.origin)
            path = path.parent if path.name == "__init__.py" else path
            (target / path.name).symlink_to(path)
    return packed, [str(folder / "venv" / "bin" / "python"), "-I"]


def test_the_on_board_file_is_small_and_quick_and_the_same_each_time(
    onboard: tuple[Path, list[str]], tmp_path: Path
) -> None:
    packed, python = onboard
    assert packed.stat().st_size <= 2 * 2**20
    again = tmp_path / "again.pyz"
    subprocess.run(
        [ROOT / "scripts" / "build-onboard", again], env={**os.environ, "PYTHON": sys.executable}, check=True
    )
    assert again.read_bytes() == packed.read_bytes()
    nothing = str(tmp_path / "none")
    verb = ["execute", nothing, "--connect", "unix:" + nothing, "--world", nothing, "--trust", nothing]
    spent = []
    for _ in range(3):
        before = resource.getrusage(resource.RUSAGE_CHILDREN)
        done = subprocess.run(
            [*python, str(packed), *verb, "--out", nothing], capture_output=True, text=True, check=False
        )
        after = resource.getrusage(resource.RUSAGE_CHILDREN)
        spent.append(after.ru_utime + after.ru_stime - before.ru_utime - before.ru_stime)
        assert done.returncode == 2
        assert done.stderr.startswith("outcrop-onboard: ")
        assert "Traceback" not in done.stderr
    assert min(spent) <= 0.5
    for other in ("numpy", "pydantic", "typer", "executive", "ground"):
        gone = subprocess.run([*python, "-c", f"import {other}"], capture_output=True, check=False)
        assert gone.returncode == 1, f"{other} is in an environment that should have cryptography alone"


def test_the_on_board_file_executes_a_package_on_the_wire_rover(
    onboard: tuple[Path, list[str]], tmp_path: Path
) -> None:
    packed, python = onboard
    site = live_site(tmp_path)
    program = [*python, str(packed)]
    with rover_process(site.address):
        checked = subprocess.run(
            [*program, "check", str(site.package), "--trust", str(site.trust)],
            capture_output=True,
            text=True,
            check=False,
        )
        assert "would be accepted" in checked.stdout
        process = subprocess.Popen(site.command(program=program), cwd=tmp_path, stderr=subprocess.DEVNULL)
        until(lambda: sent(site, "rest"))
        process.kill()
        process.wait()
        done = subprocess.run(
            site.command("--resume", program=program),
            cwd=tmp_path,
            capture_output=True,
            text=True,
            check=False,
        )
    assert done.returncode == 0, done.stderr
    assert "SUCCEEDED" in done.stdout
    assert (
        json.loads((site.run / "run.json").read_text())["sequence"]
        == read_package(site.package.read_bytes()).counter
    )
