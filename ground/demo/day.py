"""One day, end to end, without a database: terrain to data products, with a lost track on the way."""

from __future__ import annotations

import hashlib
import json
import time
from collections.abc import Callable, Iterator, Mapping, Sequence
from contextlib import contextmanager
from dataclasses import dataclass, field
from pathlib import Path
from typing import TYPE_CHECKING, Any, cast

from ground.day.plan_summary import summary_of
from ground.day.prepare import PreparedDay, prepare_day
from ground.demo.mission import demo_mission
from ground.errors import InvalidInputError
from ground.reports.figures import draw_day, undrawn
from ground.reports.plan_drawing import describe_when
from ground.uplink.admission import commission
from ground.uplink.flight import Flight, fly
from ground.uplink.package import json_text, manifest_text
from ground.uplink.training import PEOPLE, make_team, sign_package
from ground.uplink.verify import read_trust, verify_package
from mission import Day

if TYPE_CHECKING:
    from ground.uplink.verify import Package
    from planner.plan_tree_document import OptionDocument, StepDocument, TreeDocument
    from planner.problem_document import ProblemDocument
    from planner.solve import PlanResult
    from rover_iface.profile import RoverProfile
    from rover_iface.terrain import Terrain

PROFILE = "k9"
BRANCHES = 6
LEAST_TAKEN = 0.02
"""Options that fewer futures take are left out: nobody reviews what never happens."""

PROGRESS_S = 20.0

Report = Callable[[str, float], None]


@dataclass(frozen=True)
class DayRecord:
    """All that a demo day produced; `products` are by request, `seconds` by stage."""

    folder: Path
    asked: Day
    prepared: PreparedDay
    plan: PlanResult
    tree: TreeDocument
    flight: Flight
    fault: Mapping[str, Any] | None
    products: Mapping[str, tuple[Mapping[str, Any], ...]]
    orphans: int
    seconds: Mapping[str, float] = field(default_factory=dict)

    @property
    def observed(self) -> dict[str, int]:
        """Number of data products by target."""
        target_of = {r.id: r.target_id for r in self.asked.requests}
        count: dict[str, int] = {}
        for request, rows in self.products.items():
            count[target_of[request]] = count.get(target_of[request], 0) + len(rows)
        return count


def run_day(
    terrain_folder: Path | None,
    *,
    seed: int,
    out: Path,
    time_limit_s: float = 30.0,
    rover: str = "abstract",
    tracker: str = "",
    report: Report | None = None,
) -> DayRecord:
    """Run a whole day and write every artefact into `out`; `rover` names the simulated rover of the dry run.

    `tracker` names another tracker than the rover's own.

    Raises
    ------
    InvalidInputError
        If `out` holds an earlier day or is not a folder, or the terrain has no room for ten targets.
    RoverError, PlannerError, ExecutiveError
        If a room refuses its part.
    """
    from executive.crl import canonical_text, digest
    from planner.emit_crl import emit
    from planner.plan_tree import plan_tree_to_dict
    from planner.problem import problem_to_dict
    from planner.solve import solve
    from rover_iface.profile import load_profile
    from rover_iface.registry import find_rover
    from rover_iface.simulator.faults import load_faults
    from rover_iface.terrain import generate_terrain, load_terrain

    _check_folder(out)
    make_rover = find_rover(rover)
    clock = _Stages(report or (lambda _stage, _share: None))
    with clock.stage("terrain"):
        terrain = generate_terrain(seed) if terrain_folder is None else load_terrain(terrain_folder)
    profile = load_profile(PROFILE)
    with clock.stage("targets and observation requests"):
        asked = demo_mission(terrain, profile, seed=seed)
    with clock.stage("observation points and path network") as tell:
        prepared = prepare_day(terrain, profile, asked, report=lambda share, _what: tell(share))
        problem = prepared.problem
        document = cast("ProblemDocument", problem_to_dict(problem))
        out.mkdir(parents=True, exist_ok=True)
        _write_json(out / "problem.json", document)
        write_world(out / "world", seed, asked, document, terrain, terrain_folder)
    with clock.stage("contingent plan") as tell:
        plan = solve(
            problem,
            max_branches=BRANCHES,
            least_taken=LEAST_TAKEN,
            time_limit_s=time_limit_s,
            seed=seed,
            report=lambda progress: tell(progress.fraction),
        )
        tree = cast("TreeDocument", plan_tree_to_dict(plan.tree, problem))
        _write_json(out / "plan_tree.json", tree)
    with clock.stage("CRL"):
        crl = emit(problem, plan.tree, plan_id="demo")
        crl_text = canonical_text(crl)
        (out / "plan.crl").write_text(crl_text, encoding="utf-8")
        _write_json(out / "summary.json", summary_of(problem, plan, digest(crl)))
    fault = loss_to_inject(document, tree)
    with clock.stage("dry run on the simulated rover") as tell:
        simulated = make_rover(
            document,
            out=out,
            seed=seed,
            faults=() if fault is None else load_faults([fault]),
            progress_s=PROGRESS_S,
            terrain=terrain,
            **({"tracker": tracker} if tracker else {}),
        )
        flight = fly(
            crl_text,
            simulated,
            out,
            run_id="demo",
            about={"rover": rover, "seed": seed, "faults": [] if fault is None else [fault]},
            on_sample=lambda sample: tell(min(1.0, sample.t_s / asked.limits.time_s)),
            sync=False,
        )
    with clock.stage("two people sign the package"):
        sign_day(out, asked, crl_text, terrain.sha256, profile, flight)
        commission(out / "world", out / "keys" / "trust.json")
    with clock.stage("data products to their requests"):
        products, orphans = tie_products(out, asked)
    day = DayRecord(out, asked, prepared, plan, tree, flight, fault, products, orphans, clock.seconds)
    if not undrawn():
        with clock.stage("map"):
            draw_day(
                out / "map.png",
                terrain,
                document,
                tree,
                driven_m=[(s.east_m, s.north_m) for s in flight.samples],
                observed=day.observed,
                lost=flight.lost_targets(),
                keep_outs=[k.polygon_m for k in asked.keep_outs],
                title=(
                    f"{asked.refs['terrain']}: plan of {plan.expected_utility:.1f}, "
                    f"run of {flight.outcome.utility:.1f}"
                ),
            )
    (out / "summary.txt").write_text("\n".join(summary_lines(day)) + "\n", encoding="utf-8")
    return day


