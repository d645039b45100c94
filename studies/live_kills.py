"""Kills of a live executive at random instants, stops while it hangs, and a link that is away for a minute.

    .venv/bin/python -m studies.live_kills --part kills [--runs 100] [--jobs 2] [--seed N] [--page FILE]
    .venv/bin/python -m studies.live_kills --part quiet [--runs 40] [--seed N] [--page FILE]
    .venv/bin/python -m studies.live_kills --part rovers [--runs 100] [--jobs 2] [--seed N] [--page FILE]
    .venv/bin/python -m studies.live_kills --part stops [--stops 20] [--seed N] [--page FILE]
    .venv/bin/python -m studies.live_kills --part links [--away 60] [--page FILE]

Each run is `outcrop execute --connect` over a wire rover in another process that lives on. The executive is
killed with SIGKILL at instants drawn from its first byte on, up to three times a run, and begun again with
`--resume`. What was done is counted by the rover, not by the executive: a log of every command it began.
In the part `rovers` the rover is killed instead, and comes back without its memory, or never.
"""

from __future__ import annotations

import argparse
import json
import os
import random
import secrets
import signal
import statistics
import subprocess
import sys
import tempfile
import time
from collections import Counter
from collections.abc import Iterator, Sequence
from concurrent.futures import ThreadPoolExecutor
from contextlib import contextmanager
from dataclasses import dataclass, field
from datetime import datetime
from pathlib import Path
from typing import Any

from executive.errors import ExecutiveError
from executive.runtime.journal import JournalFile, never_began
from executive.runtime.recovery import recorded_trace, replay
from executive.runtime.wire import Address
from executive.runtime.wire.contract import as_lines, check_wire
from tests.executive.wire.proxy import BadLink
from tests.ground.live_site import ROOT, ROVER, Site, environment, live_site
from tests.rover_iface.worlds import small_problem

PLAN = """(plan :id day :library ((alternate :id safe :node (task :id beacon :action safemode)))
 :node (block :id all :node-list (
  (concurrent-block :id both :node-list (
    (task :id go :action navigate :parameters (x = 0.6 y = 0.3))
    (task :id look :action image)))
  (task :id rest :action wait :parameters (duration_s = 0.4))
  (branch :id which :options (
    (option :id near :utility 2 :node (task :id back :action navigate :parameters (x = 0.2 y = 0.0)))
    (option :id stay :utility 1 :node (task :id idle :action wait :parameters (duration_s = 1)))))
  (task :id fixed :start-temporal-conditions ((9 60)) :action wait :parameters (duration_s = 0.2))
  (task :id last :start-temporal-conditions ((fixed end (0.5 60)))
    :action wait :parameters (duration_s = 0.2)))))"""
LONG = """(plan :id day :node (block :id all :node-list (
  (task :id go :action navigate :parameters (x = 1000.0 y = 0.0))
  (task :id rest :action wait :parameters (duration_s = 0.2)))))"""
FIXED_S, GAP_S = 9.0, 0.5
"""Plan time at which `fixed` may start, and how long after its end `last` may."""
SILENCE_S = 4.0
"""After which a plan gives way to its alternate `safe`: short, so that many runs meet it."""
WATCHED = """
import json, runpy, sys, time
sys.argv = ["rover.py", sys.argv[1], sys.argv[2]]
log = open(sys.argv.pop(), "a", buffering=1)
import threading
source = open({rover!r}).read().replace('if __name__ == "__main__":', "def run():")
space = {{"__name__": "watched"}}
exec(compile(source, {rover!r}, "exec"), space)
Rover, begin, over = space["Rover"], space["Rover"].begin, space["Rover"].over
def told(self, key, action, given):
    log.write(json.dumps(["begin", list(key), time.time()]) + "\\n")
    return begin(self, key, action, given)
def ended(self, kind, key, **members):
    over(self, kind, key, **members)
    log.write(json.dumps([kind, list(key), time.time(), self.wheels]) + "\\n")
Rover.begin, Rover.over = told, ended
space["run"]()
"""
"""The reference rover with a log of its own: what it began and ended, when, and what its wheels did."""


