"""Driving a run from the ground: step, pause, replace, inject, look; and what a run is worth."""

from __future__ import annotations

import pickle

import pytest

from executive.crl import CrlValidationError
from executive.errors import MisuseError
from executive.ports import CommandId, Operation, Operator, Result, TraceRecord, Update
from executive.runtime import run_plan
from executive.runtime.journal import MemoryJournal
from executive.runtime.loading import load_plan
from executive.runtime.scripted_rover import Behaviour, ScriptedRover
from executive.runtime.session import Session

PLAN = """
(plan :id p :resources ((arm :unit) (energy :consumable :key :battery :floor 10))
 :floating ((floating-contingency :id low :trigger-conditions ((database (:soc < 25)))
             :node (task :id charge :action recharge)))
 :library ((alternate :id safe :node (task :id beacon :action call)))
 :node
 (block :id root :node-list
  ((task :id a :action image :uses (arm) :requires ((energy 20)) :duration (0 90))
   (task :id b :action drive :wait-for-conditions ((database (:sun > 5)))
      :start-temporal-conditions ((0 100))))))
"""


def session(**behaviours: Behaviour) -> Session:
    actions = {name: (behaviour,) for name, behaviour in behaviours.items()}
    return Session(PLAN, ScriptedRover({"soc": 80, "battery": 500, "sun": 0}, actions))


def events(run: Session) -> list[str]:
    return [" ".join((r.event, *r.arguments)) for r in run.trace]


def test_step_stops_at_the_time_asked_for() -> None:
    run = session(a=Behaviour(30_000))
    run.step(10_000)
    assert run.now_ms == 10_000
    assert events(run) == ["start root", "start a"]
    run.step(30_000)
    assert events(run)[-1] == "end a SUCCEEDED"


def test_step_once_goes_from_instant_to_instant() -> None:
    run = session(a=Behaviour(30_000))
    times = []
    while run.step_once():
        times.append(run.now_ms)
    assert times[0] == 0
    assert times == sorted(times)
    assert run.over


def test_pause_resume_and_inject() -> None:
    run = session(a=Behaviour(5_000), b=Behaviour(5_000))
    run.step(1_000)
    run.pause()
    run.step(10_000)
    run.inject(Update(0, {"sun": 9}))
    run.step(11_000)
    assert events(run)[-1] == "end a SUCCEEDED"
    run.resume()
    run.step(11_000)
    assert events(run)[-2:] == ["resume-plan", "start b"]


def test_abort_and_replace() -> None:
    run = session(a=Behaviour(50_000))
    run.step(1_000)
    run.replace("(not a plan")
    run.step(2_000)
    assert [n.kind for n in run.notes] == ["rejected"]
    run.abort()
    assert run.run().outcome == "ABORTED"


def test_a_session_starts_once() -> None:
    run = session()
    run.start()
    with pytest.raises(MisuseError, match="was started already"):
        run.start()


def test_snapshot_shows_nodes_windows_watched_keys_resources_and_pending_events() -> None:
    run = session(a=Behaviour(30_000))
    run.step(10_000)
    run.inject(Update(20_000, {"sun": 9}))
    picture = run.snapshot()
    nodes = {node["id"]: node for node in picture["nodes"]}
    assert nodes["root"]["state"] == "EXECUTING"
    assert nodes["a"]["window"] == [0, 90_000]
    assert nodes["b"]["state"] == "INACTIVE"
    assert picture["resources"]["arm"] == {"capacity": 1.0, "taken": 1.0, "holders": "a"}
    assert picture["resources"]["energy"]["reserved"] == 20
    assert picture["commands"] == [{"task": "a", "attempt": 1, "abort_asked": False}]
    assert picture["next_wakeup"] == 90_000
    assert picture["contingencies"][0] == {
        "id": "low",
        "armed": True,
        "triggered": False,
        "insertions": 0,
        "phase": "",
    }
    assert [e["values"] for e in picture["pending_events"]] == [{"sun": 9}]
    assert picture["sequence"] == 2
    run.step(40_000)
    assert run.snapshot()["outcome"] == "SUCCEEDED"


