"""Campaigns from the outside: the same bytes however they are flown, and every row flies again."""

from __future__ import annotations

import csv
import hashlib
import json
import os
import signal
import subprocess
import sys
import time
from collections.abc import Callable
from dataclasses import replace
from pathlib import Path
from typing import Any

import pytest

from executive.runtime.run import run_plan
from ground.campaigns.case import Case
from ground.campaigns.compare import compare, result_in
from ground.campaigns.conduct import Conduct, Plan, make_order
from ground.campaigns.engines import Engine, HereEngine, PoolEngine
from ground.campaigns.folder import CampaignFolder
from ground.campaigns.inputs import read_case
from ground.campaigns.pilot import pilot_of, replay_row
from ground.campaigns.report import _parts, report_page
from ground.campaigns.result import RESULTS, CampaignResult, Frequency, Interval
from ground.campaigns.variant import NamedCase, Variant, varied
from ground.errors import GroundError, InvalidInputError
from rover_iface.simulator.abstract_rover import make_rover
from tests.ground.campaigns.small import CRL, write_small
from tests.rover_iface.worlds import small_problem

ROOT = Path(__file__).resolve().parents[3]


@pytest.fixture
def case(tmp_path: Path) -> Case:
    return read_case(*write_small(tmp_path), "abstract")


def fly(
    case: Case, out: Path, runs: int = 250, *, engine: Engine | None = None, resume: bool = False, **more: Any
) -> CampaignResult:
    until_se = more.pop("until_se", None)
    order = make_order(case, more.pop("seed", 1), **more)
    folder = CampaignFolder(out)
    folder.open(order, resume=resume)
    result = Conduct(folder, order, Plan(runs, until_se)).run(engine or HereEngine())
    assert result is not None
    return result


def contents(folder: Path) -> dict[str, bytes]:
    return {
        p.relative_to(folder).as_posix(): p.read_bytes() for p in sorted(folder.rglob("*")) if p.is_file()
    }


def test_a_row_says_what_the_run_by_itself_does(case: Case, tmp_path: Path) -> None:
    fly(case, tmp_path / "c", 120)
    rows = list(csv.DictReader((tmp_path / "c" / "runs.csv").open()))
    assert [int(r["seed"]) for r in rows] == list(range(1, 121))
    for row in rows[::17]:
        rover = make_rover(small_problem(), seed=int(row["seed"]))
        outcome = run_plan(CRL, rover)
        chosen = [r.arguments[1] for r in outcome.trace if r.event == "choose"]
        assert float(row["utility"]) == outcome.utility
        assert row["outcome"] == outcome.outcome
        assert row["end_s"] == f"{outcome.end_s:.3f}"
        assert float(row["energy_used_j"]) == pytest.approx(rover.energy_used_j, abs=1e-3)
        assert row["options"] == ";".join(chosen)


def test_any_row_replays_into_a_folder_whose_trace_is_the_one_counted(case: Case, tmp_path: Path) -> None:
    fly(case, tmp_path / "c", 30)
    folder = CampaignFolder(tmp_path / "c")
    for seed in (1, 14, 30):
        counted = folder.row(seed)
        replay_row(case, counted, tmp_path / f"run-{seed}")
        trace = (tmp_path / f"run-{seed}" / "trace.jsonl").read_bytes()
        assert hashlib.sha256(trace).hexdigest()[:16] == counted.trace
        run = json.loads((tmp_path / f"run-{seed}" / "run.json").read_text())
        assert (run["format"], run["utility"], run["seed"]) == ("run/1", counted.utility, seed)
        assert (tmp_path / f"run-{seed}" / "journal.jsonl").stat().st_size > 1000


def test_a_plan_that_asks_for_products_replays_as_it_was_counted(tmp_path: Path) -> None:
    plan, world = write_small(tmp_path)
    asked = "(database (:result look-T1 products >= 1))"
    plan.write_text(CRL.replace("(database (:time < 800))", asked))
    case = read_case(plan, world, "abstract")
    fly(case, tmp_path / "c", 20)
    row = CampaignFolder(tmp_path / "c").row(3)
    assert row.options == ("stay",)
    assert replay_row(case, row, tmp_path / "run") == row


def test_a_row_of_another_program_does_not_replay(case: Case, tmp_path: Path) -> None:
    row = replace(pilot_of(case).row(1), trace="0" * 16)
    with pytest.raises(GroundError, match=r"seed 1 does not replay: trace [0-9a-f]{16}.*counted was 0{16}"):
        replay_row(case, row, tmp_path / "run")


