"""Live days over ROS 2 on the rover in MuJoCo, with goals rejected, given up and lost, gaps and kills.

    .venv/bin/python -m studies.live_ros2_days [--ros DIR] [--days 60] [--jobs 2] [--seed N] \
        [--keep FILE] [--page FILE]

DIR is made by `scripts/ros-venv`. A day is `outcrop execute --connect` over a link to the bridge (`outcrop
rover ros2`), the bridge over ROS 2 to `rover_iface.mujoco.nav2_front`, each in a process of its own, all at
8 times real time. From the seed come the plan, the faults of its goals, a gap of the link of 5 s, and when
the executive and the bridge are killed with SIGKILL; both are begun again at once. The judge reads the
robot's own log of goals and the journal: no command may have been carried out twice, none acknowledged and
not carried out, none without an end, nothing may go on at the robot, and the run must have ended. Days that
are kept in FILE are not run again.
"""

from __future__ import annotations

import argparse
import hashlib
import json
import os
import random
import secrets
import subprocess
import sys
import tempfile
import time
from collections import Counter
from collections.abc import Sequence
from concurrent.futures import ThreadPoolExecutor
from contextlib import suppress
from dataclasses import asdict, dataclass, field
from pathlib import Path

from executive.errors import ExecutiveError
from executive.ports import CommandId
from executive.runtime.codec import Json
from executive.runtime.journal import JournalFile
from executive.runtime.recovery import recorded_trace, replay
from executive.runtime.wire import Address
from rover_iface.contract import write_contract_world
from studies.live_kills import executive, put
from tests.executive.wire.proxy import BadLink
from tests.ground.live_site import ROOT, Site, live_site
from tests.ros2.processes import Ros

MAPPING = ROOT / "examples/ros2_mujoco/rover.yaml"
RATE, LEAST_S, LEAST_COMMANDS, GAP_S = 8.0, 300, 20, 5.0
"""Plan seconds in a second; least plan time and commands of a day; seconds for which the link is away."""
LIMIT_S = 240.0
"""A day that has not ended after so many seconds of the machine counts as unfinished."""
DRIVES = 10


@dataclass
class Day:
    """What came of one day."""

    seed: int
    faults: dict[int, str]
    kills: int = 0
    bridge_kills: int = 0
    commands: int = 0
    plan_s: float = 0.0
    outcome: str = "unfinished"
    ends: dict[str, int] = field(default_factory=dict)
    doubled: int = 0
    lost: int = 0
    problems: list[str] = field(default_factory=list)


def plan_of(rng: random.Random) -> str:
    """Return a plan of at least 20 commands and 5 min: drives along a line, pictures, waits, branches."""
    tasks, x = [], 0.0
    for k in range(DRIVES):
        x += rng.uniform(0.25, 0.45)
        place = f"x = {x:.2f} y = {rng.uniform(-0.06, 0.06):.2f}"
        if k % 4 == 2:  # far is out of reach in its time; near is what is left
            far = f"(task :id far-{k} :duration (0 8) :action navigate :parameters (x = 9.0 y = 0.0))"
            near = f"(task :id near-{k} :action navigate :parameters ({place}))"
            tasks.append(
                f"(branch :id which-{k} :continue-on-failure t :on-option-failure :next :options ("
                f"(option :id out-{k} :utility 2 :node {far})(option :id in-{k} :utility 1 :node {near})))"
            )
        else:
            drive = f"(task :id drive-{k} :continue-on-failure t :action navigate :parameters ({place}))"
            tasks.append(drive)
        if k % 2:
            tasks.append(
                f"(task :id look-{k} :continue-on-failure t :action image "
                ":parameters (azimuth = 0.0 elevation = -0.3))"
            )
        rest = rng.uniform(4.0, 14.0)
        tasks.append(
            f"(task :id rest-{k} :continue-on-failure t :action wait :parameters (duration_s = {rest:.1f}))"
        )
    tasks.append(
        f"(task :id last :start-temporal-conditions (({LEAST_S} 6000)) :continue-on-failure t :action wait "
        ":parameters (duration_s = 1))"
    )
    safe = "(alternate :id safe :node (task :id beacon :action safemode))"
    return f"(plan :id day :library ({safe}) :node (block :id all :node-list ({' '.join(tasks)})))"


def faults_of(rng: random.Random) -> dict[int, str]:
    """Return what befalls goals by their number: each kind at least once."""
    numbers = rng.sample(range(1, DRIVES + 1), 4)
    return dict(zip(numbers, ["reject", "abort", "mute", rng.choice(["reject", "abort"])], strict=True))


