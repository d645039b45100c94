"""Sentences of the page against what they are about.

    python -m studies.page_sentences [--sentences 300] [--seed S]

Random days whose budgets hold a part of what is asked, each planned with branches. The page's own functions
(`web/src/lib`, run by node) say why each observation that is left out is not in the plan, how the plan does
against one with less, how a run went that took no branch, and what a campaign found. Each sentence is then
read, and what it claims is checked apart: on the steps of the plans, by all orders of the observations, by
the evaluator that draws nothing, by other futures than those it was counted on. A sentence that says more
than holds is printed. Nothing was tuned on these days.
"""

from __future__ import annotations

import argparse
import dataclasses
import json
import math
import re
import subprocess
import sys
import time
from collections import Counter
from collections.abc import Callable, Iterator, Sequence
from dataclasses import dataclass
from pathlib import Path
from typing import Any

import numpy as np

from ground.campaigns.causes import Causes
from ground.campaigns.tally import Tally
from planner.errors import PlannerError
from planner.evaluate.model import Model
from planner.evaluate.monte_carlo import simulate
from planner.evaluate.propagate import Evaluator
from planner.explain import compare_plans, why_not
from planner.plan_tree import Plan, plan_tree_to_dict, planned_observations
from planner.problem import Problem
from planner.solve import solve
from studies.common.planner_days import day
from studies.planner_why_not import best_of, orders
from tests.planner.examples import visits

ROOT = Path(__file__).resolve().parents[1]
SAY = [sys.executable, str(ROOT / "scripts" / "build_web.py"), "npm", "run", "--silent", "say"]
FUTURES = 20_000
MANY = 10 * FUTURES
"""For the worst of them, of which few are very bad."""
FLOWN = 200
"""Runs of a campaign."""
SIGMAS = 4.5
"""Between two independent estimates: one in 150,000 of true ones is farther off."""
GRID_SHARE = 0.01
"""Of a plan's value, by which the evaluator without draws may be off; `docs/results/planner.md` has 0.5 %."""
HALF = 0.0051
"""Half a unit of the second decimal, in which values are told."""


@dataclass
class Case:
    """What the page is given, and all that is known of it."""

    kind: str
    given: dict[str, Any]
    problem: Problem
    plan: Plan
    tree: dict[str, Any]
    known: Any = None


def written(value: Any) -> Any:
    """Return a value as the server writes it."""
    if dataclasses.is_dataclass(value) and not isinstance(value, type):
        return {f.name: written(getattr(value, f.name)) for f in dataclasses.fields(value)}
    if isinstance(value, dict):
        return {str(key): written(part) for key, part in value.items()}
    if isinstance(value, list | tuple):
        return [written(part) for part in value]
    return value


def cases(rng: np.random.Generator) -> Iterator[Case]:
    """Yield the cases of one day."""
    problem = day(rng, least=4, most=5)
    share = float(rng.uniform(0.4, 0.8))
    budget = dataclasses.replace(problem.budget, time_s=share * problem.budget.time_s)
    problem = dataclasses.replace(problem, budget=budget)
    seed = int(rng.integers(2**31))
    result = solve(problem, max_branches=2, iterations=1, seed=seed, plan_only=False)
    plan, tree = result.tree.plan, plan_tree_to_dict(result.tree, problem)
    held = planned_observations(plan)
    for what in problem.observations:
        if what.id in held:
            continue
        found = why_not(problem, plan, str(what.id), futures=FUTURES, seed=seed)
        least = found.relaxation
        given = {
            "reason": found.reason,
            "attempted": bool(found.forced),
            "change": found.change,
            "standard_error": found.standard_error,
            "displaced": [str(o) for o in found.displaced],
            "relaxation": None
            if least is None
            else {"what": least.what, "factor": least.factor, "value": least.value},
        }
        yield Case("why-not", given, problem, plan, tree, (what, found))
    names = [str(o.id) for o in problem.observations if o.id in held]
    other = visits(problem, *rng.permutation(names)[: max(1, len(names) - 1)])
    try:
        paired = compare_plans(problem, plan, other, futures=FUTURES, seed=seed)
    except PlannerError:
        return
    yield Case("comparison", written(paired), problem, plan, tree, other)
    for outcome in ("SUCCEEDED", str(rng.choice(["FAILED", "ABORTED", ""]))):
        yield Case("run", {"outcome": outcome, "plan": tree}, problem, plan, tree)
    utilities = simulate(Model.of(problem), plan, FLOWN, seed=seed + 1).utility
    tally = Tally(Causes(), ())
    for utility in utilities:
        tally.utilities.append(float(utility))
        tally.moments.add(float(utility))
    expected = float(Evaluator(Model.of(problem)).value(plan).value)
    yield Case("campaign", written(tally.utility(expected)), problem, plan, tree, (utilities, expected))