@dataclass
class Outcome:
    """What came of one run."""

    kills: int = 0
    gone: bool = False
    """Whether the rover was killed and did not come back."""
    ended: str = ""
    problems: list[str] = field(default_factory=list)
    late_ms: list[float] = field(default_factory=list)
    quiet_ms: list[float] = field(default_factory=list)
    """Lateness of starts that were due in a life without a kill just before."""


def rover(site: Site, log: Path) -> subprocess.Popen[bytes]:
    """Return the process of a reference rover that writes down what it does."""
    code = WATCHED.format(rover=str(ROVER))
    return subprocess.Popen([sys.executable, "-c", code, str(site.address), str(log)])


@contextmanager
def watched_rover(site: Site, log: Path) -> Iterator[None]:
    """Give a reference rover that lives on, and listens."""
    process = rover(site, log)
    try:
        assert site.address.path is not None
        while not site.address.path.exists():
            time.sleep(0.01)
        yield
    finally:
        process.kill()
        process.wait()


TASKS = ["back", "fixed", "go", "last", "look", "rest"]
"""What a rover begins in a run of `PLAN` that comes to its end."""


def log_of(path: Path) -> list[list[Any]]:
    """Return what a rover wrote down."""
    return [json.loads(line) for line in path.read_text("utf-8").splitlines()] if path.exists() else []


def executive(site: Site, *more: str) -> subprocess.Popen[bytes]:
    """Return the process of an executive, the on-board program."""
    program = (sys.executable, str(ROOT / "ground" / "uplink" / "onboard.py"))
    error = (site.folder / "errors.txt").open("ab")
    return subprocess.Popen(
        site.command(*more, program=program), env=environment(), stdout=subprocess.DEVNULL, stderr=error
    )


def one_run(seed: int, limit_s: float = 300.0) -> Outcome:
    """Return what came of a run whose executive is killed up to three times."""
    rng, outcome = random.Random(seed), Outcome()
    with tempfile.TemporaryDirectory() as folder:
        site, log = live_site(Path(folder), PLAN), Path(folder) / "rover.log"
        with watched_rover(site, log):
            for _ in range(rng.randint(1, 3)):
                process = executive(site, "--resume")
                try:
                    process.wait(timeout=rng.choice([rng.uniform(0.0, 0.6), rng.uniform(0.0, 12.0)]))
                    break
                except subprocess.TimeoutExpired:
                    process.kill()
                    process.wait()
                    outcome.kills += 1
                time.sleep(rng.choice([0.0, rng.uniform(0.0, 2.0)]))
            if not (site.run / "run.json").exists():
                process = executive(site, "--resume")
                try:
                    process.wait(timeout=limit_s)
                except subprocess.TimeoutExpired:
                    process.kill()
                    process.wait()
        judge(site, log, outcome)
        sys.stderr.write(f"run {seed}: {outcome.kills} kills, {outcome.problems or 'well'}\n")
        if outcome.problems:
            said = (site.folder / "errors.txt").read_text("utf-8", "replace")[-2000:]
            outcome.problems.append(f"seed {seed}; it said: {said}")
    return outcome


def one_rover_run(seed: int, limit_s: float = 120.0) -> Outcome:
    """Return what came of a run whose rover is killed up to three times, one time in five for good."""
    rng, outcome = random.Random(seed), Outcome()
    with tempfile.TemporaryDirectory() as folder:
        site, log = live_site(Path(folder), PLAN), Path(folder) / "rover.log"
        alive, process = rover(site, log), executive(site, "--silence", f"{SILENCE_S:g}")
        try:
            for _ in range(rng.randint(1, 3)):
                try:
                    process.wait(timeout=rng.uniform(0.0, 10.0))
                    break
                except subprocess.TimeoutExpired:
                    alive.kill()
                    alive.wait()
                    outcome.kills += 1
                outcome.gone = rng.random() < 0.2
                if outcome.gone:
                    break
                time.sleep(rng.choice([0.0, rng.uniform(0.0, 1.5 * SILENCE_S)]))
                alive = rover(site, log)
            try:
                process.wait(timeout=6 * SILENCE_S if outcome.gone else limit_s)
            except subprocess.TimeoutExpired:
                outcome.ended = "waits"
        finally:
            for other in (process, alive):
                other.kill()
                other.wait()
        judge_rover_run(site, log, outcome)
        sys.stderr.write(
            f"run {seed}: {outcome.kills} kills, {outcome.ended}, {outcome.problems or 'well'}\n"
        )
    return outcome


