"""The four file formats, the best-known values of the reference set, and the command."""

from __future__ import annotations

import csv
import json
from pathlib import Path

import pytest
from typer.testing import CliRunner

from ground.cli.main import app, register_all
from planner.errors import RoutingError
from planner.orienteering import read_routing_file, solve
from tests.shared import shared

OPLIB = """NAME: five
TYPE: OP
DIMENSION: 5
COST_LIMIT: 40
EDGE_WEIGHT_TYPE: EUC_2D
NODE_COORD_SECTION
1 0 0
2 10 0
3 10 10
4 0 10
5 40 40
NODE_SCORE_SECTION
1 1
2 5
3 6
4 7
5 100
DEPOT_SECTION
1
-1
EOF
"""
ROVER = {
    "name": "two",
    "format": "rover-orienteering-1",
    "time_budget": 100,
    "energy_budget": 50,
    "start_site": 0,
    "end_site": None,
    "n_sites": 2,
    "travel_time": [[0, 30], [25, 0]],
    "travel_energy": [[0, 5], [4, 0]],
    "tasks": [
        {"id": 11, "site": 1, "prize": 4, "duration": 20, "energy": 9, "earliest_start": 0, "latest_end": 90},
        {
            "id": 12,
            "site": 1,
            "prize": 8,
            "duration": 20,
            "energy": 9,
            "earliest_start": 60,
            "latest_end": 90,
        },
    ],
    "precedence": [[11, 12]],
}


def _write(folder: Path, name: str, text: str) -> Path:
    path = folder / name
    path.write_text(text, encoding="utf-8")
    return path


def test_each_format_is_read_and_routes_are_told_in_its_own_ids(tmp_path: Path) -> None:
    oplib = read_routing_file(_write(tmp_path, "five.oplib", OPLIB))
    found = solve(oplib.problem, time_limit_s=1.0)
    assert found.value == 19
    assert oplib.route_ids(found.route)[0] == 1
    assert sorted(map(int, oplib.route_ids(found.route))) == [1, 2, 3, 4]

    rover = read_routing_file(_write(tmp_path, "two.json", json.dumps(ROVER)))
    found = solve(rover.problem)
    assert (found.value, rover.route_ids(found.route), found.proven) == (12, [11, 12], True)

    classic = read_routing_file(_write(tmp_path, "c.txt", "10 1\n0 0 0\n6 8 0\n3 4 5\n0 8 9\n"))
    found = solve(classic.problem, time_limit_s=1.0)
    assert (found.value, classic.route_ids(found.route)) == (5, [1, 3, 2])

    text = "4 2 2 1\n0 200\n0 0 0 0 0 0 0 0 50\n1 3 4 10 7 1 1 1 0 4\n2 0 5 10 9 1 1 1 6 20\n"
    optw = read_routing_file(_write(tmp_path, "r.txt", text))
    found = solve(optw.problem, time_limit_s=1.0)
    assert (found.value, optw.route_ids(found.route)) == (9, [2])


def test_truncated_and_rounded_lengths_follow_the_conventions(tmp_path: Path) -> None:
    solomon = "4 2 1 1\n0 200\n0 0 0 0 0 0 0 0 50\n1 1 1 10 7 1 1 1 0 40\n"
    assert read_routing_file(_write(tmp_path, "r1.txt", solomon)).problem.travel_time[0, 1] == 14
    assert read_routing_file(_write(tmp_path, "pr1.txt", solomon)).problem.travel_time[0, 1] == 141
    att = OPLIB.replace("EUC_2D", "ATT")
    assert read_routing_file(_write(tmp_path, "a.oplib", att)).problem.travel_time[0, 1] == 4
    diagonal = read_routing_file(_write(tmp_path, "e.oplib", OPLIB)).problem.travel_time[0, 2]
    assert diagonal == 14