def said(found: Sequence[Case]) -> list[Any]:
    """Return what the page says of each case."""
    asked = json.dumps([{"kind": case.kind, "given": case.given} for case in found])
    done = subprocess.run(SAY, input=asked, capture_output=True, text=True, check=True, cwd=ROOT)
    answers: list[Any] = json.loads(done.stdout)
    return answers


def number(text: str) -> float:
    """Return a number as the page writes it."""
    return float(text.replace("\u2212", "-"))


def seconds(text: str) -> float:
    """Return a duration as the page writes it, `1:05:09`."""
    hours, minutes, rest = (int(part) for part in text.split(":"))
    return float(3600 * hours + 60 * minutes + rest)


def exact(problem: Problem, plan: Plan) -> float:
    """Return the value of a plan, by the evaluator that draws nothing."""
    return float(Evaluator(Model.of(problem)).value(plan).value)


def widened(problem: Problem, name: str, what: str, factor: float) -> Problem:
    """Return a problem with the limits that a sentence names so many times as wide."""
    budget, targets = problem.budget, problem.targets
    if "time budget" in what:
        budget = dataclasses.replace(budget, time_s=factor * budget.time_s)
    if "energy budget" in what:
        budget = dataclasses.replace(
            budget, energy_j=budget.energy_j + (factor - 1.0) * budget.usable_energy_j
        )
    if "window" in what:

        def wider(o: Any) -> Any:
            if str(o.id) != name or o.window_s is None:
                return o
            middle, half = sum(o.window_s) / 2.0, (o.window_s[1] - o.window_s[0]) / 2.0
            return dataclasses.replace(o, window_s=(middle - factor * half, middle + factor * half))

        targets = tuple(
            dataclasses.replace(t, observations=tuple(map(wider, t.observations))) for t in targets
        )
    return dataclasses.replace(problem, budget=budget, targets=targets)


CHANGE = re.compile(
    r"A plan that must contain it changes in value by (\S+) ± (\S+?)(?: and displaces (.+))?\.$"
)
LETS_IN = re.compile(
    r"With (\S+) times the (.+) it is included, and the best unbranched plan found is worth (\S+)\.$"
)
NONE_BETTER = (
    "Up to three times the budgets and its window were tried, each and all together: no unbranched plan was "
    "found that is better with it."
)


def of_why_not(case: Case, sentences: list[str]) -> Iterator[str]:
    """Yield what is false in an answer to why-not."""
    for text in sentences:
        if match := CHANGE.fullmatch(text):
            yield from _of_change(case, text, match)
        elif match := LETS_IN.fullmatch(text):
            yield from _of_relaxation(case, text, match)
        elif text == NONE_BETTER:
            yield from _of_none_better(case, text)
        elif text == "No plan was found that holds it.":
            if case.known[1].forced:
                yield f"{text} One was."
        elif not _is_reason(case, text):
            yield f"{text} It is not what the planner found."


def _scale(case: Case) -> float:
    """Return by how much the evaluator without draws may be off."""
    return GRID_SHARE * max(1.0, sum(o.utility for o in case.problem.observations))


def _of_change(case: Case, text: str, match: re.Match[str]) -> Iterator[str]:
    what, found = case.known
    change, error = number(match[1]), number(match[2])
    names = set(match[3].split(", ")) if match[3] else set()
    forced, shown = planned_observations(found.forced), planned_observations(case.plan)
    if abs(error - found.standard_error) > HALF:
        yield f"{text} The error is {found.standard_error:.3f}."
    if what.id not in forced:
        yield f"{text} The plan does not contain it."
    if names != {str(o) for o in shown - forced}:
        yield f"{text} The plan holds {sorted(shown)}, the forced one {sorted(forced)}."
    true = exact(case.problem, found.forced) - best_of(case.problem, orders(case.problem), None)
    if abs(change - true) > SIGMAS * error + _scale(case) + HALF:
        yield f"{text} It is {true:+.3f}."


def _of_relaxation(case: Case, text: str, match: re.Match[str]) -> Iterator[str]:
    what, found = case.known
    least = found.relaxation
    wide = widened(case.problem, str(what.id), match[2], least.factor)
    if abs(number(match[1]) - least.factor) > HALF or what.id not in planned_observations(least.plan):
        yield f"{text} The plan does not hold it with {least.factor}."
    flown = simulate(Model.of(wide), least.plan, FUTURES, seed=987_654_321).utility
    spread = SIGMAS * float(flown.std()) / math.sqrt(FUTURES)
    if abs(number(match[3]) - float(flown.mean())) > spread + _scale(case) + HALF:
        yield f"{text} It is worth {flown.mean():.3f}."


