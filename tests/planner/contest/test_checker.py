"""The checker against values outcome by outcome, against another program, and against planted faults."""

from __future__ import annotations

import copy
import importlib
import json
import math
import sys
from dataclasses import dataclass
from pathlib import Path
from typing import Any

import numpy as np
import pytest

from mission.codec import Document
from planner.contest.checker import read_plan, value_plan
from planner.contest.entrants import ENTRANTS
from planner.contest.instance import FAMILIES, Instance, generate, load_document, read_instance
from planner.errors import PlannerError
from tests.planner.contest.exact import Now, Outcomes
from tests.shared import shared

FUTURES = 200_000
OPS = ["track_start", "visit", "navigate", "observe", "track_stop", "branch", "stop"]


def fresh() -> int:
    seed = int(np.random.SeedSequence().generate_state(1)[0])
    print(f"seed {seed}")
    return seed


def certain(document: dict[str, Any]) -> dict[str, Any]:
    """Return an instance whose times and energies are their means."""
    told = copy.deepcopy(document)
    for row in (*told["targets"], *told["legs"]):
        for amounts in (row.get("observe", row),):
            amounts["time_s"]["sd"] = amounts["energy_j"]["sd"] = 0.0
    return told


def random_plan(rng: np.random.Generator, instance: Instance, depth: int = 0) -> list[dict[str, Any]]:
    """Return a plan of any steps, senseless ones too."""
    names = list(instance.goals)
    steps: list[dict[str, Any]] = []
    for _ in range(int(rng.integers(1, 6))):
        name = str(rng.choice(names))
        op = str(rng.choice(OPS, p=[0.2, 0.35, 0.12, 0.12, 0.03, 0.15, 0.03]))
        step: dict[str, Any] = {"op": op}
        if op == "branch":
            if depth > 2:
                continue
            step["options"] = []
            for _ in range(int(rng.integers(1, 3))):
                var = str(rng.choice(["time_s", "energy_j", "tracked", "done"]))
                if var in {"time_s", "energy_j"}:
                    most = instance.budget_s if var == "time_s" else instance.budget_j
                    when: dict[str, Any] = {
                        "var": var,
                        str(rng.choice(["ge", "lt"])): float(rng.uniform(0, most)),
                    }
                else:
                    when = {"var": var, "target": name, "is": bool(rng.random() < 0.5)}
                step["options"].append({"when": [when], "plan": random_plan(rng, instance, depth + 1)})
        elif op == "navigate":
            step |= {"to": name, "require_tracked": bool(rng.random() < 0.3)}
        elif op != "stop":
            step["target"] = name
        if op not in {"branch", "stop"} and rng.random() < 0.7:
            step["on_fail"] = "skip"
        steps.append(step)
    return steps


@pytest.mark.parametrize("family", FAMILIES)
def test_values_are_those_of_every_outcome_by_itself(family: str) -> None:
    seed = fresh()
    rng = np.random.default_rng(seed)
    far = 0
    for number in range(25):
        instance = read_instance(certain(generate(family, int(rng.integers(2, 6)), seed % 10**6 + number)))
        steps = read_plan({"format": "plan-tree/1", "plan": random_plan(rng, instance)}, instance)
        found = value_plan(instance, steps, 20_000, seed)
        wanted = Outcomes(instance).value(steps, Now())
        # a sample without spread equals the outcome; else five standard errors, with rare outcomes unseen
        room = 5 * found.standard_error + 1e-9 + 5 * max(g.utility for g in instance.goals.values()) / 20_000
        far += abs(found.value - wanted) > room
    assert far == 0


def test_drawn_amounts_have_their_mean_and_spread() -> None:
    document = generate("resource", 3, fresh() % 10**6)
    for row in document["targets"]:
        row |= {"p_success": 1.0, "utility": 1.0}
    document["budget"] = {"time_s": 1e9, "energy_j": 1e12}
    instance = read_instance(document)
    leg = instance.legs["start", "T1"]
    mean, sd = leg.time_s
    variance = math.log1p((sd / mean) ** 2)
    for z in (-1.0, 0.0, 1.5):
        limit = math.exp(math.log(mean) - variance / 2 + math.sqrt(variance) * z)
        option = {"when": [{"var": "time_s", "lt": limit}], "plan": [{"op": "observe", "target": "T1"}]}
        steps = read_plan(
            {
                "format": "plan-tree/1",
                "plan": [{"op": "navigate", "to": "T1"}, {"op": "branch", "options": [option]}],
            },
            instance,
        )
        found = value_plan(instance, steps, FUTURES, 3)
        wanted = 0.5 * (1.0 + math.erf(z / math.sqrt(2.0)))
        assert abs(found.value - wanted) < 5 * math.sqrt(wanted * (1 - wanted) / FUTURES)


def test_public_plans_are_worth_what_another_program_says(monkeypatch: pytest.MonkeyPatch) -> None:
    folder = shared("contingency")
    monkeypatch.setattr(sys, "path", [str(folder), *sys.path])
    evaluate = importlib.import_module("evaluate").evaluate
    other = importlib.import_module("instance").Instance
    seed = fresh() % 10**6
    odd = []
    plans = sorted((folder / "plans").glob("*.json"))
    assert len(plans) >= 24
    for number, file in enumerate(plans):
        place = folder / "instances" / f"{file.name.split('.')[0]}.json"
        instance = read_instance(load_document(place))
        document = load_document(file)
        found = value_plan(instance, read_plan(document, instance), FUTURES, seed + number)
        wanted = evaluate(other.load(place), document["plan"], 1_000_000, seed + number)
        z = (found.value - wanted["mean"]) / math.hypot(found.standard_error, wanted["se"])
        assert found.branches == wanted["branches"]
        if abs(z) > 4.5:
            odd.append((file.name, z))
    assert odd == []


