"""Speed of the executive beside py_trees, in one run.

    .venv/bin/python -m benchmarks.executive_speed                 all, about two minutes
    .venv/bin/python -m benchmarks.executive_speed --quick         1,000 tasks only
    .venv/bin/python -m benchmarks.executive_speed --only latency

Every task is asynchronous: its command returns one event later, as the leaf of py_trees returns RUNNING
once. Times are the median of `--repeat` runs, wall and CPU, beside a yardstick loop; old and new alternate.
"""

from __future__ import annotations

import argparse
import gc
import json
import statistics
import tempfile
import time
from collections.abc import Callable
from importlib.metadata import version
from pathlib import Path
from typing import Any

from executive.ports import Update
from executive.runtime import LiveRuntime, LiveSettings, run_plan
from executive.runtime.journal import MemoryJournal
from executive.runtime.loading import load_plan
from executive.runtime.recovery import replay
from executive.runtime.scripted_rover import Behaviour, ScriptedRover
from executive.runtime.session import Session

Rows = list[dict[str, Any]]


def yardstick() -> float:
    """Return the seconds of a fixed loop: what this machine is worth at the moment."""
    begin = time.perf_counter()
    total = 0
    for n in range(2_000_000):
        total += n & 7
    assert total
    return time.perf_counter() - begin


def measure(work: Callable[[], Any], repeat: int) -> dict[str, float]:
    """Return median wall and CPU seconds of a piece of work."""
    walls, cpus = [], []
    for _ in range(repeat):
        gc.collect()
        wall, cpu = time.perf_counter(), time.process_time()
        work()
        walls.append(time.perf_counter() - wall)
        cpus.append(time.process_time() - cpu)
    return {
        "wall_s": statistics.median(walls),
        "cpu_s": statistics.median(cpus),
        "best_s": min(walls),
        "best_cpu_s": min(cpus),
        "spread_s": max(walls) - min(walls),
    }


def tasks(names: list[str]) -> str:
    """Return one plain task for each name as CRL."""
    return " ".join(f"(task :id {name} :action noop)" for name in names)


def plan_text(shape: str, count: int) -> str:
    """Return a plan of `count` tasks: `sequence`, `parallel` or `nested` (blocks of blocks)."""
    if shape == "nested":
        side = round(count**0.5)
        inner = " ".join(
            f"(block :id b{i} :node-list ({tasks([f't{i}x{j}' for j in range(side)])}))" for i in range(side)
        )
        return f"(block :id root :node-list ({inner}))"
    kind = "block" if shape == "sequence" else "concurrent-block"
    return f"({kind} :id root :node-list ({tasks([f't{n}' for n in range(count)])}))"


def py_tree(shape: str, count: int) -> Any:
    """Return the same tree for py_trees; each leaf is RUNNING once."""
    import py_trees

    class Leaf(py_trees.behaviour.Behaviour):  # type: ignore[misc]
        def initialise(self) -> None:
            self.asked = False

        def update(self) -> Any:
            if self.asked:
                return py_trees.common.Status.SUCCESS
            self.asked = True
            return py_trees.common.Status.RUNNING

    def sequence(name: str, children: list[Any]) -> Any:
        return py_trees.composites.Sequence(name, memory=True, children=children)

    if shape == "nested":
        side = round(count**0.5)
        return sequence(
            "root", [sequence(f"b{i}", [Leaf(f"{i}x{j}") for j in range(side)]) for i in range(side)]
        )
    leaves = [Leaf(str(n)) for n in range(count)]
    if shape == "sequence":
        return sequence("root", leaves)
    policy = py_trees.common.ParallelPolicy.SuccessOnAll()
    return py_trees.composites.Parallel("root", policy=policy, children=leaves)


def tick_to_the_end(root: Any, *, bare: bool) -> None:
    """Tick as a `BehaviourTree` does, or only the root, without any of its services."""
    import py_trees

    tick = root.tick_once if bare else py_trees.trees.BehaviourTree(root).tick
    while root.status != py_trees.common.Status.SUCCESS:
        tick()


def run_shape(shape: str, count: int, *, journal: str) -> Callable[[], None]:
    """Return a call that runs a plan of a shape once, with the journal that is named."""
    plan = load_plan(plan_text(shape, count), trusted=True)

    def work() -> None:
        rover = ScriptedRover(actions={"*": (Behaviour(1_000),)})
        if journal in ("file", "written"):
            with tempfile.TemporaryDirectory() as folder:
                outcome = run_plan(plan, rover, journal=Path(folder) / "run.journal", sync=journal == "file")
        else:
            outcome = run_plan(plan, rover, journal=MemoryJournal() if journal == "memory" else None)
        assert outcome.outcome == "SUCCEEDED"

    return work