def _of_none_better(case: Case, text: str) -> Iterator[str]:
    name = str(case.known[0].id)
    for limits in ("time budget", "energy budget", "window", "time budget energy budget window"):
        wide = widened(case.problem, name, limits, 3.0)
        ranked = orders(wide)
        with_it, best = best_of(wide, ranked, name), best_of(wide, ranked, None)
        without = max(v for o, v in ranked.items() if name not in o)
        if with_it >= best - 1e-9 and with_it > without + 3.0 * _scale(case):
            yield f"{text} With the {limits} one is worth {with_it:.3f}, without it {without:.3f}."


def _is_reason(case: Case, text: str) -> bool:
    """Return whether a reason without a plan says what holds."""
    what, found = case.known
    if text == f"{what.id} is worth nothing.":
        return bool(what.utility <= 0.0)
    if text.startswith(f"No start of {what.id} "):
        return what.window_s is not None and what.window_s[1] < 0.0
    opens = re.fullmatch(rf"The window of {what.id} opens at (\S+); the time budget is (\S+)\.", text)
    if opens is not None:
        begins, ends = (seconds(part) for part in opens.groups())
        true, most = what.window_s[0], case.problem.budget.time_s
        return bool(true >= most and abs(begins - true) <= 0.51 and abs(ends - most) <= 0.51)
    if not text.startswith(f"Found no way to make {what.id} within the budgets; "):
        return False
    told = re.findall(r"(\S+) times the (time budget|energy budget|window)", text)
    return {float(f) for f, _ in told} <= {3.0, *(r.factor for r in found.relaxations)}


def near_share(text: str, share: float, count: int, digits: int) -> bool:
    """Return whether a share in per cent is that of other futures, as far as two counts agree."""
    spread = SIGMAS * math.sqrt(2.0 * max(share * (1.0 - share), 1.0 / count) / count)
    if text in {"<1 %", ">99 %"}:
        return share < 0.01 + spread if text[0] == "<" else share > 0.99 - spread
    return abs(number(text.removesuffix(" %")) / 100.0 - share) <= spread + 0.51 * 10.0 ** (-2 - digits)


