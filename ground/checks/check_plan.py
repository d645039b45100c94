"""Check all of a plan that files can tell: one report, for a pipeline.

Validator, a campaign on the abstract rover, flight rules, runs of a second rover, and the difference to the
plan that was approved. A plan with an error of the validator is not flown.
"""

from __future__ import annotations

import time
from collections.abc import Callable, Iterator
from contextlib import contextmanager
from dataclasses import dataclass, field, replace
from pathlib import Path
from tempfile import TemporaryDirectory
from typing import TYPE_CHECKING

from ground.campaigns.conduct import Conduct, make_order
from ground.campaigns.conduct import Plan as Runs
from ground.campaigns.engines import Engine
from ground.campaigns.folder import CampaignFolder
from ground.campaigns.inputs import expected_utility, read_case
from ground.campaigns.pilot import pilot_of
from ground.campaigns.result import CampaignResult
from ground.campaigns.variant import NamedCase, Variant, read_plan, varied
from ground.checks.flight_rules import CHECKS, Facts, UndecidedError, flight_rules
from ground.checks.report import Item, Mark, PlanCheck
from ground.checks.used_observations import used_observations
from ground.day.rovers import profile_of
from ground.errors import InvalidInputError
from ground.versions.difference import PlanDifference, difference

if TYPE_CHECKING:
    from executive.crl import Plan
    from executive.crl.validate import Report
    from ground.campaigns.case import Case
    from rover_iface.profile import RoverProfile

LARGEST_DEVIATION = 4.0
"""Standard errors between the planner's expectation and the flown mean: more is chance once in 16,000."""
SUCCEEDED = "SUCCEEDED"


@dataclass(frozen=True, slots=True, kw_only=True)
class CheckOrder:
    """What is asked.

    Attributes
    ----------
    runs, seed
        Futures of the campaign, and the first seed.
    second, second_runs
        Name of a second rover, empty for none, and its runs; each must end SUCCEEDED.
    approved
        The plan that was approved before.
    not_worse
        Fail if the plan earns less than the approved one beyond chance (95 %, on the same futures).
    strict
        Fail also by undecided rules and by warnings of the validator.
    """

    plan: Path
    world: Path
    runs: int = 1000
    seed: int = 1
    second: str = ""
    second_runs: int = 1
    approved: Path | None = None
    not_worse: bool = False
    strict: bool = False
    any_world: bool = False

    def __post_init__(self) -> None:
        if not 1 <= self.second_runs <= 1000:
            raise InvalidInputError(f"--second-runs is {self.second_runs}; it must be 1 to 1000")
        if self.not_worse and self.approved is None:
            raise InvalidInputError("--not-worse compares with the plan of --approved, which is not given")


def check_plan(
    order: CheckOrder,
    engine: Engine,
    tell: Callable[[str, float], None] = lambda _stage, _share: None,
    should_stop: Callable[[], bool] = lambda: False,
) -> PlanCheck | None:
    """Return the report on a plan; None if it was stopped.

    Raises
    ------
    InvalidInputError
        If a file cannot be read, or the world is that of another plan.
    RoverError
        If there is no such rover, or the world cannot be made.
    """
    return _Check(order, engine, tell, should_stop).run()