def throughput(repeat: int, quick: bool) -> Rows:
    """1,000 and 10,000 asynchronous no-op tasks, beside py_trees."""
    import py_trees

    py_trees.logging.level = py_trees.logging.Level.ERROR
    rows: Rows = []
    for shape in ("sequence", "parallel", "nested"):
        small: dict[str, float] = {}
        ours_s = 0.0
        for count in (1_000,) if quick else (1_000, 10_000):
            for journal in ("none", "memory", "file") if count == 1_000 else ("none", "memory"):
                row = measure(run_shape(shape, count, journal=journal), repeat)
                if count == 1_000:
                    small[journal] = row["best_cpu_s"]
                else:
                    row["ratio_to_1000"] = row["best_cpu_s"] / small[journal]
                if journal == "memory":
                    ours_s = row["best_cpu_s"]
                rows.append({"what": f"outcrop, journal {journal}", "shape": shape, "tasks": count, **row})
            for bare in (True, False):
                once = count == 10_000 and shape == "sequence"
                peer = measure(
                    lambda shape=shape, count=count, bare=bare: tick_to_the_end(  # type: ignore[misc]
                        py_tree(shape, count), bare=bare
                    ),
                    1 if once else repeat,
                )
                peer["outcrop_with_journal_to_it"] = ours_s / peer["best_cpu_s"]
                name = f"py_trees {version('py_trees')}, {'root only' if bare else 'BehaviourTree'}"
                rows.append({"what": name, "shape": shape, "tasks": count, **peer})
    return rows


def peers(repeat: int, quick: bool) -> Rows:
    """Each shape with each journal and py_trees' bare root in turn; the best processor time of each.

    The journal in a file is not synchronised: what a disk takes for that is the disk's.
    """
    import py_trees

    py_trees.logging.level = py_trees.logging.Level.ERROR
    rows: Rows = []
    for shape in ("sequence", "parallel", "nested"):
        small: dict[str, float] = {}
        for count in (1_000,) if quick else (1_000, 10_000):
            works: dict[str, Callable[[], Any]] = {
                journal: run_shape(shape, count, journal=journal) for journal in ("none", "memory", "written")
            }
            works["py_trees"] = lambda shape=shape, count=count: tick_to_the_end(  # type: ignore[misc]
                py_tree(shape, count), bare=True
            )
            best = dict.fromkeys(works, float("inf"))
            for _ in range(repeat):
                for name, work in works.items():
                    best[name] = min(best[name], measure(work, 1)["cpu_s"])
            for name in ("none", "memory", "written"):
                row = {"what": f"outcrop, journal {name}", "shape": shape, "tasks": count}
                row |= {"best_cpu_s": best[name], "to_py_trees": best[name] / best["py_trees"]}
                row |= {"to_1000_tasks": best[name] / small[name]} if small else {}
                rows.append(row)
            small = best
    return rows


def loading(repeat: int, quick: bool) -> Rows:
    """Text to a validated plan, temporal network included."""
    rows: Rows = []
    for shape in ("sequence", "nested"):
        for count in (1_000,) if quick else (1_000, 10_000):
            text = plan_text(shape, count)
            row = measure(lambda text=text: load_plan(text), repeat)  # type: ignore[misc]
            rows.append({"what": "load, validate, network", "shape": shape, "tasks": count, **row})
    return rows


def latency(_repeat: int, quick: bool) -> Rows:
    """From an event to its command, with nodes waiting on distinct keys."""
    rows: Rows = []
    for waiting in (1_000,) if quick else (1_000, 10_000):
        nodes = " ".join(
            f"(task :id t{n} :action noop :wait-for-conditions ((database (:k{n} = 1))))"
            for n in range(waiting)
        )
        rover = ScriptedRover(actions={"*": (Behaviour(None),)})
        session = Session(load_plan(f"(concurrent-block :id root :node-list ({nodes}))", trusted=True), rover)
        session.start()
        delays = []
        for n in range(1_000):
            session.inject(Update(session.now_ms, {f"k{n}": 1}))
            begin = time.perf_counter()
            session.step_once()
            delays.append(time.perf_counter() - begin)
            assert rover.sent[-1].id.task == f"t{n}"
        delays.sort()
        rows.append(
            {
                "what": "event to command",
                "waiting": waiting,
                "p50_ms": 1000 * delays[500],
                "p99_ms": 1000 * delays[990],
            }
        )
    return rows