def judge_rover_run(site: Site, log: Path, outcome: Outcome) -> None:
    """Check how a run ended whose rover lost its memory: nothing twice, and safe if it did not come back.

    A safe plan whose rover is gone waits for it with its command.
    """
    if outcome.ended and not outcome.gone:
        outcome.problems.append("unfinished")
        return
    if not outcome.ended and not (site.run / "run.json").exists():
        said = (site.folder / "errors.txt").read_text("utf-8", "replace")[-2000:]
        outcome.problems.append(f"it has no result: {said}")
        return
    begun = [tuple(entry[1]) for entry in log_of(log) if entry[0] == "begin"]
    if len(begun) != len(set(begun)):
        outcome.problems.append(f"carried out twice: {begun}")
    if outcome.ended and not begun and never_began(site.run / "journal.jsonl"):
        outcome.ended += ", never began"  # the executive had not met it: nothing has left
        return
    records = JournalFile(site.run / "journal.jsonl").records
    if replay(records) != recorded_trace(records):
        outcome.problems.append("the journal does not replay")
    if not outcome.ended:
        outcome.ended = str(json.loads((site.run / "run.json").read_text("utf-8"))["outcome"])
    if any(record["k"] == "send" and record["action"] == "safemode" for record in records):
        outcome.ended += ", safed"
    whole = outcome.ended == "SUCCEEDED" and sorted(task for _, task, _ in begun) == TASKS
    if (
        outcome.gone and not outcome.ended.endswith("safed") and not whole
    ):  # whole: it went after the plan's end
        outcome.problems.append(f"{outcome.ended}, and the rover was never told to be safe")


def judge(site: Site, log: Path, outcome: Outcome) -> None:
    """Check a run against what the rover did and what the journal says."""
    if not (site.run / "run.json").exists():
        outcome.problems.append("unfinished")
        return
    told = json.loads((site.run / "run.json").read_text("utf-8"))
    if told["outcome"] != "SUCCEEDED":
        outcome.problems.append(f"outcome {told['outcome']} {told['reason']}")
    if told["products_missing"]:
        outcome.problems.append(f"products that did not come down: {told['products_missing']}")
    begun = [tuple(entry[1]) for entry in log_of(log) if entry[0] == "begin"]
    if len(begun) != len(set(begun)):
        outcome.problems.append(f"carried out twice: {begun}")
    if sorted(task for _, task, _ in begun) != TASKS:
        outcome.problems.append(f"carried out {begun}")
    try:
        records = JournalFile(site.run / "journal.jsonl").records
    except ExecutiveError as error:
        outcome.problems.append(str(error))
        return
    if replay(records) != recorded_trace(records):
        outcome.problems.append("the journal does not replay")
    zero = 1000 * datetime.fromisoformat(records[0]["instant"]).timestamp()
    began = {str(e[1][1]): 1000 * float(str(e[2])) - zero for e in log_of(log) if e[0] == "begin"}
    ended = {r["a"][0]: r["t"] for r in records if r["k"] == "trace" and r["e"] == "end"}
    restarts = [r["t"] for r in records if r["k"] == "restart"]
    for task, due in (("fixed", 1000 * FIXED_S), ("last", ended.get("fixed", 0) + 1000 * GAP_S)):
        due = max(due, ended.get("which", 0))
        if task in began:
            # a start that fell into the time in which nobody was there is due when the executive is back
            back = [t for t in restarts if due - 1000 <= t <= began[task]]
            outcome.late_ms.append(began[task] - max([due, *back]))
            if not back:
                outcome.quiet_ms.append(outcome.late_ms[-1])


HOLDS_THE_DATABASE = """
import sqlite3, sys, time
held = sqlite3.connect(sys.argv[1], isolation_level=None)
held.execute("CREATE TABLE IF NOT EXISTS t (x)")
held.execute("BEGIN EXCLUSIVE")
time.sleep(1e6)
"""


def planner(folder: Path) -> subprocess.Popen[bytes]:
    """Return a planner that is at work for far longer than a stop takes."""
    problem = folder / "problem.json"
    problem.write_text(json.dumps(small_problem()), encoding="utf-8")
    command = [sys.executable, "-m", "ground.cli", "plan", str(problem), "--time-limit", "600"]
    command += ["--iterations", "100000000", "--out", str(folder / "plans")]
    return subprocess.Popen(command, env=environment(), stdout=subprocess.DEVNULL, stderr=subprocess.DEVNULL)


