"""What is most likely to go wrong with a plan, and what it would cost: from plan tree and problem. Pure."""

from __future__ import annotations

from collections import defaultdict
from collections.abc import Mapping, Sequence
from dataclasses import dataclass, field
from typing import TYPE_CHECKING

if TYPE_CHECKING:
    from planner.plan_tree_document import StepDocument, TreeDocument
    from planner.problem_document import LegDocument, ObservationDocument, ProblemDocument


@dataclass(frozen=True, slots=True)
class FailureMode:
    """One way to lose something; `chance` over all futures, `at_stake` the value that hangs on it."""

    what: str
    chance: float
    at_stake: float

    @property
    def expected_loss(self) -> float:
        return self.chance * self.at_stake


@dataclass
class _Walk:
    """What is collected along the tree. Names of targets are those of people."""

    legs: Mapping[tuple[str, str], LegDocument]
    observations: Mapping[str, tuple[str, ObservationDocument]]
    names: Mapping[str, str]
    lost: dict[tuple[str, str, str], list[tuple[float, frozenset[str]]]] = field(
        default_factory=lambda: defaultdict(list)
    )
    """Leg and target: the chance of each loss, with the observations that were made before it."""
    short: dict[tuple[str, str], float] = field(default_factory=lambda: defaultdict(float))
    """Leg: the chance that a drive on it ends short."""
    spoilt: dict[str, float] = field(default_factory=lambda: defaultdict(float))
    attempted: dict[str, float] = field(default_factory=lambda: defaultdict(float))

    def steps(
        self,
        steps: Sequence[StepDocument],
        place: str,
        tracked: frozenset[str],
        chance: float,
        made: frozenset[str] = frozenset(),
    ) -> None:
        for step in steps:
            reached = float(step.get("p_reached", chance))
            match step["op"]:
                case "track_start":
                    tracked |= {step["target"]}
                case "track_stop":
                    tracked -= {step["target"]}
                case "navigate":
                    place = self.drive(place, step["to"], tracked, reached, made)
                case "observe":
                    self.observe(str(step["observation"]), reached)
                    made |= {str(step["observation"])}
                case "visit":
                    place = self.drive(place, str(step["target"]), tracked, reached, made)
                    for name, (target, _) in self.observations.items():
                        if target == step["target"]:
                            self.observe(name, reached)
                            made |= {name}
                case "branch":
                    for option in step["options"]:
                        gone = {w["target"] for w in option["when"] if w["var"] == "tracked" and not w["is"]}
                        taken = float(option.get("p_taken", 0.0))
                        self.steps(option["plan"], place, tracked - gone, taken, made)
                case _:
                    pass

    def drive(self, place: str, to: str, tracked: frozenset[str], chance: float, made: frozenset[str]) -> str:
        leg = self.legs.get((place, to))
        if leg is not None:
            for target, p_lose in (leg.get("p_lose") or {}).items():
                if target in tracked:
                    self.lost[(target, place, to)].append((chance * p_lose, made))
            self.short[(place, to)] += chance * (leg.get("p_fail") or 0.0)
        return to

    def observe(self, name: str, chance: float) -> None:
        if name in self.observations:
            self.attempted[name] += chance
            p_success = self.observations[name][1].get("p_success")
            self.spoilt[name] += chance * (0.0 if p_success is None else 1.0 - p_success)


def failure_modes(
    tree: TreeDocument,
    problem: ProblemDocument,
    names: Mapping[str, str],
    *,
    most: int = 10,
    beside: Sequence[FailureMode] = (),
) -> list[FailureMode]:
    """Return the ways to lose value, the largest expected loss first.

    A track lost on a leg puts those observations of its target at stake that need it and were not made before
    (a mean over the ways there, where they differ); a drive that ends short all that the plan holds of the
    place it leads to; an observation may bring nothing usable (its success probability); and one that the
    plan holds may not be come to. `beside` are modes found elsewhere.
    """
    legs = {(leg["from"], leg["to"]): leg for leg in problem.get("legs", ())}
    observations = {
        o["id"]: (t["id"], o) for t in problem.get("targets", ()) for o in t.get("observations", ())
    }
    walk = _Walk(legs, observations, names)
    walk.steps(tree.get("plan", ()), "start", frozenset(), 1.0)

    def worth(name: str) -> float:
        return float(observations[name][1]["utility"])

    def needs_track(name: str) -> bool:
        observation = observations[name][1]
        return observation.get("kind") == "place" or bool(observation.get("tracked", False))

    def said(target: str) -> str:
        return names.get(target, target)

    def called(name: str) -> str:
        target, observation = observations[name]
        return f"{observation.get('instrument', observation.get('kind', 'observation'))} of {said(target)}"

    found = []
    for (target, place, to), losses in walk.lost.items():
        hanging = [n for n in walk.attempted if observations[n][0] == target and needs_track(n)]
        chance, loss = 0.0, 0.0
        for share, made in losses:
            stake = sum(worth(n) for n in hanging if n not in made)
            if stake > 0.0:
                chance, loss = chance + share, loss + share * stake
        if chance > 0.0:
            what = f"the track of {said(target)} is lost between {said(place)} and {said(to)}"
            found.append(FailureMode(what, min(chance, 1.0), loss / chance))
    for (place, to), chance in walk.short.items():
        stake = sum(worth(n) for n in walk.attempted if observations[n][0] == to)
        what = f"the drive from {said(place)} to {said(to)} ends short"
        found.append(FailureMode(what, min(chance, 1.0), stake))
    for name, chance in walk.spoilt.items():
        found.append(FailureMode(f"the {called(name)} brings nothing usable", min(chance, 1.0), worth(name)))
    for name, chance in walk.attempted.items():
        missed = max(0.0, 1.0 - chance)
        found.append(FailureMode(f"the {called(name)} is not come to", missed, worth(name)))
    likely = [mode for mode in (*found, *beside) if mode.expected_loss > 1e-9]
    return sorted(likely, key=lambda mode: (-mode.expected_loss, mode.what))[:most]
