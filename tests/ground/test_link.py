"""What the ground knows when: light time, passes, volume; and commands that come late."""

from __future__ import annotations

import json
from pathlib import Path

import pytest
from hypothesis import given
from hypothesis import strategies as st
from typer.testing import CliRunner

from ground.cli.main import app, register_all
from ground.errors import InvalidInputError
from ground.resources.reports.report_run import known_on_the_ground
from ground.resources.runs.order import ORDERS
from ground.resources.runs.trace_value import Trace
from ground.uplink.execute import Place, execute_package
from ground.uplink.link import Link, Pass, read_passes
from ground.uplink.rehearsal import GROUND_VIEW, Sent
from tests.ground.test_execute import site as site

TWO = (Pass("noon", 100.0, 200.0, 50.0), Pass("dusk", 1000.0, 1100.0, 200.0))


def test_a_command_is_held_until_it_arrives_in_a_pass() -> None:
    link = Link(60.0, TWO)
    assert [link.command_arrives_s(t) for t in (0.0, 40.0, 100.0, 141.0, 1040.0, 1041.0)] == [
        100.0,
        100.0,
        160.0,
        1000.0,
        1100.0,
        None,
    ]
    assert Link(60.0).command_arrives_s(5.0) == 65.0


def test_a_record_is_known_a_light_time_after_there_is_contact() -> None:
    link = Link(60.0, TWO)
    assert [link.record_known_s(t) for t in (0.0, 150.0, 300.0, 1200.0)] == [160.0, 210.0, 1060.0, None]


def test_products_share_the_volume_of_the_passes_in_the_order_in_which_they_were_made() -> None:
    link = Link(60.0, TWO)  # half a megabit a second at noon, two at dusk
    # by hand: 30 Mbit take 60 s of the first pass; of 40 Mbit 20 go in its rest and 20 take 10 s of the next
    assert link.products_known_s([(50.0, 40.0), (0.0, 30.0)]) == [1000.0 + 10.0 + 60.0, 160.0 + 60.0]
    assert link.products_known_s([(0.0, 300.0), (1.0, 1.0)]) == [None, None]
    assert Link(60.0).products_known_s([(5.0, 1e6)]) == [65.0]


@given(
    st.lists(st.tuples(st.floats(0.0, 1200.0), st.floats(0.0, 60.0)), max_size=12),
    st.floats(0.0, 1300.0),
)
def test_nothing_is_known_early_and_no_pass_brings_more_than_it_can(
    products: list[tuple[float, float]], light_s: float
) -> None:
    link = Link(light_s, TWO)
    known = link.products_known_s(products)
    for (made_s, _), at in zip(products, known, strict=True):
        if at is not None:
            assert link.contact_s(at - light_s - 1e-6) is not None
            assert at >= made_s + light_s
    for k, one in enumerate(TWO):
        until = sum(v for (_, v), at in zip(products, known, strict=True) if at and at - light_s <= one.end_s)
        assert until <= sum(p.data_mbit for p in TWO[: k + 1]) + 1e-6


@pytest.mark.parametrize(
    ("light_s", "passes", "word"),
    [
        (-1.0, (), "light time"),
        (float("nan"), (), "light time"),
        (0.0, (Pass("a", 5.0, 5.0, 1.0),), "'a' ends at 5 s"),
        (0.0, (Pass("a", 5.0, 9.0, -1.0),), "-1 Mbit"),
        (0.0, (Pass("a", 5.0, 9.0, 1.0), Pass("b", 8.0, 10.0, 1.0)), "before 'a' ends"),
    ],
)
def test_a_link_that_cannot_be_is_refused(light_s: float, passes: tuple[Pass, ...], word: str) -> None:
    with pytest.raises(InvalidInputError, match=word):
        Link(light_s, passes)


def test_passes_come_from_a_list_or_a_sol(tmp_path: Path) -> None:
    rows = [{"name": p.name, "start_s": p.start_s, "end_s": p.end_s, "data_mbit": p.data_mbit} for p in TWO]
    path = tmp_path / "passes.json"
    for document in (rows, {"number": 1, "passes": rows}):
        path.write_text(json.dumps(document))
        assert read_passes(path) == TWO
    for wrong in ("{", "{}", '[{"start_s": 1}]', "[3]"):
        path.write_text(wrong)
        with pytest.raises(InvalidInputError, match="pass"):
            read_passes(path)