def tail_error(ordered: np.ndarray[Any, Any]) -> float:
    """Return the standard error of the mean of the worst 5 % of `FUTURES`, from more that are in order.

    The threshold is drawn too; it counts as far up as 3 standard deviations of the share may put it, for the
    worst may end at a gap.

    Notes
    -----
    Trindade et al., Journal of Banking & Finance 31 (2007), the variance of the expected shortfall.
    """
    tail = ordered[: len(ordered) // 20]
    share = 0.05 + 3.0 * math.sqrt(0.05 * 0.95 / FUTURES)
    threshold = ordered[min(len(ordered) - 1, int(share * len(ordered)))]
    beyond = 0.95 * (threshold - tail.mean()) ** 2
    return math.sqrt((float(tail.var()) + float(beyond)) / (FUTURES / 20))


def of_comparison(case: Case, lines: list[dict[str, str]]) -> Iterator[str]:
    """Yield what is false in a comparison, by other futures and by the evaluator without draws."""
    here, there = (
        simulate(Model.of(case.problem), plan, FUTURES, seed=987_654_321) for plan in (case.plan, case.known)
    )
    scale = GRID_SHARE * max(1.0, sum(o.utility for o in case.problem.observations))
    both = here.utility - there.utility
    spread = SIGMAS * math.sqrt(2.0 / FUTURES)
    for line in lines:
        told = f"{line['what']}: {line['here']}, {line['there']} {line['difference']}"
        sides = ((line["here"], here, case.plan), (line["there"], there, case.known))
        match line["what"]:
            case "Value on the same futures":
                off = [abs(number(text) - exact(case.problem, plan)) for text, _, plan in sides]
                most = [spread * float(flown.utility.std()) + scale + HALF for _, flown, _ in sides]
                change, error = line["difference"].split(" ± ")
                off.append(abs(number(change) - float(both.mean())))
                most.append(spread * float(both.std()) + HALF)
                off.append(abs(number(error) - float(both.std()) / math.sqrt(FUTURES)))
                most.append(HALF + 0.002)
                good = all(a <= b for a, b in zip(off, most, strict=True))
            case "Beats the other with":
                shares = float(np.mean(both > 1e-9)), float(np.mean(both < -1e-9))
                good = all(
                    near_share(text, share, FUTURES, 0)
                    for (text, _, _), share in zip(sides, shares, strict=True)
                )
            case "Worst 5 %, mean":
                model = Model.of(case.problem)
                more = [simulate(model, plan, MANY, seed=123_456_789) for _, _, plan in sides]
                ordered = [np.sort(flown.utility) for flown in more]
                good = all(
                    abs(number(text) - worst[: MANY // 20].mean())
                    <= SIGMAS * math.sqrt(2.0) * tail_error(worst) + HALF
                    for (text, _, _), worst in zip(sides, ordered, strict=True)
                )
                less = number(line["here"]) - number(line["there"])
                good &= abs(number(line["difference"]) - less) <= 3.0 * HALF
            case "Ends over a budget with":
                good = all(
                    near_share(text, float(flown.overrun.mean()), FUTURES, 1) for text, flown, _ in sides
                )
            case _:
                good = False
        if not good:
            yield told


def of_run(case: Case, sentences: list[str]) -> Iterator[str]:
    """Yield what is false of a run that took no branch."""
    (text,) = sentences
    outcome = case.given["outcome"]
    options = [o for step in case.tree["plan"] for o in step.get("options", [])]
    odds = 1.0 - min(1.0, sum(option["p_taken"] for option in options))
    if outcome == "":
        good = text == "None so far."
    elif outcome != "SUCCEEDED":
        good = text == f"None before the run ended: {outcome.lower()}."
    elif not options:
        good = text == "None: the mainline to its end."
    else:
        match = re.fullmatch(r"None: the mainline to its end, as was to be expected with (.+)\.", text)
        good = match is not None and near_share(match[1], odds, 10**9, 0)
    if not good:
        yield f"{text} Outcome {outcome}, odds {odds:.4f}."


def of_campaign(case: Case, sentences: list[str]) -> Iterator[str]:
    """Yield what is false in what is told of a campaign."""
    utilities, expected = case.known
    mean, error = float(utilities.mean()), float(utilities.std(ddof=1)) / math.sqrt(len(utilities))
    verdict, spread = sentences
    if verdict is not None:
        match = re.fullmatch(
            r"The planner expected (\S+); the mean is (\S+) standard errors (below|above) it, "
            r"(which is within chance|more than chance alone makes)\.",
            verdict,
        )
        off = (mean - expected) / error
        if (
            match is None
            or abs(number(match[1]) - expected) > HALF
            or abs(number(match[2]) - abs(off)) > 0.051
            or (match[3] == "below") != (off < 0)
            or (match[4] == "which is within chance") != (abs(off) <= 3.0)
        ):
            yield f"{verdict} It is {off:+.2f} standard errors off {expected:.3f}."
    match = re.fullmatch(
        r"One day in twenty earns (\S+) or less, half of them (\S+) or more, one in twenty (\S+) or more\.",
        spread,
    )
    if match is None:
        yield spread
        return
    low, middle, high = (number(text) for text in match.groups())
    count = len(utilities)
    good = np.mean(utilities <= low + 0.051) >= 0.05 - 1 / count
    good &= np.mean(utilities >= middle - 0.051) >= 0.5 - 1 / count
    good &= np.mean(utilities >= high - 0.051) >= 0.05 - 1 / count
    good &= np.mean(utilities > high + 0.051) <= 0.05 + 1 / count
    if not good:
        yield spread


CHECKS: dict[str, Callable[[Case, Any], Iterator[str]]] = {
    "why-not": of_why_not,
    "comparison": of_comparison,
    "run": of_run,
    "campaign": of_campaign,
}


def study(sentences: int, seed: int) -> tuple[Counter[str], list[str]]:
    """Return how many sentences of each kind were checked, and those that are false."""
    rng = np.random.default_rng(seed)
    found: list[Case] = []
    least = {"why-not": sentences // 2, "comparison": 0, "run": 0, "campaign": 0}
    count: Counter[str] = Counter()
    while sum(count.values()) < sentences or any(count[kind] < many for kind, many in least.items()):
        for case in cases(rng):
            found.append(case)
            count[case.kind] += 1
    told: Counter[str] = Counter()
    wrong: list[str] = []
    for case, lines in zip(found, said(found), strict=True):
        told[case.kind] += len([line for line in lines if line is not None])
        wrong += [f"{case.kind}: {line}" for line in CHECKS[case.kind](case, lines)]
    return told, wrong


def main() -> None:
    """Print what was checked and every sentence that is false; the exit code tells."""
    assert __doc__ is not None
    parser = argparse.ArgumentParser(description=__doc__.splitlines()[0])
    parser.add_argument("--sentences", type=int, default=300)
    parser.add_argument("--seed", type=int, default=None, help="fresh from the clock when absent")
    options = parser.parse_args()
    seed = options.seed if options.seed is not None else time.time_ns() % 1_000_000_000
    print(f"seed {seed}", flush=True)
    told, wrong = study(options.sentences, seed)
    kinds = ", ".join(f"{count} {kind}" for kind, count in sorted(told.items()))
    print(f"{sum(told.values())} sentences checked ({kinds}): {len(wrong)} false")
    for line in wrong:
        print(line)
    sys.exit(1 if wrong else 0)


if __name__ == "__main__":
    main()