def replaying(repeat: int, quick: bool) -> Rows:
    """Replay of a journal against the run that wrote it."""
    count = 1_000 if quick else 10_000
    plan = load_plan(plan_text("sequence", count), trusted=True)
    journal = MemoryJournal()
    run_plan(plan, ScriptedRover(actions={"*": (Behaviour(1_000),)}), journal=journal)
    run = measure(run_shape("sequence", count, journal="memory"), repeat)
    again = measure(lambda: replay(journal.records, plan), repeat)
    events = sum(r["k"] == "trace" for r in journal.records)
    return [
        {"what": "run", "tasks": count, **run},
        {"what": "replay", "tasks": count, "trace_events_per_s": events / again["wall_s"], **again},
    ]


def day_text(count: int) -> str:
    """Return a day of `count` tasks with windows, durations, branches, resources and a contingency."""
    parts = []
    for n in range(count // 4):
        begin = n * 100
        parts.append(
            f"(task :id d{n} :action navigate :duration (0 900) :continue-on-failure t "
            f":start-temporal-conditions (({begin} 90000)) "
            ":maintain-conditions ((database (:tilt < 1))))"
            f"(concurrent-block :id c{n} :node-list ((task :id i{n} :action image :uses (arm) :reward 1) "
            f"(task :id h{n} :action heat :requires ((energy 5)))))"
            f"(branch :id b{n} :if-none :skip :options ((option :id o{n} :utility ((0 2) (9000 1)) "
            ":eligible-conditions ((database (:soc > 10))) "
            f":node (task :id p{n} :action place :uses (arm)))))"
        )
    return (
        "(plan :id day :resources ((arm :unit) (energy :consumable :key :battery)) "
        ":floating ((floating-contingency :id low :trigger-conditions ((database (:soc < 5))) "
        ":node (task :id charge :action recharge))) "
        f":node (block :id root :node-list ({' '.join(parts)})))"
    )


def days(repeat: int, _quick: bool) -> Rows:
    """Time a simulated sol of 200 tasks, and 40-task days in a row on one core."""
    rows: Rows = []
    actions = {"*": (Behaviour(140_000, updates={"tilt": 0.1, "soc": 50}),)}
    initial = {"battery": 1e6, "soc": 80, "tilt": 0.0}
    for count in (200, 40):
        text = day_text(count)
        plan = load_plan(text)
        last: dict[str, float] = {}

        def work(plan: Any = plan, last: dict[str, float] = last) -> None:
            outcome = run_plan(plan, ScriptedRover(initial, actions), journal=MemoryJournal())
            assert outcome.outcome == "SUCCEEDED"
            last["end_s"] = outcome.end_s or 0.0

        row = measure(work, repeat)
        rows.append({"what": "simulated day", "tasks": count, "end_s": last["end_s"], **row})
        bare = measure(lambda plan=plan: run_plan(plan, ScriptedRover(initial, actions)), repeat)  # type: ignore[misc]
        rows.append(
            {
                "what": "simulated day, no journal",
                "tasks": count,
                "runs_per_s_and_core": 1 / bare["cpu_s"],
                **bare,
            }
        )
    return rows


def windows(repeat: int, quick: bool) -> Rows:
    """Tasks tied by windows that need the temporal network for every start."""
    rows: Rows = []
    for count in (100,) if quick else (100, 1_000):
        parts = ["(task :id t0 :action noop)"]
        parts += (
            f"(task :id t{n} :action noop :duration (0 60) "
            f":start-temporal-conditions ((t{n - 1} end (0 30)) ({n} :plus-infinity)))"
            for n in range(1, count)
        )
        plan = load_plan(f"(block :id root :node-list ({' '.join(parts)}))", trusted=True)

        def work(plan: Any = plan) -> None:
            rover = ScriptedRover(actions={"*": (Behaviour(1_000),)})
            assert run_plan(plan, rover).outcome == "SUCCEEDED"

        row = measure(work, repeat)
        rows.append(
            {"what": "tied windows", "tasks": count, "ms_per_task": 1000 * row["wall_s"] / count, **row}
        )
    return rows


class HandClock:
    """A plan clock that is set by hand."""

    t_ms = 0

    def now_ms(self) -> int:
        """Return what the hand has set."""
        return self.t_ms


def live(_repeat: int, quick: bool) -> Rows:
    """From an event to its command through the live runtime with a journal in memory, processor time."""
    rows: Rows = []
    quiet = LiveSettings(silence_ms=None, monitor_ms=None, heartbeat_ms=None)
    for waiting in (1_000,) if quick else (1_000, 10_000):
        nodes = " ".join(
            f"(task :id t{n} :action noop :wait-for-conditions ((database (:k{n} = 1))))"
            for n in range(waiting)
        )
        port, clock = ScriptedRover(actions={"*": (Behaviour(None),)}), HandClock()
        text = f"(concurrent-block :id root :node-list ({nodes}))"
        run = LiveRuntime(text, port, run_id="live", clock=clock, journal=MemoryJournal(), settings=quiet)
        run.turn()
        delays = []
        for n in range(1_000):
            clock.t_ms += 1
            run.post(Update(0, {f"k{n}": 1}))
            begin = time.process_time()
            run.turn()
            delays.append(1000 * (time.process_time() - begin))
            assert port.sent[-1].id.task == f"t{n}"
        delays.sort()
        rows.append({"what": "live round", "nodes": waiting, "p50_ms": delays[500], "p99_ms": delays[990]})
    return rows


def many(repeat: int, quick: bool) -> Rows:
    """Many that wait for one thing: a capacity, the next option, a contingency, a key."""
    share = 10 if quick else 1
    power = "(plan :id p :resources ((power :capacity 10)) :node (concurrent-block :id r :node-list ({})))"
    one = {"*": (Behaviour(1_000),)}
    failing = {"*": (Behaviour(1_000, success=False),)}
    cases = {}
    for name, step in (("one amount", 0), ("400 amounts", 1)):
        waiters = " ".join(
            f"(task :id t{n} :action noop :uses ((power {3 + step * (n * 7919 % 400) / 100})))"
            for n in range(10_000 // share)
        )
        cases[f"capacity waiters, {name}"] = (power.format(waiters), one, ())
    options = " ".join(
        f"(option :id o{n} :utility {n % 7} :node (task :id t{n} :action noop :continue-on-failure nil))"
        for n in range(3_000 // share)
    )
    last = {f"t{3_000 // share - 1 - (3_000 // share - 1) % 7}": (Behaviour(1_000),)}
    cases["options with :next"] = (
        f"(branch :id b :on-option-failure :next :options ({options}))",
        failing | last,
        (),
    )
    floating = " ".join(
        f"(floating-contingency :id f{n} :trigger-conditions ((database (:go = 1))) :utility {n % 5} "
        f":node (task :id c{n} :action noop))"
        for n in range(1_000 // share)
    )
    block = f"(block :id r :node-list ({tasks(['a', 'z'])}))"
    cases["contingencies that trigger"] = (
        f"(plan :id p :floating ({floating}) :node {block})",
        one,
        (Update(500, {"go": 1}),),
    )
    watching = " ".join(
        f"(task :id t{n} :action noop :wait-for-conditions ((database (:k > {1_000 + n}))))"
        for n in range(10_000 // share)
    )
    changes = [Update(1_000 * n, {"k": n}) for n in range(500)]
    cases["nodes on one key, 500 changes"] = (
        f"(concurrent-block :id r :node-list ({watching}))",
        one,
        (*changes, Update(500_000, {"k": 1e9})),
    )
    rows: Rows = []
    for name, (text, actions, script) in cases.items():
        plan = load_plan(text, trusted=True)

        def work(plan: Any = plan, actions: Any = actions, script: Any = script) -> None:
            assert run_plan(plan, ScriptedRover({}, actions, script)).outcome == "SUCCEEDED"

        rows.append({"what": name, **measure(work, min(repeat, 3))})
    return rows


STUDIES: dict[str, Callable[[int, bool], Rows]] = {
    "throughput": throughput,
    "peers": peers,
    "loading": loading,
    "latency": latency,
    "replay": replaying,
    "days": days,
    "windows": windows,
    "live": live,
    "many": many,
}


def main() -> None:
    """Run the studies that were asked for and print their rows."""
    parser = argparse.ArgumentParser(
        description=__doc__, formatter_class=argparse.RawDescriptionHelpFormatter
    )
    parser.add_argument("--only", choices=sorted(STUDIES), action="append")
    parser.add_argument("--repeat", type=int, default=5)
    parser.add_argument("--quick", action="store_true")
    parser.add_argument("--out", type=Path, help="also write the rows as JSON")
    options = parser.parse_args()
    result: dict[str, Any] = {"yardstick_s": yardstick()}
    print(f"yardstick {result['yardstick_s']:.3f} s")
    for name in options.only or STUDIES:
        print(f"\n{name}")
        result[name] = STUDIES[name](options.repeat, options.quick)
        for row in result[name]:
            print(
                "  "
                + "  ".join(f"{k}={v:.4g}" if isinstance(v, float) else f"{k}={v}" for k, v in row.items())
            )
    if options.out is not None:
        options.out.write_text(json.dumps(result, indent=1) + "\n")


if __name__ == "__main__":
    main()
