"""A dictionary of 200 commands that FPP's compiler made: forms, validation, a plan, a day, a sequence."""

from __future__ import annotations

import json
from pathlib import Path
from typing import Any

import pytest
from typer.testing import CliRunner

from ground.cli.main import app, register_all
from ground.resources.mission_setup.create_mission import FolderTerrain, create_mission
from ground.resources.missions.value import Mission
from tests.ground.conftest import PLANNER, Api
from tests.ground.flight.conftest import FPrime
from tests.ground.flight.fpp_model import MAP, fpp_model
from tests.ground.planning import finished, planned


@pytest.fixture(scope="session")
def dictionary(fprime: FPrime, tmp_path_factory: pytest.TempPathFactory) -> Path:
    """Give the dictionary of the 200 commands, as F Prime's compiler makes it."""
    folder = tmp_path_factory.mktemp("fpp")
    (folder / "rover.fpp").write_text(fpp_model())
    return fprime.compile(folder / "rover.fpp", folder / "out")


def run(*arguments: str | Path) -> tuple[int, str]:
    if not app.registered_groups:
        register_all()
    done = CliRunner().invoke(app, [str(a) for a in arguments])
    return done.exit_code, done.output


@pytest.fixture
def profiles(dictionary: Path, tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> Path:
    (tmp_path / "map.toml").write_text(MAP)
    folder = tmp_path / "profiles"
    code, said = run(
        *("rover", "dictionary-from", dictionary, "--name", "scout", "--out", folder),
        *("--map", tmp_path / "map.toml", "--report", tmp_path / "report.json"),
    )
    assert code == 0, said
    assert said.startswith("200 commands and 20 telemetry keys\ndefault cost of 198 commands: 15 s and 150 J")
    monkeypatch.setenv("OUTCROP_PROFILES", str(folder))
    return folder


def day(api: Api, terrain: Path) -> tuple[Mission, dict[str, Any], dict[str, Any]]:
    """Return mission, plan and requests of a day with the foreign rover."""
    source = FolderTerrain(terrain)
    mission = create_mission(api.repo, PLANNER, name="Foreign", source=source, rover_profile="scout")
    base = f"/missions/{mission.id}"
    api.post(f"{base}/sols", {})
    requests = {}
    for name, east, north, instrument in (("A", 4.0, 1.0, "toucher"), ("B", 2.0, -5.0, "spectrometer")):
        target = api.post(f"{base}/targets", {"name": name, "east_m": east, "north_m": north})
        body = {"target_id": target["id"], "instrument": instrument, "value": 10.0}
        requests[instrument] = api.post(f"{base}/observation-requests", body)
    return mission, planned(api, mission), requests


def written_as_a_sequence(crl: str, fprime: FPrime, dictionary: Path, folder: Path) -> None:
    """Let F Prime's own compiler encode the plan's main line."""
    (folder / "day.crl").write_text(crl)
    order = ("plan", "sequence", folder / "day.crl", "--dictionary", dictionary, "--map", folder / "map.toml")
    code, said = run(*order, "--out", folder / "day.seq")
    assert code == 2
    assert 'not said: maintain conditions of "root"' in said
    assert not (folder / "day.seq").exists()
    code, said = run(*order, "--out", folder / "day.seq", "--branch", "nominal")
    assert code == 0, said
    lines = [s for s in (folder / "day.seq").read_text().splitlines() if not s.startswith(";")]
    encoded = fprime.encode(folder / "day.seq", dictionary)
    opcodes = {c["name"]: c["opcode"] for c in json.loads(dictionary.read_text())["commands"]}
    at = 0
    for line in lines:
        command = opcodes[line.split()[1]].to_bytes(4, "big")
        at = encoded.index(command, at) + 4
    assert {line.split()[1] for line in lines} >= {"mob.DRIVE_TO", "spec.MEASURE", "arm.TOUCH", "eyes.TRACK"}
    window = encoded.index(opcodes["spec.MEASURE"].to_bytes(4, "big"))
    assert (250).to_bytes(4, "big") + (64).to_bytes(2, "big") + (48).to_bytes(2, "big") in encoded[window:]


@pytest.mark.slow
def test_two_hundred_foreign_commands_give_forms_validation_a_plan_and_a_day(
    sqlite_api: Api, profiles: Path, terrain_folder: Path, tmp_path: Path, fprime: FPrime, dictionary: Path
) -> None:
    api = sqlite_api
    rover = api.get("/rovers/scout")
    actions = {a["name"]: a for a in rover["actions"]}
    foreign = {name for name in actions if "." in name}
    assert len(foreign) == 200
    form = {p["name"]: p for p in actions["spec.MEASURE"]["parameters"]}
    assert form["gain"]["choices"] == ["LOW", "HIGH", "AUTO"]
    assert (form["exposure_ms"]["minimum"], form["exposure_ms"]["maximum"]) == (0.0, 2.0**32 - 1)
    assert {"roi.width", "roi.height"} <= form.keys()
    assert [p["name"] for p in actions["mob.MOVE_1"]["parameters"]] == ["to.0", "to.1", "to.2", "speed"]
    assert {t["key"] for t in rover["telemetry"]} > {"pwr.Level", "spec.State", "battery-energy"}
    assert {"toucher", "spectrometer"} <= {i["name"] for i in rover["instruments"]}

    mission, plan, requests = day(api, terrain_folder)
    assert set(plan["planned_request_ids"]) == {r["id"] for r in requests.values()}, plan["left_out"]
    assert [f for f in api.get(f"/plans/{plan['id']}/findings") if f["severity"] == "error"] == []
    crl = api("GET", f"/plans/{plan['id']}/crl").text
    assert ":action spec.MEASURE" in crl
    assert ":action arm.TOUCH" in crl

    order = {"plan_id": plan["id"], "seed": 4}
    job = finished(api, api.post(f"/missions/{mission.id}/runs", order, status=202))
    run_ = api.get(job["result_url"])
    assert run_["outcome"] == "SUCCEEDED"
    done = {e["arguments"][0] for e in api.get(f"/runs/{run_['id']}/trace")["events"] if e["event"] == "end"}
    assert len([task for task in done if task.startswith("observe")]) == 2, done

    written_as_a_sequence(crl, fprime, dictionary, tmp_path)

    (tmp_path / "by-hand.crl").write_text(
        "(plan :id p :node (task :id t :action mob.SET_5 :parameters (level = 300)))"
    )
    code, said = run(
        "crl", "check", tmp_path / "by-hand.crl", "--dictionary", profiles / "scout.dictionary.json"
    )
    assert code == 1
    assert "300" in said
    assert "255" in said


def broken(dictionary: Path, to: Path) -> Path:
    """Write the dictionary with three contradictions among its 200 commands."""
    document = json.loads(dictionary.read_text())
    commands = {c["name"]: c for c in document["commands"]}
    commands["pwr.SET_5"]["opcode"] = commands["pwr.SET_0"]["opcode"]
    commands["com.MODE_2"]["formalParams"][0]["type"]["name"] = "Gian"
    channel = next(c for c in document["telemetryChannels"] if c["name"] == "nav.Level")
    channel["limits"]["low"]["yellow"] = 12.5
    to.write_text(json.dumps(document))
    return to


def test_three_contradictions_are_each_named_and_nothing_is_written(dictionary: Path, tmp_path: Path) -> None:
    wrong = broken(dictionary, tmp_path / "wrong.json")
    out = tmp_path / "profiles"
    code, said = run("rover", "dictionary-from", wrong, "--name", "scout", "--out", out)
    assert code == 2
    assert "3 findings: " in said
    assert 'com.MODE_2.gain has the type "Gian", which is not defined' in said
    assert 'opcode "1280" is given 2 times' in said
    assert 'channel "nav.Level" has the limit low yellow 12.5, above its limit high red 9.0' in said
    assert not out.exists()
    good = run("rover", "dictionary-from", dictionary, "--name", "scout", "--out", out)
    before = {p.name: p.read_bytes() for p in out.iterdir()}
    assert good[0] == 0
    assert run("rover", "dictionary-from", wrong, "--name", "scout", "--out", out)[0] == 2
    assert {p.name: p.read_bytes() for p in out.iterdir()} == before