@pytest.mark.parametrize(
    ("name", "text", "message"),
    [
        ("x.txt", "hello", "none of the formats"),
        ("x.json", "{", "broken"),
        ("x.json", '{"format": "other"}', "format is 'other'"),
        ("x.json", json.dumps({**ROVER, "precedence": [[1, 2]]}), "names a task that is not there"),
        ("x.json", json.dumps({**ROVER, "time_budget": -4}), "time_budget is -4"),
        ("x.json", json.dumps({k: v for k, v in ROVER.items() if k != "tasks"}), "lacks 'tasks'"),
        ("x.oplib", OPLIB.replace("EUC_2D", "EUC_3D"), "EDGE_WEIGHT_TYPE is EUC_3D"),
        ("x.oplib", OPLIB.replace("5 100\n", ""), "does not name every node"),
        ("x.txt", "10 1\n0 0 0\n1 1\n", "not 'x y score'"),
    ],
)
def test_a_broken_file_is_refused_with_its_name(tmp_path: Path, name: str, text: str, message: str) -> None:
    path = _write(tmp_path, name, text)
    with pytest.raises(RoutingError, match=message) as caught:
        read_routing_file(path)
    assert name in str(caught.value)


def _runner() -> CliRunner:
    if not app.registered_commands:
        register_all()
    return CliRunner()


def test_the_command_writes_the_solution(tmp_path: Path) -> None:
    file, out = _write(tmp_path, "two.json", json.dumps(ROVER)), tmp_path / "sol.json"
    result = _runner().invoke(
        app, ["orienteering", str(file), "--out", str(out), "--time-limit", "5", "--seed", "2"]
    )
    assert result.exit_code == 0, result.output
    document = json.loads(out.read_text())
    assert document["value"] == document["upper"] == 12
    assert document["proven"] is True
    assert document["route"] == [11, 12]
    assert document["engine"] == "exact"
    assert document["wall_s"] > 0


def test_the_command_refuses_bad_input_in_one_line(tmp_path: Path) -> None:
    missing = _runner().invoke(app, ["orienteering", str(tmp_path / "no.json"), "--out", str(tmp_path / "o")])
    assert missing.exit_code == 2
    assert "no.json" in missing.output
    file = _write(tmp_path, "two.json", json.dumps(ROVER))
    limit = _runner().invoke(
        app, ["orienteering", str(file), "--out", str(tmp_path / "o"), "--time-limit", "0"]
    )
    assert limit.exit_code == 2
    assert "--time-limit is 0" in limit.output


# --------------------------------------------------------------------------- reference set


def _best() -> dict[str, dict[str, str]]:
    with shared("benchmarks/orienteering/best_known.csv").open() as lines:
        return {row["file"]: row for row in csv.DictReader(lines)}


@pytest.mark.parametrize("name", ["rover05w-s1", "rover10o-s1", "rover10w-s2", "rover20w-s2"])
def test_rover_days_are_proven_at_their_known_optimum(name: str) -> None:
    file = read_routing_file(shared(f"benchmarks/orienteering/rover/{name}.json"))
    solution = solve(file.problem, time_limit_s=60.0)
    assert solution.proven
    assert solution.value == int(_best()[f"rover/{name}.json"]["best_known"])


@pytest.mark.slow
@pytest.mark.parametrize("size", ["05", "10", "20", "30", "50"])
def test_every_rover_day_is_proven_at_its_known_optimum(size: str) -> None:
    for path in sorted(shared("benchmarks/orienteering/rover").glob(f"rover{size}*.json")):
        solution = solve(read_routing_file(path).problem, time_limit_s=120.0)
        assert solution.proven, path.name
        assert solution.value == int(_best()[f"rover/{path.name}"]["best_known"]), path.name


@pytest.mark.parametrize("name", ["r101", "c101", "rc106"])
def test_time_window_files_reach_their_known_optimum(name: str) -> None:
    file = read_routing_file(shared(f"benchmarks/orienteering/optw/{name}.txt"))
    solution = solve(file.problem, time_limit_s=60.0)
    assert solution.proven
    assert solution.value == int(_best()[f"optw/{name}.txt"]["best_known"])


def test_no_value_lies_above_a_proven_optimum_of_the_surveys() -> None:
    best = _best()
    gaps = []
    for name in ("berlin52-gen3-50", "st70-gen2-50", "kroA100-gen3-50", "gr202-gen3-50"):
        row = best[f"oplib/{name}.oplib"]
        file = read_routing_file(shared(f"benchmarks/orienteering/oplib/{name}.oplib"))
        solution = solve(file.problem, time_limit_s=60.0, iterations=6000, engine="survey")
        assert solution.value is not None
        assert solution.value <= int(row["best_known"])
        gaps.append(1 - solution.value / int(row["best_known"]))
    assert sum(gaps) / len(gaps) < 0.05