def write_world(
    folder: Path,
    seed: int,
    asked: Day,
    problem: Mapping[str, object],
    terrain: Terrain,
    terrain_folder: Path | None,
) -> None:
    """Write a day's world, so that any rover can execute its package: a `world/1` with its terrain.

    A terrain that came from a folder stays there; a generated one is written beside the world.
    """
    from rover_iface.terrain import write_terrain

    folder.mkdir(parents=True, exist_ok=True)
    _write_json(folder / "problem.json", problem)
    world = {
        "format": "world/1",
        "name": str(asked.refs["terrain"]),
        "terrain": "terrain" if terrain_folder is None else str(terrain_folder.resolve()),
        "profile": PROFILE,
        "seed": seed,
        "problem": "problem.json",
    }
    if terrain_folder is None:
        write_terrain(terrain, folder / "terrain")
    _write_json(folder / "world.json", world)


def sign_day(
    out: Path, asked: Day, crl_text: str, terrain_sha256: str, profile: RoverProfile, flight: Flight
) -> Package:
    """Return the package of a day, signed by two people with a key each under a trust file for training.

    Keys and trust file stay in `out/keys`, the package in `out/package.zip`; it was checked as a rover does.
    """
    from datetime import UTC, datetime, timedelta
    from importlib.metadata import version

    now, language = datetime.now(UTC), profile.language
    trace = (flight.folder / "trace.jsonl").read_bytes()
    about = {
        "mission": "demo",
        "plan": "demo",
        "counter": 1,
        "issued_utc": now.isoformat(timespec="seconds"),
        "expires_utc": (now + timedelta(days=7)).isoformat(timespec="seconds"),
        "terrain_sha256": terrain_sha256,
        "dictionary": {"name": language.name, "version": language.version, "sha256": language.sha256},
        "profile": {"name": profile.name, "version": profile.version, "sha256": profile.sha256},
        "models_sha256": hashlib.sha256(f"{version('outcrop')} {profile.sha256}".encode()).hexdigest(),
        "author": PEOPLE[0],
        "verification": {
            "run": "demo",
            "outcome": flight.outcome.outcome,
            "trace_sha256": hashlib.sha256(trace).hexdigest(),
        },
    }
    team = make_team(out / "keys", rover="demo")
    targets = [{"id": t.id, "name": t.name, "point_m": list(t.point_site)} for t in asked.targets]
    landmarks = json_text({"format": "landmarks/1", "frame": "site", "targets": targets})
    content = sign_package(team, manifest_text(about, crl_text, landmarks), crl_text, landmarks)
    (out / "package.zip").write_bytes(content)
    return verify_package(content, read_trust(team.trust.read_bytes()), now)


class _Stages:
    """Times the stages of a day and reports where they stand."""

    def __init__(self, report: Report) -> None:
        self._report = report
        self.seconds: dict[str, float] = {}

    @contextmanager
    def stage(self, name: str) -> Iterator[Callable[[float], None]]:
        """Give what is told the share of a stage that is done."""
        began = time.monotonic()
        self._report(name, 0.0)
        try:
            yield lambda share: self._report(name, share)
        finally:
            self.seconds[name] = time.monotonic() - began
            self._report(name, 1.0)


def _check_folder(out: Path) -> None:
    if out.exists() and not out.is_dir():
        raise InvalidInputError(f"{out} is a file; --out needs a folder")
    if (out / "journal.jsonl").exists():
        raise InvalidInputError(
            f"{out} holds the journal of an earlier day; choose another folder or remove it"
        )


def _write_json(path: Path, document: Mapping[str, object]) -> None:
    path.write_text(json.dumps(document, indent=1) + "\n", encoding="utf-8")


