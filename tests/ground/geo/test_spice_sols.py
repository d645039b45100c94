"""A sol's sun from the service's kernels, and the command that tells it."""

from __future__ import annotations

import json
from dataclasses import replace
from datetime import UTC, datetime, timedelta
from pathlib import Path

import numpy as np
import pytest
from typer.testing import CliRunner

from ground.cli.main import app, register_all
from ground.errors import InvalidInputError, StateError
from ground.geo.place import Place
from ground.geo.spice_site import spice_site
from ground.resources.missions.row import MissionRow
from ground.resources.problems.mission_day import choose_sol, mission_day
from ground.resources.sols.sol_sky import sol_sky
from ground.settings import SettingsError, load_settings
from mission import Sky
from neighbours.geodata.spice_sky import look
from tests.ground.conftest import Api, yard
from tests.neighbours.geodata.orbits import write_spk
from tests.neighbours.geodata.test_spice_sky import LSK, seconds
from tests.shared import needed

spiceypy = needed("spiceypy")
START = datetime(2025, 3, 1, 4, tzinfo=UTC)
JEZERO = {"crs": "IAU_2015:49900", "x": 77.45, "y": 18.44}


@pytest.fixture
def kernels(tmp_path: Path) -> list[Path]:
    path = tmp_path / "orbits.bsp"
    write_spk(spiceypy, path, seconds(START), seconds(START) + 2 * 86400.0)
    return [LSK, path]


def test_a_sol_with_kernels_place_and_start_has_the_sun_of_spice(
    sqlite_api: Api, terrain_folder: Path, kernels: list[Path]
) -> None:
    mission = yard(sqlite_api.repo, terrain_folder).id
    told = replace(
        sqlite_api.repo,
        settings=sqlite_api.repo.settings.model_copy(update={"spice_kernels": ",".join(map(str, kernels))}),
    )
    with sqlite_api.repo.database.write() as session:
        row = session.get_one(MissionRow, mission)
        sol = choose_sol(session, mission, None)
        plain = Sky(start_lmst_h=sol.start_lmst_h)
        assert sol_sky(told, session, sol) == plain  # neither place nor start
        row.place, sol.start_utc = JEZERO, START
        assert sol_sky(sqlite_api.repo, session, sol) == plain  # no kernels
        sky = sol_sky(told, session, sol)
        assert mission_day(told, session, row, sol).sky == sky
        offsets = np.linspace(0.0, sol.time_budget_s, 7)
        site = spice_site(Place(**JEZERO))
        seen = look(kernels, site, [START + timedelta(seconds=float(t)) for t in offsets])
        ours = np.array([sky.clock().direction(float(t)) for t in offsets])
        assert np.abs(ours - seen.sun).max() < 1e-6
        sol.start_utc = datetime(2044, 1, 1, tzinfo=UTC)
        with pytest.raises(StateError, match="OUTCROP_SPICE_KERNELS does not say"):
            sol_sky(told, session, sol)


def test_a_latitude_on_the_sphere_of_mars_becomes_planetographic() -> None:
    assert spice_site(Place("IAU_2015:49900", 77.45, 45.0)).latitude_deg == pytest.approx(45.338, abs=1e-3)
    assert spice_site(Place("IAU_2015:30100", 31.0, -84.6)).latitude_deg == pytest.approx(-84.6)
    assert spice_site(Place("EPSG:4326", 10.0, 45.0)).body == "EARTH"
    with pytest.raises(InvalidInputError, match="known are EARTH, MARS, MOON"):
        spice_site(Place("IAU_2015:19900", 10.0, 45.0))


def test_a_kernel_that_is_not_there_is_named_at_the_start() -> None:
    with pytest.raises(SettingsError, match=r"OUTCROP_SPICE_KERNELS.*there is no kernel 'no\.tls'"):
        load_settings(spice_kernels="no.tls")


def test_the_command_tells_sun_earth_and_light_time(kernels: list[Path], tmp_path: Path) -> None:
    register_all()
    where = ["--longitude", "77.45", "--latitude", "18.44", "--utc", "2025-03-01T04:00:00", "--count", "3"]
    result = CliRunner().invoke(
        app, ["sky", *map(str, kernels), *where, "--json", str(tmp_path / "sky.json")]
    )
    assert result.exit_code == 0, result.output
    lines = json.loads((tmp_path / "sky.json").read_text())
    assert [line["utc"] for line in lines][2] == "2025-03-01T06:00:00+00:00"
    assert all(line["formula_off_deg"] < 0.03 for line in lines)
    assert 300 < lines[0]["light_time_s"] < 600
    wrong = CliRunner().invoke(app, ["sky", str(LSK), *where])
    assert wrong.exit_code == 2
    assert "the kernels do not tell it" in wrong.output