def test_one_worker_and_a_pool_leave_the_same_bytes(case: Case, tmp_path: Path) -> None:
    cases = [NamedCase("more", varied(Variant("more", add_time_s=300.0), case))]
    fly(case, tmp_path / "one", 250, variants=cases, help_runs=100)
    fly(case, tmp_path / "pool", 250, variants=cases, help_runs=100, engine=PoolEngine(2))
    assert contents(tmp_path / "one") == contents(tmp_path / "pool")


def test_a_killed_campaign_goes_on_to_the_same_bytes(case: Case, tmp_path: Path) -> None:
    plan, world = write_small(tmp_path)
    fly(case, tmp_path / "whole", 1500)
    command = [
        *(sys.executable, "-m", "ground.cli", "campaign", "run", str(plan), "--world", str(world)),
        *("--runs", "1500", "--seed", "1", "--help-runs", "0", "--out", str(tmp_path / "broken")),
    ]
    units = tmp_path / "broken" / "units"
    process = subprocess.Popen(command, cwd=ROOT, stdout=subprocess.DEVNULL)
    for _ in range(6000):
        if len(list(units.glob("*.jsonl"))) >= 3:
            break
        time.sleep(0.01)
    process.send_signal(signal.SIGKILL)
    process.wait()
    before = {p.name: p.stat().st_mtime_ns for p in units.glob("*.jsonl")}
    assert 3 <= len(before) < 15
    last = sorted(units.glob("*.jsonl"))[-1]
    last.write_bytes(last.read_bytes()[:-20])  # and a torn one, as after a loss of power
    done = subprocess.run([*command, "--resume"], cwd=ROOT, capture_output=True, text=True, check=False)
    assert done.returncode == 0, done.stderr
    assert contents(tmp_path / "broken") == contents(tmp_path / "whole")
    kept = {p.name: p.stat().st_mtime_ns for p in units.glob("*.jsonl")}
    assert all(kept[name] == at for name, at in before.items() if name != last.name)


class _Killer(PoolEngine):
    """A pool of which a process dies after the third unit."""

    def fly(self, cases: Any, units: Any, should_stop: Any) -> Any:
        import multiprocessing

        for count, found in enumerate(super().fly(cases, units, should_stop)):
            if count == 2:
                os.kill(multiprocessing.active_children()[0].pid or 0, signal.SIGKILL)
            yield found


def test_a_worker_that_dies_costs_its_units_and_nothing_else(case: Case, tmp_path: Path) -> None:
    fly(case, tmp_path / "one", 700)
    fly(case, tmp_path / "killed", 700, engine=_Killer(2))
    assert contents(tmp_path / "one") == contents(tmp_path / "killed")


def test_more_runs_of_the_same_campaign_keep_those_that_are_there(case: Case, tmp_path: Path) -> None:
    fly(case, tmp_path / "whole", 450)
    fly(case, tmp_path / "grown", 130)
    fly(case, tmp_path / "grown", 450, resume=True)
    assert contents(tmp_path / "grown") == contents(tmp_path / "whole")


def test_fewer_runs_of_the_same_campaign_count_the_first_and_keep_all(case: Case, tmp_path: Path) -> None:
    more = [NamedCase("more", varied(Variant("more", add_time_s=300.0), case))]
    fly(case, tmp_path / "whole", 130, variants=more)
    fly(case, tmp_path / "shrunk", 450, variants=more)
    before = contents(tmp_path / "shrunk")
    fly(case, tmp_path / "shrunk", 130, resume=True, variants=more)
    units = [name for name in before if "units/" in name]
    after, whole = contents(tmp_path / "shrunk"), contents(tmp_path / "whole")
    assert all(after[name] == before[name] for name in units)
    results = [name for name in whole if "units/" not in name]
    assert {name: after[name] for name in results} == {name: whole[name] for name in results}
    fly(case, tmp_path / "other", 130, seed=1, variants=more)
    found = compare(CampaignFolder(tmp_path / "other"), CampaignFolder(tmp_path / "shrunk"))
    assert (found.difference.runs, found.difference.mean) == (130, 0.0)