@dataclass
class _Check:
    order: CheckOrder
    engine: Engine
    tell: Callable[[str, float], None]
    should_stop: Callable[[], bool]
    items: list[Item] = field(default_factory=list)
    seconds: dict[str, float] = field(default_factory=dict)

    def run(self) -> PlanCheck | None:
        order = self.order
        with self._stage("validator"):
            report, profile = self._validated()
        changes = None
        if order.approved is not None and report.plan is not None:
            with self._stage("difference"):
                changes = self._difference(report.plan, order.approved)
        if report.plan is not None and report.valid:
            case = read_case(order.plan, order.world, "abstract", any_world=order.any_world)
            with self._stage("futures"):
                flown = self._fly(case)
            if flown is None:
                return None
            with self._stage("flight rules"):
                self._rules(case, flown, report, profile)
            if order.second:
                with self._stage("second rover"):
                    self._second()
        return self._summed(report.plan, changes)

    def _summed(self, plan: Plan | None, changes: PlanDifference | None) -> PlanCheck:
        from executive.crl.printer import digest

        items = tuple(self.items)
        if self.order.strict:
            items = tuple(replace(i, mark=Mark.FAILED) if i.mark is Mark.UNDECIDED else i for i in items)
        passed = all(item.mark is not Mark.FAILED for item in items)
        sha256 = "" if plan is None else digest(plan)
        return PlanCheck(str(self.order.plan), sha256, passed, items, self.seconds, changes)

    @contextmanager
    def _stage(self, name: str) -> Iterator[None]:
        self.tell(name, 0.0)
        begun = time.process_time()
        yield
        self.seconds[name] = round(time.process_time() - begun, 3)

    def _note(self, stage: str, name: str, holds: bool | None, said: str) -> None:
        mark = Mark.UNDECIDED if holds is None else Mark.PASSED if holds else Mark.FAILED
        self.items.append(Item(stage, name, mark, said))

    def _validated(self) -> tuple[Report, RoverProfile]:
        from executive.crl.validate import check
        from ground.campaigns.inputs import world_document
        from rover_iface.errors import RoverError
        from rover_iface.simulator.world import load_world

        path = self.order.plan
        try:
            text = path.read_text(encoding="utf-8")
        except (OSError, UnicodeDecodeError) as err:
            raise InvalidInputError(f"plan {path}: {getattr(err, 'strerror', None) or err}") from err
        world = world_document(self.order.world)
        try:
            load_world(world)
        except RoverError as err:
            raise InvalidInputError(f"{self.order.world}: {err}") from err
        profile = profile_of(str(world.get("profile") or "k9"))
        battery = world.get("battery_j")
        levels = {} if battery is None else {"battery-energy": float(battery)}
        language = profile.language
        report = check(text, commands=language.commands, telemetry=language.telemetry, levels=levels)
        for finding in report.findings:
            said = f"line {finding.line}: {finding.message}"
            if finding.is_error:
                self._note("validator", finding.code, False, said)
            else:
                mark = Mark.UNDECIDED if self.order.strict else Mark.NOTE
                self.items.append(Item("validator", finding.code, mark, said))
        if report.valid:
            self._note("validator", "errors", True, "none")
        return report, profile

    def _difference(self, plan: Plan, approved: Path) -> PlanDifference:
        found = difference(read_plan(approved), plan)
        said = "means the same" if found.same else f"{len(found.changes)} differences"
        self.items.append(Item("difference", str(approved), Mark.NOTE, said))
        return found

    def _fly(self, case: Case) -> CampaignResult | None:
        order = self.order
        variants: tuple[NamedCase, ...] = ()
        if order.approved is not None:
            other = varied(Variant("approved", plan=str(order.approved.resolve())), case)
            variants = (NamedCase("approved", other),)
        with TemporaryDirectory(prefix="outcrop-check-") as scratch:
            folder = CampaignFolder(Path(scratch) / "campaign")
            expected = expected_utility(order.plan)
            asked = make_order(case, order.seed, variants=variants, expected_utility=expected)
            folder.open(asked, resume=False)
            flown = Conduct(
                folder,
                asked,
                Runs(order.runs),
                lambda n, of: self.tell("futures", n / of),
                self.should_stop,
            ).run(self.engine)
        if flown is not None:
            self._judge(flown)
        return flown

    def _judge(self, flown: CampaignResult) -> None:
        utility = flown.utility
        done = flown.outcomes.get(SUCCEEDED, 0) / flown.runs
        mean = f"{flown.runs:,} futures: utility {utility.mean:.3f} +- {utility.standard_error:.3f}"
        self.items.append(Item("futures", "utility", Mark.NOTE, f"{mean}; {done:.1%} succeed"))
        for mode in flown.failures[:5]:
            seeds = ", ".join(map(str, mode.examples))
            said = f"{mode.share:.2%} of the futures: {mode.condition} (seeds {seeds})"
            self.items.append(Item("futures", mode.task, Mark.NOTE, said))
        if utility.predicted is not None and utility.deviation is not None:
            near = abs(utility.deviation) <= LARGEST_DEVIATION
            said = (
                f"expected {utility.predicted:.3f}; flown is {utility.deviation:+.1f} standard errors from it"
            )
            self._note("futures", "expectation", near, said)
        for found in flown.variants:
            # a variant's figure is the other plan less this one
            ends = found.interval
            worse = ends.low is not None and ends.low > 0
            said = f"the approved plan earns {found.mean:+.3f} against this one on the same futures"
            if self.order.not_worse:
                self._note("futures", "not worse", not worse, said)
            else:
                self.items.append(Item("futures", "against the approved", Mark.NOTE, said))

    def _rules(self, case: Case, flown: CampaignResult, report: Report, profile: RoverProfile) -> None:
        facts = facts_of(case, flown, report, profile)
        for rule in flight_rules():
            if rule.check == "campaign":  # the same share as FR-OVERRUN here
                continue
            try:
                holds, found, said = CHECKS[rule.check](facts, rule.limit)
            except UndecidedError as err:
                self._note("flight rules", rule.id, None, f"{rule.title}: {err}")
                continue
            figure = (
                "" if found is None else f"{found:.4g} (limit {rule.limit:g}{rule.unit and ' '}{rule.unit}); "
            )
            self._note("flight rules", rule.id, holds, f"{rule.title}: {figure}{said}")

    def _second(self) -> None:
        order = self.order
        case = read_case(order.plan, order.world, order.second, any_world=order.any_world)
        pilot = pilot_of(case)
        for k in range(order.second_runs):
            self.tell("second rover", k / order.second_runs)
            row = pilot.row(order.seed + k)
            said = f"{row.outcome} after {row.end_s:.0f} s, utility {row.utility:g}"
            if row.exceeded:
                said += f", over the budget of {', '.join(row.exceeded)}"
            why = "; ".join(f"{node}: {reason}" for node, reason in list(row.reasons.items())[:3])
            holds = row.outcome == SUCCEEDED and not row.exceeded
            name = f"{order.second}, seed {row.seed}"
            self._note("second rover", name, holds, said + (f" ({why})" if why else ""))