class Robot:
    """The front, the bridge and the link of one day, in a ROS domain of their own."""

    def __init__(self, python: Path, folder: Path, domain: int, day: Day) -> None:
        self.ros = Ros(python, folder)
        self.ros.environment["ROS_DOMAIN_ID"] = str(domain)
        self.ros.environment["OMP_NUM_THREADS"] = "1"
        self.log, self.socket = folder / "goals.jsonl", folder / "bridge.sock"
        world = write_contract_world(folder / "contract")
        faults = [part for n, kind in day.faults.items() for part in ("--fault", f"{n}:{kind}")]
        command = ["-m", "rover_iface.mujoco.nav2_front", world, "--rate", f"{RATE:g}"]
        self.ros.start(*command, "--seed", str(day.seed), "--log", self.log, *faults)
        self.bridge = self.begin_bridge()
        self.link = BadLink(folder / "rover.sock", Address(self.socket), jitter_s=0.0, loss=0.0)

    def begin_bridge(self) -> subprocess.Popen[bytes]:
        command = ["-m", "ground.cli", "rover", "ros2", MAPPING, "--listen", f"unix:{self.socket}"]
        return self.ros.start(*command, "--out", self.ros.folder / "out")

    def end(self) -> None:
        self.link.close()
        self.ros.end()


def one_day(python: Path, seed: int, domain: int) -> Day:
    """Return what came of a day."""
    rng = random.Random(seed)
    plan, day = plan_of(rng), Day(seed, faults_of(rng))
    with tempfile.TemporaryDirectory() as name:
        folder = Path(name)
        site = live_site(folder, plan)
        robot = Robot(python, folder, domain, day)
        begun = time.monotonic()
        try:
            _live(site, robot, day, rng, begun + LIMIT_S)
            time.sleep(1.0)
            judge(site, robot.log, day)
            if day.problems:
                said = [
                    (folder / "errors.txt").read_text("utf-8", "replace")[-1500:],
                    robot.ros.log()[-3000:],
                ]
                day.problems += said
        finally:
            robot.end()
    well = day.problems[0] if day.problems else "well"
    sys.stderr.write(f"day {seed}: {day.outcome}, {time.monotonic() - begun:.0f} s, {day.ends}, {well}\n")
    return day


def _live(site: Site, robot: Robot, day: Day, rng: random.Random, end: float) -> None:
    """Carry the day out, with its gap and kills."""
    whole = LEAST_S / RATE
    acts = [(rng.uniform(0.1, 0.9) * whole, what) for what in ("gap", "executive", "executive", "bridge")]
    begun, process = 0.0, executive(site, "--resume")
    try:
        while time.monotonic() < end and not (site.run / "run.json").exists():
            if not begun and (site.run / "journal.jsonl").exists():
                begun = time.monotonic()
            for act in [a for a in acts if begun and time.monotonic() - begun >= a[0]]:
                acts.remove(act)
                if act[1] == "gap":
                    robot.link.away.set()
                    acts.append((time.monotonic() - begun + GAP_S, "back"))
                elif act[1] == "back":
                    robot.link.away.clear()
                elif act[1] == "executive":
                    process.kill()
                    day.kills += 1
                else:
                    robot.bridge.kill()
                    robot.bridge.wait()
                    day.bridge_kills += 1
                    robot.bridge = robot.begin_bridge()
            if process.poll() is not None and not (site.run / "run.json").exists():
                process = executive(site, "--resume")
            time.sleep(0.05)
        with suppress(subprocess.TimeoutExpired):
            process.wait(timeout=10)
    finally:
        process.kill()
        process.wait()


def goal_of(command: CommandId) -> str:
    """Return the id of the goal that a command is at the robot, as docs/how-to/ros2.md promises: one each."""
    whose = hashlib.sha256(b"mujoco_nav2").digest()[:4]
    return (b"ocrp" + whose + hashlib.sha256(json.dumps(command).encode()).digest()[:8]).hex()


def judge(site: Site, log: Path, day: Day) -> None:
    """Check a day against the robot's log and the journal."""
    goals = [json.loads(line) for line in log.read_text("utf-8").splitlines()] if log.exists() else []
    records: Sequence[Json] = []
    if (site.run / "run.json").exists():
        day.outcome = str(json.loads((site.run / "run.json").read_text("utf-8"))["outcome"])
    else:
        day.problems.append("unfinished")
    try:
        records = JournalFile(site.run / "journal.jsonl").records
        if replay(records) != recorded_trace(records):
            day.problems.append("the journal does not replay")
    except ExecutiveError as error:
        day.problems.append(str(error))
    compare(goals, records, day)
    if day.commands < LEAST_COMMANDS or day.plan_s < LEAST_S:
        day.problems.append(f"{day.commands} commands in {day.plan_s:.0f} s of plan time")