def database(folder: Path) -> subprocess.Popen[bytes]:
    """Return a process that holds a transaction on a database open for ever."""
    return subprocess.Popen([sys.executable, "-c", HOLDS_THE_DATABASE, str(folder / "outcrop.db")])


def one_stop(seed: int, hung: bool) -> tuple[float, str]:
    """Return milliseconds from `outcrop stop` to zero wheel speed at the rover, and how it went.

    Planner and database are stopped by SIGSTOP beside it; with `hung` the executive is, too.
    """
    with tempfile.TemporaryDirectory() as folder:
        site, log = live_site(Path(folder), LONG), Path(folder) / "rover.log"
        with watched_rover(site, log):
            process = executive(site)
            bystanders = [planner(Path(folder)), database(Path(folder))]
            try:
                end = time.monotonic() + 60
                while not any(e[0] == "begin" for e in log_of(log)) and time.monotonic() < end:
                    time.sleep(0.02)
                for bystander in bystanders:
                    os.kill(bystander.pid, signal.SIGSTOP)
                time.sleep(random.Random(seed).uniform(0.2, 0.6))
                if hung:
                    os.kill(process.pid, signal.SIGSTOP)
                from ground.uplink.live import stop_run

                begun = time.time()
                how = stop_run(site.run)
                while not (ends := [e for e in log_of(log) if e[0] == "acknowledgement"]):
                    time.sleep(0.002)
                assert ends[0][3] == 0.0, "its wheels turn"
                return 1000 * (float(str(ends[0][2])) - begun), how
            finally:
                for other in (process, *bystanders):
                    os.kill(other.pid, signal.SIGCONT)
                    other.kill()
                    other.wait()


def links(away_s: float) -> list[str]:
    """Return the checks of the reference rover over a bad link that is away for so long."""
    with tempfile.TemporaryDirectory() as folder:
        site = live_site(Path(folder), PLAN)
        with watched_rover(site, Path(folder) / "rover.log"):
            link = BadLink(Path(folder) / "link.sock", site.address, jitter_s=0.5, loss=0.05, seed=1)
            with ThreadPoolExecutor(1) as pool:
                absent = pool.submit(_be_away, link, away_s)
                findings = check_wire(Address(Path(folder) / "link.sock"), patience_s=away_s + 20.0)
                absent.result()
            link.close()
            return [
                *as_lines(findings, "reference rover"),
                f"{link.passed} frames passed, {link.lost} were lost",
            ]


def _be_away(link: BadLink, away_s: float) -> None:
    time.sleep(5.0)
    link.away.set()
    time.sleep(away_s)
    link.away.clear()


def quantile(values: Sequence[float], share: float) -> float:
    """Return the value below which a share lies, NaN of none."""
    return sorted(values)[min(len(values) - 1, int(share * len(values)))] if values else float("nan")


def kills_section(seed: int, runs: int, jobs: int) -> list[str]:
    """Return what came of runs that were killed, as rows of a table."""
    with ThreadPoolExecutor(jobs) as pool:
        outcomes = list(pool.map(one_run, range(seed, seed + runs)))
    problems = [text for outcome in outcomes for text in outcome.problems]
    unfinished = sum(any(p == "unfinished" for p in o.problems) for o in outcomes)
    twice = sum(any(p.startswith("carried out twice") for p in o.problems) for o in outcomes)
    late = [ms for o in outcomes for ms in o.late_ms]
    quiet = [ms for o in outcomes for ms in o.quiet_ms]
    lines = [
        f"| runs, SIGKILLs | {runs}, {sum(o.kills for o in outcomes)} (seeds {seed} to {seed + runs - 1}) |",
        f"| unfinished | {unfinished} |",
        f"| commands carried out twice | {twice} |",
        f"| runs with any other fault | {sum(bool(o.problems) for o in outcomes) - unfinished - twice} |",
        f"| command at the rover after its due instant, of {len(late)}: median, p95, most | "
        f"{statistics.median(late):.0f}, {quantile(late, 0.95):.0f}, {max(late):.0f} ms |",
        f"| the same without a restart in the second before ({len(quiet)}) | {statistics.median(quiet):.0f}, "
        f"{quantile(quiet, 0.95):.0f}, {max(quiet):.0f} ms |",
    ]
    for text in problems[:10]:
        sys.stderr.write(text + "\n")
    return lines


