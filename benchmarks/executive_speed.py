"""Speed of the executive beside py_trees, in one run.

Every task is asynchronous: its command returns one event later, as the leaf of py_trees returns RUNNING
once. Times are processor seconds; where things are compared, they alternate. `--only` names studies.
"""

from __future__ import annotations

import tempfile
import time
from collections.abc import Callable, Iterator
from functools import partial
from pathlib import Path
from typing import Any

from benchmarks.common.clock import median_spent, quantile, spent
from benchmarks.common.figure import Figure, command
from executive.ports import Update
from executive.runtime import LiveRuntime, LiveSettings, run_plan
from executive.runtime.journal import MemoryJournal
from executive.runtime.loading import load_plan
from executive.runtime.recovery import replay
from executive.runtime.scripted_rover import Behaviour, ScriptedRover
from executive.runtime.session import Session

SMALL, LARGE = 1_000, 10_000
PEER_MOST, GROWTH_MOST = 2.0, 13.0
"""Times py_trees' bare root and times the 1,000 case, for 10,000 tasks with a journal."""
LATENCY_MOST_MS = {SMALL: 0.5, LARGE: 1.0}
MANY_MOST_S = 1.0
"""For 10,000 waiters for a capacity, 3,000 options and 1,000 contingencies."""
PEER = "py_trees' bare root"
QUICK = {"sizes": (SMALL,), "repeat": 2}
BUDGET_S = 900.0


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

    class Leaf(py_trees.behaviour.Behaviour):
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


def ticked(shape: str, count: int, *, bare: bool) -> None:
    """Tick a tree to its end as a `BehaviourTree` does, or only the root, without any of its services."""
    import py_trees

    root = py_tree(shape, count)
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


def peers(sizes: tuple[int, ...], repeat: int) -> Iterator[Figure]:
    """Each shape with each journal and py_trees in turn; the best processor time of each.

    A journal `written` is in a file that is not synchronised: what a disk takes for that is the disk's. With
    1,000 tasks also one that is, and `BehaviourTree.tick`, which is quadratic.
    """
    import py_trees

    py_trees.logging.level = py_trees.logging.Level.ERROR
    for shape in ("sequence", "parallel", "nested"):
        small: dict[str, float] = {}
        for count in sizes:
            journals = ("none", "memory", "written", *(("file",) if count == SMALL else ()))
            works: dict[str, Callable[[], Any]] = {j: run_shape(shape, count, journal=j) for j in journals}
            works[PEER] = partial(ticked, shape, count, bare=True)
            if count == SMALL:
                works["BehaviourTree"] = partial(ticked, shape, count, bare=False)
            best = dict.fromkeys(works, float("inf"))
            for _ in range(repeat):
                for name, work in works.items():
                    best[name] = min(best[name], spent(work))
            large = count == LARGE
            for name in journals:
                kept = large and name in ("memory", "written")
                what, ratio = f"{shape} of {count:,} tasks, journal {name}", best[name] / best[PEER]
                yield Figure(what, best[name], "s", PEER_MOST if kept else None, ratio=ratio, to=PEER)
                if name in small:
                    growth, to = best[name] / small[name], f"{sizes[0]:,} tasks"
                    limit = GROWTH_MOST if kept and sizes[0] == SMALL else None
                    yield Figure(f"{what}, growth", best[name], "s", limit, ratio=growth, to=to)
            for name in works.keys() - {PEER, *journals}:
                yield Figure(f"{shape} of {count:,} tasks, {name}", best[name], "s")
            small = small or best


def loading(sizes: tuple[int, ...], repeat: int) -> Iterator[Figure]:
    """Text to a validated plan, temporal network included."""
    for shape in ("sequence", "nested"):
        for count in sizes:
            took_s = median_spent(partial(load_plan, plan_text(shape, count)), repeat)
            yield Figure(f"{shape} of {count:,} tasks: load, validate, network", took_s, "s")


def waiting(count: int) -> str:
    """Return a plan of nodes that wait on distinct keys."""
    nodes = " ".join(
        f"(task :id t{n} :action noop :wait-for-conditions ((database (:k{n} = 1))))" for n in range(count)
    )
    return f"(concurrent-block :id root :node-list ({nodes}))"


def delays_of(what: str, count: int, delays_ms: list[float]) -> Iterator[Figure]:
    """Yield median and 99th percentile of the time from an event to its command."""
    label = f"{what}, {count:,} nodes waiting"
    yield Figure(f"{label}: median", quantile(delays_ms, 0.5), "ms")
    yield Figure(f"{label}: 99th percentile", quantile(delays_ms, 0.99), "ms", LATENCY_MOST_MS.get(count))


def latency(sizes: tuple[int, ...], _repeat: int) -> Iterator[Figure]:
    """From an event to its command, on the clock."""
    for count in sizes:
        rover = ScriptedRover(actions={"*": (Behaviour(None),)})
        session = Session(load_plan(waiting(count), trusted=True), rover)
        session.start()
        delays = []
        for n in range(1_000):
            session.inject(Update(session.now_ms, {f"k{n}": 1}))
            begin = time.perf_counter()
            session.step_once()
            delays.append(1000 * (time.perf_counter() - begin))
            assert rover.sent[-1].id.task == f"t{n}"
        yield from delays_of("event to command", count, delays)