def compare(goals: Sequence[Json], records: Sequence[Json], day: Day) -> None:
    """Note in `day` where the robot's log of goals and the records of a journal contradict each other."""
    begun = Counter(line["goal"] for line in goals if line["what"] == "begin")
    ended = {line["goal"]: line["how"] for line in goals if line["what"] == "end"}
    sent = {CommandId(*r["id"]): r for r in records if r["k"] == "send"}
    events = [e for r in records if r["k"] == "step" for e in r["events"]]
    answers = {CommandId(*e["command"]): e for e in events if e["e"] in ("result", "acknowledgement")}
    day.commands, day.plan_s = len(sent), max((r["t"] for r in records if "t" in r), default=0) / 1000
    day.doubled = sum(count - 1 for count in begun.values())
    done = [c for c, e in answers.items() if e["e"] == "result" and e["success"] and c in sent]
    belied = [c for c in done if sent[c]["action"] == "navigate" and ended.get(goal_of(c)) != "succeeded"]
    silent = [c for c in sent if c not in answers]
    day.lost = len(silent) + len(belied)
    found = {
        "carried out twice": [goal for goal, count in begun.items() if count > 1],
        "goals that go on at the robot": [goal for goal in begun if goal not in ended],
        "carried out, and no command": sorted(set(begun) - {goal_of(command) for command in sent}),
        "commands without an end": silent,
        "told as done, and not so at the robot": belied,
    }
    day.problems += [f"{what}: {which}" for what, which in found.items() if which]
    words = Counter(
        "acknowledged" if e["e"] != "result" else "done" if e["success"] else e["reason"].partition(":")[0]
        for e in answers.values()
    )
    day.ends = dict(words.most_common())


def section(days: Sequence[Day], seed: int, jobs: int) -> list[str]:
    """Return what came of the days, as rows of a table."""
    ends, outcomes = Counter[str](), Counter(day.outcome for day in days)
    faults = Counter(kind for day in days for kind in day.faults.values())
    for day in days:
        ends.update(day.ends)
    plan_s, commands = [day.plan_s for day in days], [day.commands for day in days]
    return [
        f"| days, {jobs} at a time | {len(days)} (seeds {seed} to {seed + len(days) - 1}) |",
        f"| plan time of a day: least, most | {min(plan_s):.0f}, {max(plan_s):.0f} s |",
        f"| commands of a day: least, most; of all | {min(commands)}, {max(commands)}; {sum(commands)} |",
        f"| SIGKILLs of the executive, of the bridge | {sum(d.kills for d in days)}, "
        f"{sum(d.bridge_kills for d in days)} |",
        f"| faults set on goals | {', '.join(f'{n} {kind}' for kind, n in faults.most_common())} |",
        f"| goals carried out twice | {sum(d.doubled for d in days)} |",
        f"| commands lost | {sum(d.lost for d in days)} |",
        f"| days with any other fault | {sum(bool(d.problems) and not d.doubled + d.lost for d in days)} |",
        f"| days by their end | {', '.join(f'{n} {name}' for name, n in outcomes.most_common())} |",
        f"| commands by their end | {', '.join(f'{n} {name}' for name, n in ends.most_common())} |",
    ]


def kept_days(path: Path | None) -> dict[int, Day]:
    """Return the days that were run before."""
    if path is None or not path.exists():
        return {}
    days = [Day(**json.loads(line)) for line in path.read_text("utf-8").splitlines()]
    return {day.seed: day for day in days}


def main() -> None:
    """Run the study; print its table, and write the page if one is named."""
    form = argparse.RawDescriptionHelpFormatter
    parser = argparse.ArgumentParser(description=__doc__, formatter_class=form)
    parser.add_argument("--ros", type=Path, default=Path(".ros-venv"))
    parser.add_argument("--days", type=int, default=60)
    parser.add_argument("--jobs", type=int, default=2, help="days at the same time")
    parser.add_argument("--seed", type=int, default=None, help="drawn and printed when absent")
    parser.add_argument("--keep", type=Path, default=None, help="days are kept here, and not run again")
    parser.add_argument("--page", type=Path, default=None, help="put the result into this page")
    given = parser.parse_args()
    seed = secrets.randbelow(10**6) if given.seed is None else given.seed
    load, python = os.getloadavg()[0], given.ros.absolute() / "bin/python"
    days = kept_days(given.keep)
    first = 1 + os.getpid() % 20 * 5  # of the 101 domains that all systems have

    def run(which: int) -> None:
        day = one_day(python, which, first + (which - seed) % given.jobs)
        days[which] = day
        if given.keep is not None:
            with given.keep.open("a", encoding="utf-8") as file:
                file.write(json.dumps(asdict(day)) + "\n")

    wanted = range(seed, seed + given.days)
    lanes = [[n for n in wanted if (n - seed) % given.jobs == lane] for lane in range(given.jobs)]

    def run_lane(lane: list[int]) -> None:
        for which in lane:
            if which not in days:
                run(which)

    with ThreadPoolExecutor(given.jobs) as pool:
        list(pool.map(run_lane, lanes))
    lines = section([days[n] for n in wanted], seed, given.jobs)
    lines.append(f"| load of the machine (2 cores) at the start | {load:.1f} |")
    sys.stdout.write("\n".join(lines) + "\n")
    if given.page is not None:
        put(
            given.page,
            "ros2-days",
            f"python -m studies.live_ros2_days --days {given.days} --seed {seed}",
            lines,
        )


if __name__ == "__main__":
    main()