def facts_of(case: Case, flown: CampaignResult, report: Report, profile: RoverProfile) -> Facts:
    """Return what the files of a plan and its world tell the flight rules."""
    from executive.crl.values import ConsumableResource

    plan, world = case.plan(), case.world
    floors = [
        r.floor for r in plan.resources if isinstance(r, ConsumableResource) and r.key == "battery-energy"
    ]
    slope = None
    if world.get("terrain"):
        from rover_iface.terrain import load_terrain

        terrain = load_terrain(Path(str(world["terrain"])))

        def slope(east_m: float, north_m: float) -> float:
            return float(terrain.slope(east_m, north_m))

    battery, sun = world.get("battery_j"), world.get("sun") or {}
    used = used_observations(plan, case.problem, profile)
    names = {name for key, i in profile.instruments.items() for name in (key, i.alias) if name}
    return Facts(
        problem=case.problem,
        planned=used.ids,
        open_uses=used.open,
        errors=tuple(f"{f.code} {f.message}" for f in report.errors),
        instruments=frozenset(names),
        slope=slope,
        battery_j=None if battery is None else float(battery),
        energy_floor_j=floors[0] if floors else None,
        start_lmst_h=sun.get("start_lmst_h"),
        overrun=None,
        campaign=flown,
        least_runs=flown.runs,
    )