def rovers_section(seed: int, runs: int, jobs: int) -> list[str]:
    """Return what came of runs whose rover was killed, as rows of a table."""
    with ThreadPoolExecutor(jobs) as pool:
        outcomes = list(pool.map(one_rover_run, range(seed, seed + runs)))
    problems = [text for outcome in outcomes for text in outcome.problems]
    ended = Counter(o.ended for o in outcomes if o.ended)
    killed, gone = sum(o.kills for o in outcomes), sum(o.gone for o in outcomes)
    for text in problems[:10]:
        sys.stderr.write(text + "\n")
    return [
        f"| runs, SIGKILLs of the rover, of them for good | {runs}, {killed}, {gone} "
        f"(seeds {seed} to {seed + runs - 1}) |",
        f"| ended | {'; '.join(f'{count} {how}' for how, count in ended.most_common())} |",
        f"| unfinished, commands carried out twice, any other fault | {problems.count('unfinished')}, "
        f"{sum(p.startswith('carried out twice') for p in problems)}, "
        f"{sum(p != 'unfinished' and not p.startswith('carried out twice') for p in problems)} |",
    ]


def stops_section(seed: int, stops: int) -> list[str]:
    """Return how long stops took, as rows of a table."""
    lines = []
    for hung, name in ((False, "executive well"), (True, "executive stopped by SIGSTOP")):
        took = [one_stop(seed + n, hung)[0] for n in range(stops)]
        lines.append(
            f"| stop to zero wheel speed, {name} ({stops}) | median {statistics.median(took):.0f}, "
            f"p95 {quantile(took, 0.95):.0f}, most {max(took):.0f} ms |"
        )
    return lines


def main() -> None:
    """Run the study; print its table, and write the page if one is named."""
    parser = argparse.ArgumentParser(
        description=__doc__, formatter_class=argparse.RawDescriptionHelpFormatter
    )
    parser.add_argument("--part", choices=["kills", "quiet", "rovers", "stops", "links"], default="kills")
    parser.add_argument("--runs", type=int, default=100)
    parser.add_argument("--stops", type=int, default=20)
    parser.add_argument("--jobs", type=int, default=2, help="runs at the same time")
    parser.add_argument("--seed", type=int, default=None, help="drawn and printed when absent")
    parser.add_argument("--away", type=float, default=60.0, help="seconds for which the link is away")
    parser.add_argument("--page", type=Path, default=None, help="put the result into this page")
    given = parser.parse_args()
    seed = secrets.randbelow(10**6) if given.seed is None else given.seed
    load = f"| load of the machine (2 cores) at the start | {os.getloadavg()[0]:.1f} |"
    match given.part:
        case "kills":
            lines = [*kills_section(seed, given.runs, given.jobs), load]
            command = f"--part kills --runs {given.runs} --seed {seed}"
        case "rovers":
            lines = [*rovers_section(seed, given.runs, given.jobs), load]
            command = f"--part rovers --runs {given.runs} --seed {seed}"
        case "quiet":
            lines = [*kills_section(seed, given.runs, given.jobs), load]
            command = f"--part quiet --runs {given.runs} --seed {seed}"
        case "stops":
            lines = [*stops_section(seed, given.stops), load]
            command = f"--part stops --stops {given.stops} --seed {seed}"
        case _:
            lines = ["```text", *links(given.away), "```"]
            command = f"--part links --away {given.away:g}"
    sys.stdout.write("\n".join(lines) + "\n")
    if given.page is not None:
        put(given.page, given.part, f"python -m studies.live_kills {command}", lines)