def loss_to_inject(problem: ProblemDocument, tree: TreeDocument) -> Mapping[str, object] | None:
    """Return a fault that makes the plan show what it holds: a track lost in the middle of the first drive.

    Preferred is the target whose loss has the branch that gains most, then one on whose track a branch asks,
    then the last tracked target that the mainline visits; None if nothing is tracked.
    """
    tracked = [s["target"] for s in tree["plan"] if s["op"] == "track_start"]
    if not tracked:
        return None
    asked = [t for t, _ in sorted(_asked_tracks(tree["plan"]), key=lambda a: -a[1]) if t in tracked]
    visits = [str(s.get("to", s.get("target"))) for s in tree["plan"] if s["op"] in ("visit", "navigate")]
    later = [t for t in visits[1:] if t in tracked]
    target = next(iter([*asked, *reversed(later), *tracked]))
    first = visits[0] if visits else None
    leg = next((x for x in problem["legs"] if x["from"] == "start" and x["to"] == first), None)
    drive_s = leg["time_s"]["mean"] if leg is not None else 60.0
    return {
        "kind": "lose-target",
        "target": target,
        "at_s": round(problem["track_start"]["time_s"] * len(tracked) + drive_s / 2, 1),
    }


def _asked_tracks(steps: Sequence[StepDocument]) -> Iterator[tuple[str, float]]:
    """Yield targets on whose track a branch asks, and what it gains; 0 if it asks that they are tracked."""
    for step in steps:
        for option in step["options"] if step["op"] == "branch" else ():
            for condition in option["when"]:
                if condition["var"] == "tracked":
                    yield condition["target"], 0.0 if condition["is"] else option.get("gain") or 0.0
            yield from _asked_tracks(option["plan"])


def tie_products(folder: Path, asked: Day) -> tuple[dict[str, tuple[Mapping[str, object], ...]], int]:
    """Return the data products of a run by observation request, and how many match none."""
    known = {request.id for request in asked.requests}
    tied: dict[str, list[Mapping[str, Any]]] = {}
    orphans = 0
    for line in (folder / "products.jsonl").read_text(encoding="utf-8").splitlines():
        row = json.loads(line)
        request = row["label"].get("request")
        if request in known:
            tied.setdefault(request, []).append(row)
        else:
            orphans += 1
    return {request: tuple(rows) for request, rows in tied.items()}, orphans


def summary_lines(day: DayRecord) -> list[str]:
    """Return one page about the day, for a terminal of 80 columns or more."""
    names = {t.id: t.name for t in day.asked.targets}
    spent = ", ".join(f"{stage} {seconds:.1f} s" for stage, seconds in day.seconds.items() if seconds >= 0.05)
    return [
        "",
        *_plan_lines(day, names),
        *_run_lines(day, names),
        "",
        *_request_lines(day, names),
        "",
        f"  {spent}",
        f"  artefacts in {day.folder}",
        *([f"  {undrawn()}"] if undrawn() else []),
    ]


def _plan_lines(day: DayRecord, names: Mapping[str, str]) -> Iterator[str]:
    asked, plan, limits = day.asked, day.plan, day.asked.limits
    yield (
        f"{asked.refs['terrain']}: {len(asked.targets)} targets, {len(asked.requests)} observation requests, "
        f"{limits.time_s / 3600:g} h, {limits.energy_j / 3600:.0f} Wh"
    )
    yield (
        f"  plan      {plan.expected_utility:.2f} expected, no policy earns more than {plan.upper:.2f}; "
        f"{plan.branches} branch options"
    )
    for option in _options(day.tree["plan"]):
        yield f"              {option.get('p_taken', 0.0):6.1%}  if {describe_when(option['when'], names)}"


def _run_lines(day: DayRecord, names: Mapping[str, str]) -> Iterator[str]:
    run = day.flight.outcome
    if day.fault is not None:
        target = day.fault["target"]
        yield f"  injected  track of {names[target]} ({target}) lost at {day.fault['at_s']:.0f} s"
    energy = day.flight.samples[-1].energy_used_j if day.flight.samples else 0.0
    taken = ", ".join(day.flight.options_taken()) or "none"
    yield (
        f"  dry run   {run.outcome or 'unfinished'} after {(run.end_s or 0.0) / 3600:.2f} h, "
        f"{energy / 3600:.0f} Wh, utility {run.utility:g}; branches taken: {taken}"
    )


def _request_lines(day: DayRecord, names: Mapping[str, str]) -> Iterator[str]:
    refused = {r.request_id: r.reason for r in day.prepared.refused}
    yield f"  {'request':<9}{'target':<18}{'instrument':<12}{'value':>6}   what came back"
    for request in day.asked.requests:
        rows = day.products.get(request.id, ())
        files = ", ".join(Path(row["path"]).name for row in rows)
        target = f"{names[request.target_id]} {request.target_id}"
        came = files or refused.get(request.id, "nothing")
        yield f"  {request.id:<9}{target:<18}{request.instrument:<12}{request.value:>6g}   {came}"
    if day.orphans:
        yield f"  {day.orphans} products match no request"


def _options(steps: Sequence[StepDocument]) -> Iterator[OptionDocument]:
    for step in steps:
        for option in step["options"] if step["op"] == "branch" else ():
            yield option
            yield from _options(option["plan"])