def test_snapshot_shows_what_a_waiting_node_watches() -> None:
    run = session(a=Behaviour(1_000))
    run.step(2_000)
    picture = run.snapshot()
    assert picture["watched"] == {"sun": ["b"]}
    assert next(n for n in picture["nodes"] if n["id"] == "b")["window"] == [0, 100_000]


def test_a_viewer_that_reconnects_misses_nothing() -> None:
    run = session(a=Behaviour(5_000))
    run.step(1_000)
    seen = run.events_since(0)
    run.step(6_000)
    seen += run.events_since(seen[-1][0])
    assert [number for number, _ in seen] == list(range(1, len(run.trace) + 1))
    assert [record for _, record in seen] == run.trace
    assert run.events_since(len(run.trace)) == []


def test_listeners_hear_each_record_once_and_in_order() -> None:
    heard: list[TraceRecord] = []
    outcome = run_plan(PLAN, ScriptedRover({"sun": 9, "battery": 99}), listeners=[heard.append])
    assert tuple(heard) == outcome.trace


def test_operator_events_are_given_beforehand() -> None:
    outcome = run_plan(
        PLAN,
        ScriptedRover({"sun": 9, "battery": 99}, {"a": (Behaviour(60_000),)}),
        operator_events=[Operator(5_000, Operation.ABORT)],
    )
    assert outcome.outcome == "ABORTED"
    assert outcome.end_ms == 5_000


def test_a_rejected_plan_tells_why() -> None:
    with pytest.raises(CrlValidationError, match="E013"):
        run_plan("(task :id a)", ScriptedRover())


REWARDED = """
(plan :id p :overrun-penalty 7 :budgets ((time {budget}) (energy 100))
 :resources ((energy :consumable :key :battery))
 :node (block :id root :node-list
  ((task :id a :action x :reward 5 :continue-on-failure t)
   (task :id b :action x :reward 3 :continue-on-failure t))))
"""


@pytest.mark.parametrize(
    ("budget", "battery_after", "a_succeeds", "utility"),
    [
        (20, 950, True, 8),  # within both budgets
        (20, 950, False, 3),  # only tasks that succeeded earn
        (19, 950, True, 1),  # ends at 20, over the time budget
        (20, 899, True, 1),  # 101 of energy used
        (20, 900, True, 8),  # exactly 100
        (19, 800, True, 1),  # over both: the penalty is due once
    ],
)
def test_utility_of_a_run(budget: int, battery_after: int, a_succeeds: bool, utility: float) -> None:
    actions = {
        "a": (Behaviour(10_000, success=a_succeeds),),
        "b": (Behaviour(10_000, updates={"battery": battery_after}),),
    }
    journal = MemoryJournal()
    outcome = run_plan(
        REWARDED.format(budget=budget), ScriptedRover({"battery": 1000}, actions), journal=journal
    )
    assert outcome.utility == utility
    assert journal.records[-1]["k"] == "end"
    assert journal.records[-1]["utility"] == utility


def test_a_compiled_plan_runs_many_times() -> None:
    plan = load_plan(PLAN)
    first = run_plan(plan, ScriptedRover({"sun": 9, "battery": 99}))
    second = run_plan(plan, ScriptedRover({"sun": 9, "battery": 99}))
    assert first.trace == second.trace


def test_a_contingency_that_was_never_inserted_keeps_its_outcome_after_a_replacement() -> None:
    task = "(task :id t1 :action x)"
    floating = (
        "(floating-contingency :id c :trigger-conditions ((database (:k = 1))) :node (task :id ct :action x))"
    )
    outcome = run_plan(
        f"(plan :id p :floating ({floating}) :node {task})",
        ScriptedRover({}, {"t1": (Behaviour(9_000),)}),
        operator_events=[Operator(2_000, Operation.REPLACE, f"(plan :id p :node {task})")],
    )
    assert outcome.outcomes == {"t1": "SUCCEEDED", "ct": "SKIPPED"}


