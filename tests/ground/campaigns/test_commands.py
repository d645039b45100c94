"""Bad input of the campaign commands: one line that names the thing, exit status 2, no traceback."""

from __future__ import annotations

import json
from pathlib import Path

import pytest
from typer.testing import CliRunner

from ground.cli.main import app, register_all
from tests.ground.campaigns.small import CRL, write_small
from tests.rover_iface.worlds import small_problem

register_all()


def outcrop(*arguments: object) -> tuple[int, str]:
    done = CliRunner().invoke(app, [str(a) for a in arguments])
    assert done.exception is None or isinstance(done.exception, SystemExit), done.exception
    return done.exit_code, done.stderr.strip()


def run(plan: Path, world: Path, *more: object) -> tuple[int, str]:
    return outcrop(
        "campaign",
        "run",
        plan,
        "--world",
        world,
        "--runs",
        20,
        "--help-runs",
        0,
        "--out",
        plan.parent / "c",
        *more,
    )


def vary(folder: Path, *variants: object) -> tuple[int, str]:
    plan, world = write_small(folder)
    file = folder / "vary.json"
    file.write_text(json.dumps({"format": "campaign-variants/1", "variants": list(variants)}))
    return run(plan, world, "--vary", file)


@pytest.mark.parametrize(
    ("more", "message"),
    [
        (("--rover", "hopper"), 'unknown rover "hopper"'),
        (("--runs", 0), "--runs is 0; it must be 1 to 10000000"),
        (("--seed", -1), "--seed is -1; it must be at least 0"),
        (("--workers", 0), "--workers is 0; it must be 1 to 256"),
        (("--engine", "ray"), '--engine is "ray"; it must be pool or dask'),
        (("--engine", "dask"), "--engine dask needs"),
        (("--until-se", 0), "--until-se is 0; it must be more than 0"),
    ],
)
def test_a_wrong_option_is_told_in_a_line(
    tmp_path: Path, more: tuple[object, ...], message: str, monkeypatch: pytest.MonkeyPatch
) -> None:
    monkeypatch.delenv("OUTCROP_DASK_SCHEDULER", raising=False)
    code, told = run(*write_small(tmp_path), *more)
    assert (code, told.count("\n")) == (2, 0), told
    assert message in told
    assert not (tmp_path / "c").exists()


@pytest.mark.parametrize(
    ("variant", "message"),
    [
        ({"name": "a", "bugdet": 1}, "variants[0].bugdet is not a known member"),
        ({"name": "a/b"}, 'variant name "a/b"'),
        ({"name": "a", "loss_factor": -1}, "loss_factor is -1; it must be at least 0"),
        ({"name": "a", "add_time_s": -2300}, "the budget of time is 2300; -2300 leaves nothing"),
        ({"name": "a", "soil": {"slip_flat": 0.2}}, 'the abstract rover has no "soil"'),
        ({"name": "a", "plan": "none.crl"}, "none.crl: No such file or directory"),
        ({"name": "a", "faults": [{"kind": "flood", "at_s": 1}]}, "flood"),
    ],
)
def test_a_wrong_variant_is_told_in_a_line(tmp_path: Path, variant: object, message: str) -> None:
    code, told = vary(tmp_path, variant)
    assert (code, told.count("\n")) == (2, 0), told
    assert message in told


def test_two_variants_of_one_name_are_refused(tmp_path: Path) -> None:
    code, told = vary(tmp_path, {"name": "a"}, {"name": "a"})
    assert (code, told.endswith('the variant name "a" is given 2 times')) == (2, True)


def test_the_world_of_another_plan_is_refused(tmp_path: Path) -> None:
    plan, world = write_small(tmp_path)
    plan.write_text(CRL.replace("T2", "T7"))
    code, told = run(plan, world)
    assert (code, told.count("\n")) == (2, 0)
    assert "is the world of another plan: task track-T2" not in told
    assert "needs target T7; the world has T1, T2" in told


def test_the_problem_of_another_plan_is_refused_by_digest(tmp_path: Path) -> None:
    plan, world = write_small(tmp_path)
    (tmp_path / "plan_tree.json").write_text(json.dumps({"problem_sha256": "ab" * 32, "plan": []}))
    world.write_text(json.dumps(small_problem()))
    code, told = run(plan, world)
    assert code == 2
    assert "is the world of another plan: its problem is " in told
    assert "was made for abababababab" in told
    assert run(plan, world, "--any-world")[0] == 0


@pytest.mark.parametrize(
    ("spoil", "message"),
    [
        (lambda p, w: w.unlink(), "world.json: No such file or directory"),
        (lambda p, w: w.write_text("{"), "is not JSON"),
        (lambda p, w: w.write_text('{"format": "day/1"}'), 'has the format "day/1"; it must be "world/1"'),
        (lambda p, w: p.write_text("(plan"), "plan.crl: "),
        (lambda p, w: p.unlink(), "plan.crl: No such file or directory"),
    ],
)
def test_a_file_that_cannot_be_used_is_named(tmp_path: Path, spoil: object, message: str) -> None:
    plan, world = write_small(tmp_path)
    spoil(plan, world)  # type: ignore[operator]
    code, told = run(plan, world)
    assert (code, told.count("\n")) == (2, 0), told
    assert message in told


def test_a_folder_without_a_campaign_or_a_seed_is_told(tmp_path: Path) -> None:
    plan, world = write_small(tmp_path)
    assert outcrop("campaign", "report", tmp_path / "none") == (
        2,
        f"outcrop: {tmp_path}/none has no campaign.json: the campaign has not ended "
        "(outcrop campaign run --resume)",
    )
    assert run(plan, world)[0] == 0
    code, told = outcrop("campaign", "replay", tmp_path / "c", 99, "--out", tmp_path / "run")
    assert (code, told.endswith("has no seed 99; it holds the seeds 1 to 20")) == (2, True)
    code, told = outcrop("campaign", "replay", tmp_path / "c", 3, "--out", tmp_path / "c")
    assert (code, told.endswith("is not empty; a run begins in a folder of its own")) == (2, True)
    assert outcrop("campaign", "replay", tmp_path / "c", 3, "--out", tmp_path / "run")[0] == 0
    assert outcrop("campaign", "report", tmp_path / "c")[0] == 0
    code, told = run(plan, world)
    assert (code, told) == (2, f"outcrop: {tmp_path}/c holds a campaign; --resume goes on with it")


@pytest.mark.parametrize(
    ("event", "message"),
    [
        ("late", "a term is utility, end_s"),
        ("failed nothing", "there is no failed nothing; known are root"),
        ("end_s > 1 and lost T9", "there is no lost T9; known are T1, T2"),
        ("over money", "there is no over money; known are time, energy"),
        (
            "outcome LATE",
            "there is no outcome LATE; known are SUCCEEDED, FAILED, ABORTED, SKIPPED, UNFINISHED",
        ),
    ],
)
def test_an_event_that_cannot_be_read_is_told(tmp_path: Path, event: str, message: str) -> None:
    plan, world = write_small(tmp_path)
    code, told = outcrop("campaign", "rare", plan, "--world", world, "--event", event)
    assert (code, told.count("\n")) == (2, 0)
    assert message in told