@pytest.mark.parametrize("text", ["abort", "abort@", "replace@3", "land@3", "abort@-1", "abort@inf"])
def test_a_command_that_cannot_be_sent_is_refused(text: str) -> None:
    with pytest.raises(InvalidInputError, match="abort@SECONDS"):
        Sent.parse(text)


def test_a_rehearsal_runs_the_same_and_is_known_later(site: tuple[Path, Place], tmp_path: Path) -> None:
    package, place = site
    _, plain = execute_package(package, place, tmp_path / "plain")
    for ledger in place.world.glob("executed*"):  # another rover of the same kind
        ledger.unlink()
    passes = (Pass("late", 10_000.0, 10_100.0, 100.0),)
    link = Link(600.0, passes)
    _, flight = execute_package(
        package, place, tmp_path / "run", link=link, commands=[Sent.parse("abort@9e5")]
    )
    assert flight.outcome.trace == plain.outcome.trace
    assert flight.document == plain.document
    view = json.loads((tmp_path / "run" / GROUND_VIEW).read_text())
    assert view["end_known_s"] == 10_600.0
    assert [t for t, _, _ in view["records"]] == [r.t_ms / 1000 for r in flight.outcome.trace]
    assert {known for _, _, known in view["records"]} == {10_600.0}
    assert [p["path"] for p in view["products"]] == [p.path for p in flight.outcome.products]
    assert all(10_600.0 < p["known_s"] <= 10_700.0 for p in view["products"])
    assert view["commands"] == [{"operation": "abort", "sent_s": 9e5, "heard_s": None}]


def test_an_abort_acts_when_the_rover_hears_it(site: tuple[Path, Place], tmp_path: Path) -> None:
    package, place = site
    link = Link(3.0, (Pass("soon", 7.5, 100.0, 1.0),))
    _, flight = execute_package(package, place, tmp_path / "run", link=link, commands=[Sent.parse("abort@1")])
    view = json.loads((tmp_path / "run" / GROUND_VIEW).read_text())
    assert view["commands"] == [{"operation": "abort", "sent_s": 1.0, "heard_s": 7.5}]
    assert flight.outcome.outcome == "ABORTED"
    assert [r.t_ms for r in flight.outcome.trace if r.event == "abort"] == [7500]


def test_the_command_line_rehearses_and_refuses_in_one_line(site: tuple[Path, Place], tmp_path: Path) -> None:
    package, place = site
    passes = tmp_path / "passes.json"
    passes.write_text('[{"start_s": 7.5, "end_s": 100, "data_mbit": 1}]')
    words = ["execute", str(package), "--world", str(place.world), "--trust", str(place.trust)]
    words += ["--out", str(tmp_path / "run"), "--seed", "5", "--light-time", "3"]
    if not app.registered_groups:
        register_all()
    refused = CliRunner().invoke(app, [*words, "--command", "land@1"])
    assert refused.exit_code == 2
    assert "'land@1' is not a command" in refused.output
    done = CliRunner().invoke(app, [*words, "--passes", str(passes), "--command", "abort@1"])
    assert (done.exit_code, "ABORTED after 8 s" in done.output) == (1, True), done.output
    view = json.loads((tmp_path / "run" / GROUND_VIEW).read_text())
    assert view["end_known_s"] == 10.5


def test_an_order_that_was_stored_when_its_link_was_a_plain_document_is_read() -> None:
    held = {
        "light_time_s": 60,
        "passes": [{"name": "noon", "start_s": 100, "end_s": 200.0, "data_mbit": 50.0}],
    }
    folders = {"run_dir": "runs/run-1", "files_dir": "files", "terrain_dir": "terrains/trn-1"}
    plan = {"run_id": "run-1", "crl_text": "", "problem": {}, "rover": "abstract", "seed": 1}
    stored = {"format": "run-order/1", **folders, **plan, "link": held}
    assert ORDERS.from_document(stored).link == Link(60.0, TWO[:1])
    assert ORDERS.document(ORDERS.from_document(stored))["link"] == held
    assert ORDERS.from_document({**stored, "link": None}).link is None


@pytest.mark.parametrize("text", ["", "[]", "{}", '{"format": "ground-view/1"}', "\xff"])
def test_a_foreign_view_counts_for_nothing(text: str, tmp_path: Path) -> None:
    path = tmp_path / GROUND_VIEW
    path.write_bytes(text.encode("latin-1"))
    trace = Trace("R", "SUCCEEDED", 1.0, [])
    assert known_on_the_ground(path, trace) == []
    assert known_on_the_ground(tmp_path / "none", trace) == []