def test_nesting_of_200_levels_needs_no_recursion() -> None:
    text = "(task :id leaf :action x)"
    for level in range(199):
        text = f"(block :id b{level} :node-list ({text}))"
    outcome = run_plan(text, ScriptedRover())
    assert outcome.outcome == "SUCCEEDED"
    assert len(outcome.trace) == 400
    failed = run_plan(text, ScriptedRover({}, {"leaf": (Behaviour(1_000, success=False),)}))
    assert failed.outcomes["b198"] == "FAILED"
    stopped = run_plan(
        text,
        ScriptedRover({}, {"leaf": (Behaviour(None),)}),
        operator_events=[Operator(2_000, Operation.ABORT)],
    )
    assert stopped.outcome == "ABORTED"


def test_a_window_that_cannot_be_reached_any_more_is_a_risk_and_no_failure() -> None:
    plan = """
    (block :id root :node-list
      ((task :id a :action x)
       (task :id b :action x)
       (task :id c :action x :start-temporal-conditions ((0 50)))))
    """
    outcome = run_plan(
        plan,
        ScriptedRover({}, {"a": (Behaviour(60_000),)}),
        journal=MemoryJournal(),
        operator_events=[Operator(55_000, Operation.RESUME)],
    )
    risks = [n for n in outcome.notes if n.kind == "risk"]
    assert [n.t_ms for n in risks] == [55_000]
    assert risks[0].node == "c"
    assert outcome.outcomes["b"] == "SUCCEEDED"


def test_a_reference_that_occurs_too_late_is_a_risk() -> None:
    plan = """
    (concurrent-block :id root :node-list
      ((task :id a :action x :start-temporal-conditions ((b start (-5 5))))
       (task :id b :action x :wait-for-conditions ((database (:k = 1))))))
    """
    outcome = run_plan(plan, ScriptedRover({}, {}, [Update(20_000, {"k": 1})]))
    assert [n.text for n in outcome.notes if n.kind == "risk"] == [
        "start of a at 0 s lies outside its window on the start of b at 20 s"
    ]


def test_a_node_that_asks_twice_at_one_limit_hears_of_it() -> None:
    text = "(task :id a :action x :wait-for-conditions ((or (database (:k < 5)) (database (:k > 5)))))"
    session = Session(text, ScriptedRover({"k": 5}, {}, [Update(1000, {"k": 9})]))
    assert session.run().end_s == 2


def test_a_node_that_waits_for_a_key_to_be_known_hears_of_its_coming() -> None:
    session = Session(
        "(task :id a :action x :wait-for-conditions ((known (:k))))",
        ScriptedRover({}, {}, [Update(1000, {"k": 9})]),
    )
    assert session.run().end_s == 2


def test_a_start_that_waits_keeps_few_timers_however_often_it_is_asked() -> None:
    def most_timers(count: int) -> int:
        chatter = "".join(
            f"(task :id k{n} :action wait :start-temporal-conditions (({n} 9999)))" for n in range(count)
        )
        plan = f"""(plan :id p :node (concurrent-block :id r :node-list (
          (task :id a :action wait)
          (task :id b :action wait :start-temporal-conditions ((a start (0 50)) (2000 3000)))
          (block :id s :node-list ({chatter})))))"""
        run = Session(plan, ScriptedRover({}, {"wait": (Behaviour(500),)}))
        most = 0
        for t_ms in range(0, 1_000 * count, 1_000):
            run.step(t_ms)
            timers = run.engine.run.agenda._timers
            most = max(most, len(timers._line) + len(timers._heap))
        assert list(run.engine.run.network.delayed)
        return most

    assert most_timers(200) <= most_timers(20) + 2


def test_the_empty_values_that_all_share_take_none_and_pickle() -> None:
    values = Result(0, CommandId("run", "a", 1), True).values
    with pytest.raises(TypeError, match="cannot be written to"):
        values["x"] = 1.0  # type: ignore[index]
    with pytest.raises(TypeError, match="cannot be written to"):
        values.update(x=1.0)  # type: ignore[attr-defined]
    assert pickle.loads(pickle.dumps(values)) == values == {}