ABOUT = {
    "kills": """Killed at random instants

The executive is a process that runs a signed package over [the wire](../reference/wire.md) on the
reference rover, a process of its own that lives on. Kills fall at random instants from the first byte on,
up to three a run. What was carried out is counted by the rover, and when a command was there is read
from its log. A start that fell into an absence is due when the executive is back.""",
    "quiet": """Killed on a quiet machine

The same with nothing else at work on the machine: for the times alone.""",
    "crash_points": """Crash points

On a simulated disk and clock the executive dies before or in the middle of a write, a synchronisation, a
command or a receipt, up to five times a run; what its disk keeps of unsynchronised bytes is random.""",
    "replacements": """Replacements

Random plans are replaced at random moments, up to four times a run, and compared with an interpreter written
from the language's description alone.""",
    "rovers": """The rover killed instead

The rover is a process that forgets all when it is killed. One time in five it does not come back; after 4 s
of silence (`--silence 4`) the plan gives way to its alternate `safe`, whose command waits for the rover.
Commands of an earlier life that the rover does not know have failed, and none is sent again.""",
    "stops": """Stopped

From `outcrop stop` to the rover's word that its wheels stand. A planner at work (`outcrop plan`) and a
process that holds a transaction on a database open are stopped by SIGSTOP beside the run; a live run has no
part that waits for them.""",
    "windows": """A window closes, a command is cancelled

From the instant at which a task's window closes, by the plan clock, to the rover's own log of the cancel on
the wire. Beside it a thread sleeps up to instants like these: what it is late by is the machine.""",
    "links": """A link that is bad, and away

`outcrop rover check --hardware` with 500 ms of jitter, 5 % of frames lost, and a time in which nothing
passes, on the wall clock.""",
    "ros2": """Through the bridge to ROS 2

The robot is the server of `examples/ros2_turtle`, the bridge another process; ROS 2 is that of
`scripts/ros-venv` (rclpy 9.1.2, Fast DDS). Each goal drives and is aborted after a tenth of a second.""",
    "ros2-days": """Days over ROS 2 on the rover in MuJoCo

A day is a signed package on the bridge and `rover_iface.mujoco.nav2_front`, the rover in MuJoCo behind
Nav2's interface, at 8 times real time. Nav2 itself is not there. The seed draws plan, faults of goals
(rejected, given up, accepted and never answered), a gap of the link of 5 s, two kills of the executive and
one of the bridge. The judge reads the robot's own log of goals: carried out at most once, nothing told as
done that was not, an end for every command, nothing that goes on after the run. Goals that a dead bridge
left are cancelled by the next one, and their commands fail.""",
}


HEAD = """# Live runs: results

What a live run stands, each with its command. Processor time from event to command, and of many tasks beside
py_trees, is in [executive and plan language](executive.md), drive times in MuJoCo are in [MuJoCo](mujoco.md).
The suite shows the rest:

| | |
|---|---|
| one plan on `full`, on the wire and over ROS 2 on MuJoCo | `pytest tests/ros2/test_one_plan.py` |
| a robot of somebody else by a mapping file and 19 lines of Python | `pytest tests/ros2/test_real_ros.py` |
| rovers in Python (149 lines) and C over a bad link | `pytest tests/executive/wire/test_bad_links.py` |
| the file on board: size, start, what it needs | `pytest tests/ground/test_live_execution.py -k on_board` |
| every scenario on WebAssembly | `pytest tests/executive/test_webassembly.py` |

What the file on board needs exists for aarch64: `pip download --only-binary=:all: --platform
manylinux2014_aarch64 --platform manylinux_2_28_aarch64 cryptography` finds wheels, and so has Debian.
"""


def put(path: Path, part: str, command: str, lines: Sequence[str]) -> None:
    """Put a part's result into the page; the others stay as they are."""
    commit = subprocess.run(
        ["git", "rev-parse", "--short", "HEAD"], cwd=ROOT, capture_output=True, text=True, check=False
    ).stdout.strip()
    when = time.strftime("%Y-%m-%d", time.gmtime())
    old = path.read_text("utf-8").split("\n## ")[1:] if path.exists() else []
    held = {name: text for text in old for name in ABOUT if text.startswith(ABOUT[name].splitlines()[0])}
    table = [] if part == "links" else ["| | |", "|---|---|"]
    made = f"`{command}`, {when}, commit {commit}."
    held[part] = "\n".join([ABOUT[part], "", made, "", *table, *lines, ""])
    text = HEAD
    text += "".join(f"\n## {held[name].rstrip()}\n" for name in ABOUT if name in held)
    path.write_text(text, encoding="utf-8")


if __name__ == "__main__":
    main()