def replaying(sizes: tuple[int, ...], repeat: int) -> Iterator[Figure]:
    """Replay of a journal against the run that wrote it."""
    count = max(sizes)
    plan = load_plan(plan_text("sequence", count), trusted=True)
    journal = MemoryJournal()
    run_plan(plan, ScriptedRover(actions={"*": (Behaviour(1_000),)}), journal=journal)
    run_s = median_spent(run_shape("sequence", count, journal="memory"), repeat)
    again_s = median_spent(lambda: replay(journal.records, plan), repeat)
    yield Figure(f"replay of {count:,} tasks", again_s, "s", ratio=again_s / run_s, to="the run")


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


def days(_sizes: tuple[int, ...], repeat: int) -> Iterator[Figure]:
    """Time a simulated sol of 200 tasks, and 40-task days in a row on one core."""
    actions = {"*": (Behaviour(140_000, updates={"tilt": 0.1, "soc": 50}),)}
    initial = {"battery": 1e6, "soc": 80, "tilt": 0.0}
    for count in (200, 40):
        plan = load_plan(day_text(count))

        def fly(journal: bool, plan: Any = plan) -> None:
            kept = MemoryJournal() if journal else None
            outcome = run_plan(plan, ScriptedRover(initial, actions), journal=kept)
            assert outcome.outcome == "SUCCEEDED"

        yield Figure(f"day of {count} tasks, with journal", median_spent(partial(fly, True), repeat), "s")
        bare_s = median_spent(partial(fly, False), repeat)
        yield Figure(f"days of {count} tasks, no journal", 1 / bare_s, "days/s")


def windows(sizes: tuple[int, ...], repeat: int) -> Iterator[Figure]:
    """Tasks tied by windows that need the temporal network for every start."""
    for count in (size // 10 for size in sizes):
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

        each_ms = 1000 * median_spent(work, repeat) / count
        yield Figure(f"a task of {count:,} tied by windows", each_ms, "ms")


class HandClock:
    """A plan clock that is set by hand."""

    t_ms = 0

    def now_ms(self) -> int:
        """Return what the hand has set."""
        return self.t_ms


def live(sizes: tuple[int, ...], _repeat: int) -> Iterator[Figure]:
    """From an event to its command through the live runtime with a journal in memory, processor time."""
    quiet = LiveSettings(silence_ms=None, monitor_ms=None, heartbeat_ms=None)
    for count in sizes:
        port, clock = ScriptedRover(actions={"*": (Behaviour(None),)}), HandClock()
        journal = MemoryJournal()
        run = LiveRuntime(waiting(count), port, run_id="live", clock=clock, journal=journal, settings=quiet)
        run.turn()
        delays = []
        for n in range(1_000):
            clock.t_ms += 1
            run.post(Update(0, {f"k{n}": 1}))
            begin = time.process_time()
            run.turn()
            delays.append(1000 * (time.process_time() - begin))
            assert port.sent[-1].id.task == f"t{n}"
        yield from delays_of("live round", count, delays)


def many(sizes: tuple[int, ...], repeat: int) -> Iterator[Figure]:
    """Many that wait for one thing: a capacity, the next option, a contingency, a key."""
    share = LARGE // max(sizes)
    power = "(plan :id p :resources ((power :capacity 10)) :node (concurrent-block :id r :node-list ({})))"
    one = {"*": (Behaviour(1_000),)}
    failing = {"*": (Behaviour(1_000, success=False),)}
    cases: dict[str, tuple[str, Any, tuple[Update, ...]]] = {}
    for name, step in (("one amount", 0), ("400 amounts", 1)):
        waiters = " ".join(
            f"(task :id t{n} :action noop :uses ((power {3 + step * (n * 7919 % 400) / 100})))"
            for n in range(10_000 // share)
        )
        cases[f"{LARGE // share:,} capacity waiters, {name}"] = (power.format(waiters), one, ())
    options = " ".join(
        f"(option :id o{n} :utility {n % 7} :node (task :id t{n} :action noop :continue-on-failure nil))"
        for n in range(3_000 // share)
    )
    last = {f"t{3_000 // share - 1 - (3_000 // share - 1) % 7}": (Behaviour(1_000),)}
    cases[f"{3_000 // share:,} options with :next"] = (
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
    cases[f"{1_000 // share:,} contingencies that trigger"] = (
        f"(plan :id p :floating ({floating}) :node {block})",
        one,
        (Update(500, {"go": 1}),),
    )
    watching = " ".join(
        f"(task :id t{n} :action noop :wait-for-conditions ((database (:k > {1_000 + n}))))"
        for n in range(10_000 // share)
    )
    changes = [Update(1_000 * n, {"k": n}) for n in range(500)]
    cases[f"{LARGE // share:,} nodes on one key, 500 changes"] = (
        f"(concurrent-block :id r :node-list ({watching}))",
        one,
        (*changes, Update(500_000, {"k": 1e9})),
    )
    for name, (text, actions, script) in cases.items():
        plan = load_plan(text, trusted=True)

        def work(plan: Any = plan, actions: Any = actions, script: Any = script) -> None:
            assert run_plan(plan, ScriptedRover({}, actions, script)).outcome == "SUCCEEDED"

        limit = MANY_MOST_S if share == 1 and "on one key" not in name else None
        yield Figure(name, median_spent(work, min(repeat, 3)), "s", limit)


STUDIES = {
    "peers": peers,
    "loading": loading,
    "latency": latency,
    "replay": replaying,
    "days": days,
    "windows": windows,
    "live": live,
    "many": many,
}


def figures(
    sizes: tuple[int, ...] = (SMALL, LARGE), repeat: int = 5, only: tuple[str, ...] = tuple(STUDIES)
) -> Iterator[Figure]:
    """Yield the figures of the studies named."""
    for name in only:
        yield from STUDIES[name](sizes, repeat)


if __name__ == "__main__":
    command(figures, QUICK, BUDGET_S)