FAULTS: list[tuple[str, dict[str, Any], str]] = [
    ("unknown target", {"plan": [{"op": "visit", "target": "T99"}]}, r"plan\[0\].target is 'T99'"),
    ("unknown word", {"plan": [{"op": "fly", "target": "T1"}]}, r"plan"),
    ("other instance", {"instance": "x", "plan": []}, "the plan is for 'x'"),
    (
        "no limit",
        {"plan": [{"op": "branch", "options": [{"when": [{"var": "time_s"}], "plan": []}]}]},
        r"plan\[0\].options\[0\].when: time_s needs one of ge and lt",
    ),
    (
        "not a number",
        {"plan": [{"op": "branch", "options": [{"when": [{"var": "time_s", "ge": math.nan}], "plan": []}]}]},
        "plan",
    ),
    (
        "unknown condition",
        {
            "plan": [
                {
                    "op": "branch",
                    "options": [{"when": [{"var": "done", "target": "T9", "is": True}], "plan": []}],
                }
            ]
        },
        "names no target",
    ),
    ("another observation", {"plan": [{"op": "visit", "target": "T1", "observation": "T2"}]}, "has one"),
    ("no plan", {}, "plan"),
    (
        "too many branches",
        {"plan": [{"op": "branch", "options": [{"when": [], "plan": []}] * 7}]},
        "has 7 branches; at most 6",
    ),
]


@pytest.mark.parametrize(("document", "says"), [f[1:] for f in FAULTS], ids=[f[0] for f in FAULTS])
def test_a_plan_that_is_none_is_refused_by_name(document: dict[str, Any], says: str) -> None:
    instance = read_instance(generate("mixed", 4, 5))
    with pytest.raises(PlannerError, match=says):
        read_plan({"format": "plan-tree/1", **document}, instance, 6)


def test_a_second_visit_earns_nothing_and_is_said() -> None:
    instance = read_instance(certain(generate("resource", 3, 8)))
    once = read_plan({"format": "plan-tree/1", "plan": [{"op": "visit", "target": "T1"}]}, instance)
    twice = read_plan({"format": "plan-tree/1", "plan": [{"op": "visit", "target": "T1"}] * 2}, instance)
    first, second = value_plan(instance, once, 1_000, 1), value_plan(instance, twice, 1_000, 1)
    assert second.value == first.value
    assert second.failing == ("plan[1]",)


@dataclass(frozen=True)
class Bounded:
    """An instance with the plan and the bound of the entrant that proves one."""

    document: Document
    plan: Document
    upper: float


@pytest.fixture(scope="module")
def bounded() -> list[Bounded]:
    """Instances of every family, drawn afresh; each of the entrants plans them."""
    seed, made = fresh() % 10**6, []
    for number, family in enumerate(FAMILIES):
        document = generate(family, 4, seed + number)
        plan, upper = ENTRANTS["outcrop"](document, 6, 2.0)
        assert upper is not None
        made.append(Bounded(document, plan, upper))
    return made


@pytest.mark.parametrize("name", ["greedy", "straight", "pico2005", "outcrop"])
def test_plans_of_every_entrant_pass_the_checker_and_keep_to_the_bound(
    name: str, bounded: list[Bounded]
) -> None:
    seed = fresh() % 10**6
    for case in bounded:
        instance = read_instance(case.document)
        plan = case.plan if name == "outcrop" else ENTRANTS[name](case.document, 6, 2.0)[0]
        found = value_plan(instance, read_plan(plan, instance, 6), FUTURES // 4, seed)
        assert found.value <= case.upper + 4 * found.standard_error


@pytest.mark.parametrize(("member", "value"), [("p_success", 1.5), ("utility", -1.0), ("utility", math.nan)])
def test_an_instance_that_is_none_is_refused_by_name(member: str, value: float) -> None:
    document = generate("mixed", 3, 1)
    document["targets"][0][member] = value
    with pytest.raises(PlannerError, match=member):
        read_instance(json.loads(json.dumps(document)))


def test_the_same_seed_draws_the_same_instance_and_another_none_like_it() -> None:
    made = [json.dumps(generate(family, 5, seed)) for family in FAMILIES for seed in (1, 2, 1)]
    assert all(made[k] == made[k + 2] != made[k + 1] for k in range(0, len(made), 3))


@pytest.mark.parametrize("family", FAMILIES)
def test_the_planner_of_2004_writes_plain_numbers(family: str) -> None:
    for seed in range(8):
        plan, _ = ENTRANTS["pico2005"](generate(family, 4, seed), 6, 0.5)
        assert json.loads(json.dumps(plan)) == json.loads(json.dumps(plan, default=str))


def test_a_file_that_cannot_be_read_is_named(tmp_path: Path) -> None:
    (tmp_path / "x.json").write_text("[" * 100_000)
    with pytest.raises(PlannerError, match=r"x\.json"):
        load_document(tmp_path / "x.json")