def test_a_variant_of_the_same_name_is_refused_also_when_it_was_not_asked_for_between(
    case: Case, tmp_path: Path
) -> None:
    def one(**change: Any) -> list[NamedCase]:
        return [NamedCase("v", varied(Variant("v", **change), case))]

    fly(case, tmp_path / "c", 60, variants=one(add_time_s=300.0))
    fly(case, tmp_path / "c", 60, resume=True)
    digests = r"its digest is [0-9a-f]{12}, this one's [0-9a-f]{12}"
    with pytest.raises(GroundError, match="variants/v holds the runs of another variant.*" + digests):
        fly(case, tmp_path / "c", 60, resume=True, variants=one(add_time_s=600.0))
    again = fly(case, tmp_path / "c", 60, resume=True, variants=one(add_time_s=300.0))
    assert [v.name for v in again.variants] == ["v"]
    order = tmp_path / "c" / "order.json"
    document = json.loads(order.read_text())
    document["series"] = document["series"][:1]  # as a version before this one left it
    order.write_text(json.dumps(document))
    with pytest.raises(GroundError, match=r"variants/v holds runs of which order.json says nothing"):
        fly(case, tmp_path / "c", 60, resume=True, variants=one(add_time_s=600.0))


@pytest.mark.parametrize(
    "spoil",
    [
        lambda line: line[: len(line) // 2],
        lambda line: line.replace("[50,", "[51,"),
        lambda line: line.replace("[50,", '["50",'),
        lambda line: line + "\n" + line,
    ],
)
def test_a_unit_with_a_damaged_row_in_its_middle_is_flown_again(
    case: Case, tmp_path: Path, spoil: Callable[[str], str]
) -> None:
    fly(case, tmp_path / "c", 200)
    before = contents(tmp_path / "c")
    unit = tmp_path / "c" / "units" / "000000.jsonl"
    lines = unit.read_text().splitlines()
    lines[49] = spoil(lines[49])
    unit.write_text("\n".join(lines) + "\n")
    fly(case, tmp_path / "c", 200, resume=True)
    assert contents(tmp_path / "c") == before


def test_the_stop_rule_gives_the_same_runs_on_every_engine(case: Case, tmp_path: Path) -> None:
    here = fly(case, tmp_path / "here", 4000, until_se=0.15)
    pool = fly(case, tmp_path / "pool", 4000, until_se=0.15, engine=PoolEngine(2))
    assert here == pool
    assert 200 <= here.runs < 4000
    assert here.utility.standard_error <= 0.15
    assert here.stopped == "the standard error is at most 0.15"
    shorter = fly(case, tmp_path / "shorter", here.runs - 100)
    assert shorter.utility.standard_error > 0.15
    counted, ahead = contents(tmp_path / "here"), contents(tmp_path / "pool")
    assert counted == {name: ahead[name] for name in counted}
    beyond = sorted(set(ahead) - set(counted))  # what the pool had on the way stays, and does not count
    assert all(name.startswith("units/") for name in beyond)
    assert [row.seed for row in CampaignFolder(tmp_path / "pool").rows(runs=here.runs)][-1] == here.runs


def test_variants_share_their_futures(case: Case, tmp_path: Path) -> None:
    same = varied(Variant("same"), case)
    assert same == case
    half = varied(Variant("half", loss_factor=0.5), case)
    more = varied(Variant("more", add_time_s=5000.0, add_energy_j=1e6), case)
    for seed in range(1, 120):
        a, b = pilot_of(case).row(seed), pilot_of(half).row(seed)
        assert set(b.lost) <= set(a.lost) or a.options != b.options
        c = pilot_of(more).row(seed)
        assert c.exceeded == ()
        assert c.utility >= a.utility


def test_comparison_of_the_same_seeds_is_in_pairs(case: Case, tmp_path: Path) -> None:
    half = varied(Variant("half", loss_factor=0.5), case)
    fly(case, tmp_path / "a", 600)
    fly(half, tmp_path / "b", 600)
    fly(half, tmp_path / "c", 600, seed=10_001)
    a, b, c = (CampaignFolder(tmp_path / n) for n in "abc")
    pairs, apart = compare(a, b), compare(a, c)
    assert (pairs.paired, apart.paired) == (True, False)
    means = [result_in(f).utility.mean for f in (a, b, c)]
    assert pairs.difference.mean == pytest.approx(means[1] - means[0])
    assert apart.difference.mean == pytest.approx(means[2] - means[0])
    assert pairs.difference.standard_error < apart.difference.standard_error
    assert pairs.difference.better + pairs.difference.worse > 0


def test_what_is_written_keeps_to_the_published_schema(case: Case, tmp_path: Path) -> None:
    import jsonschema

    fly(case, tmp_path / "c", 150, help_runs=50)
    published = ROOT / "docs/formats/campaign-1.schema.json"
    if os.environ.get("OUTCROP_WRITE_SCHEMAS"):
        published.write_text(json.dumps(RESULTS.schema(), indent=1) + "\n", encoding="utf-8")
    schema = json.loads(published.read_text(encoding="utf-8"))
    assert schema == json.loads(json.dumps(RESULTS.schema()))
    document = json.loads((tmp_path / "c" / "campaign.json").read_text())
    jsonschema.validate(document, schema)
    assert document["digest"] == hashlib.sha256((tmp_path / "c" / "runs.csv").read_bytes()).hexdigest()
    assert sum(document["outcomes"].values()) == document["runs"] == 150


def test_a_run_takes_less_than_two_kilobytes(case: Case, tmp_path: Path) -> None:
    fly(case, tmp_path / "c", 500)
    assert sum(len(c) for c in contents(tmp_path / "c").values()) / 500 < 2000


def test_the_report_is_one_file_that_loads_nothing(case: Case, tmp_path: Path) -> None:
    result = fly(case, tmp_path / "c", 300, help_runs=50)
    text = report_page(CampaignFolder(tmp_path / "c"), result)
    assert "http" not in text.replace("http://www.w3.org/2000/svg", "")
    assert "<script" not in text
    for word in ("touch-T2", "stay", "What would help most", "Convergence", f"{result.utility.mean:.3f}"):
        assert word in text
    result = replace(result, frequencies=(Frequency("option option-1", 3, 0.01, Interval(0.0, 0.02), 0.5),))
    told = "".join(_parts(result, "", {"option-1": "((database (:time < 800)))"}))
    assert "<td>option-1</td><td>((database (:time &lt; 800)))</td>" in told
    assert "50.00% (outside)" in told
    assert "(outside): the prediction lies outside the interval" in told


@pytest.mark.parametrize(
    ("change", "message"),
    [
        ({"seed": 2}, "the seed differs"),
        ({"world": {"loss_factor": 0.5}}, "the world differs"),
        ({"world": {"add_time_s": 5.0}}, "the plan differs"),
    ],
)
def test_the_folder_of_another_campaign_is_refused_by_digest(
    case: Case, tmp_path: Path, change: dict[str, Any], message: str
) -> None:
    fly(case, tmp_path / "c", 20)
    before = contents(tmp_path / "c")
    other = varied(Variant("v", **change.get("world", {})), case)
    with pytest.raises(GroundError, match=r"holds another campaign: its digest is [0-9a-f]{12}.*" + message):
        fly(other, tmp_path / "c", 20, resume=True, seed=change.get("seed", 1))
    with pytest.raises(GroundError, match="--resume goes on with it"):
        fly(case, tmp_path / "c", 20)
    assert contents(tmp_path / "c") == before


def test_a_full_disk_leaves_what_is_there_valid(
    case: Case, tmp_path: Path, monkeypatch: pytest.MonkeyPatch
) -> None:
    whole = Path.replace
    calls = []

    def full(self: Path, target: Path) -> Path:
        calls.append(target)
        if len(calls) > 3:
            raise OSError(28, "No space left on device", str(target))
        return whole(self, target)

    fly(case, tmp_path / "whole", 500)
    monkeypatch.setattr(Path, "replace", full)
    with pytest.raises(OSError, match="No space left"):
        fly(case, tmp_path / "c", 500)
    monkeypatch.undo()
    assert not list((tmp_path / "c").rglob("*.draft"))
    fly(case, tmp_path / "c", 500, resume=True)
    assert contents(tmp_path / "c") == contents(tmp_path / "whole")


def test_seeds_that_overlap_in_part_are_refused(case: Case, tmp_path: Path) -> None:
    fly(case, tmp_path / "a", 40)
    fly(case, tmp_path / "b", 40, seed=21)
    with pytest.raises(InvalidInputError, match=r"overlap in part: .*a has 1 to 40.*b 21 to 60"):
        compare(CampaignFolder(tmp_path / "a"), CampaignFolder(tmp_path / "b"))
