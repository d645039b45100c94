"""Files in and out: nothing is lost on the way, and what is wrong is named by its row."""

from __future__ import annotations

import contextlib
import csv
import hashlib
import io
import json
import xml.etree.ElementTree as ET
import zipfile
from collections.abc import Iterator
from html.parser import HTMLParser
from itertools import pairwise
from pathlib import Path
from typing import Any

import pytest
from cryptography.hazmat.primitives.asymmetric.ed25519 import Ed25519PrivateKey
from hypothesis import given
from hypothesis import strategies as st
from sqlalchemy.orm import Session

from ground.errors import InvalidInputError
from ground.gdr.database import Database
from ground.reports.plan_drawing import Box, boxes, lay_out, lay_out_as_outline, to_dot, to_svg
from ground.resources.geometry_files.site_geometry import read_shapes
from ground.resources.targets import create_target
from ground.resources.targets.bodies import TargetCreate
from tests.ground.approving import hand_in
from tests.ground.conftest import Api, yard
from tests.ground.planning import PlannedDay, finished
from tests.ground.test_missions_api import problem, upload

RING = [[6.0, 6.0], [8.0, 6.0], [8.0, 8.5]]


@pytest.fixture
def world(sqlite_api: Api, terrain_folder: Path) -> tuple[Api, str]:
    return sqlite_api, yard(sqlite_api.repo, terrain_folder).id


def fill(api: Api, mission: str) -> None:
    odd = 'A "quoted", name; with\u00e9'
    api.post(
        f"/missions/{mission}/targets", {"name": odd, "east_m": 4.1, "north_m": 0.1 + 0.2, "notes": "a\nb"}
    )
    api.post(f"/missions/{mission}/targets", {"east_m": -3.0, "north_m": 2.0, "source_image": "img.png"})
    api.post(f"/missions/{mission}/keep-outs", {"polygon_m": RING, "name": "Ditch", "notes": "deep"})


@pytest.mark.parametrize("form", ["geojson", "csv"])
def test_what_is_exported_comes_in_elsewhere_unchanged(
    world: tuple[Api, str], terrain_folder: Path, form: str
) -> None:
    api, mission = world
    fill(api, mission)
    file = api("GET", f"/missions/{mission}/geometry?form={form}")
    other = yard(api.repo, terrain_folder, "Other").id
    body = {"upload_id": upload(api, f"g.{form}", file.content)}
    made = api.post(f"/missions/{other}/geometry", body)
    kept = ("name", "notes", "source_image", "position", "polygon_m", "normal", "covariance_m2")
    for kind, members in (("targets", made["targets"]), ("keep-outs", made["keep_outs"])):
        before = api.get(f"/missions/{mission}/{kind}")["items"]
        pairs = zip(before, members, strict=True)
        assert [{k: a[k] for k in kept if k in a} for a, _ in pairs] == [
            {k: b[k] for k in kept if k in b} for b in members
        ]
    again = problem(api("POST", f"/missions/{other}/geometry", body), 422, "invalid-input")
    assert "2 of 3 rows cannot be used" in again["detail"]
    assert "there is a target" in again["detail"]
    assert api.get(f"/missions/{other}")["counts"]["targets"] == 2


def test_every_wrong_row_is_named_and_nothing_is_taken_in(world: tuple[Api, str]) -> None:
    api, mission = world
    lines = [
        "kind,name,east_m,north_m,polygon_m",
        "target,Good,1,1,",
        "target,Far,900,1,",
        "target,Words,x,1,",
        "keep_out,Bow,,,0 0; 2 2; 2 0; 0 2",
        "rock,What,1,1,",
        "keep_out,Thin,,,0 0; 1 1",
    ]
    form = {"upload_id": upload(api, "g.csv", "\n".join(lines).encode())}
    answer = problem(api("POST", f"/missions/{mission}/geometry", form), 422, "invalid-input")
    assert [e["pointer"] for e in answer["errors"]] == ["/rows/4", "/rows/6", "/rows/7"]
    sound = "\n".join(lines[:3] + lines[4:5]).encode()
    answer = problem(
        api("POST", f"/missions/{mission}/geometry", {"upload_id": upload(api, "g.csv", sound)}),
        422,
        "invalid-input",
    )
    assert [e["pointer"] for e in answer["errors"]] == ["/rows/3", "/rows/4"]
    assert api.get(f"/missions/{mission}")["counts"]["targets"] == 0


def test_members_that_are_not_ours_are_kept_in_the_notes() -> None:
    feature = {
        "type": "Feature",
        "properties": {"name": "R1", "lithology": "basalt", "notes": "see image"},
        "geometry": {"type": "Point", "coordinates": [1, 2, 3]},
    }
    (shape,) = read_shapes(json.dumps({"type": "FeatureCollection", "features": [feature]}).encode())
    assert shape.given == TargetCreate(
        name="R1", east_m=1.0, north_m=2.0, notes="see image\nlithology: basalt"
    )


def test_degrees_are_not_taken_for_metres() -> None:
    point = {"type": "Feature", "geometry": {"type": "Point", "coordinates": [4.0, 1.0]}}
    for naming in ({"frame": "lonlat"}, {"crs": {"type": "name", "properties": {"name": "EPSG:4326"}}}):
        document = {"type": "FeatureCollection", **naming, "features": [point]}
        with pytest.raises(InvalidInputError, match="says nothing of its site"):
            read_shapes(json.dumps(document).encode())


@given(st.binary(max_size=200) | st.text(max_size=200).map(lambda t: b"kind,name,east_m\n" + t.encode()))
def test_any_bytes_are_read_or_refused_in_words(content: bytes) -> None:
    with contextlib.suppress(InvalidInputError):
        assert all(shape.given for shape in read_shapes(content))


def test_keep_outs_from_a_file_need_the_right_to_draw_them(world: tuple[Api, str]) -> None:
    api, mission = world
    fill(api, mission)
    file = api("GET", f"/missions/{mission}/geometry?form=csv").content
    body = {"upload_id": upload(api, "g.csv", file, who="Scientist")}
    problem(api("POST", f"/missions/{mission}/geometry", body, who="Scientist"), 403, "forbidden")


TREE: dict[str, Any] = {
    "plan": [
        {"op": "navigate", "to": "A"},
        {
            "op": "branch",
            "options": [
                {"when": [{"var": "tracked", "target": "A", "is": False}], "p_taken": 0.25, "plan": []},
                {
                    "when": [{"var": "time_s", "ge": 90.0}],
                    "p_taken": 0.25,
                    "plan": [{"op": "visit", "target": "B"}],
                },
            ],
        },
        {"op": "visit", "target": "A"},
    ]
}


def test_a_drawing_shows_every_step_and_option_and_no_two_boxes_overlap() -> None:
    root = boxes(TREE, {"A": "Rock <1>", "B": 'Say "hi"'})
    lay_out(root)
    found = root.walk()
    assert [b.label for b in found] == ["", "Rock <1> lost", "time ≥ 0:01:30", "go on"]
    assert [b.probability for b in found] == [1.0, 0.25, 0.25, 0.5]
    for number, a in enumerate(found):
        for b in found[number + 1 :]:
            apart = a.x + a.width <= b.x or b.x + b.width <= a.x
            assert apart or a.y + a.height <= b.y or b.y + b.height <= a.y
    svg = ET.fromstring(to_svg(root))
    parts = [e.tag.rpartition("}")[2] for e in svg]
    assert max(k for k, tag in enumerate(parts) if tag == "path") < parts.index(
        "text"
    )  # no line over a label
    shown = {"".join(e.itertext()) for e in svg.iter("{http://www.w3.org/2000/svg}text")}
    assert {"drive to Rock <1>", "visit Rock <1>", 'visit Say "hi"', "go on  50%"} <= shown
    dot = to_dot(root)
    assert (dot.count("->"), dot.count("[label=")) == (3, 7)
    assert r"visit Say \"hi\"" in dot


def test_an_outline_is_as_wide_as_a_page_however_many_options_there_are() -> None:
    def box(depth: int) -> Box:
        return Box(["one", "two"], "if", 0.2, [box(depth - 1) for _ in range(4)] if depth else [])

    root = box(3)
    width, height = lay_out_as_outline(root)
    found = root.walk()
    assert len(found) == 85
    assert width < 500
    for upper, lower in pairwise(found):
        assert upper.y + upper.height < lower.y  # each stands by itself, in the order of reading
    assert found[-1].y + found[-1].height < height
    svg = ET.fromstring(to_svg(root, outline=True))
    assert float(svg.attrib["width"]) == pytest.approx(width, abs=1)


class Page(HTMLParser):
    """Collects what a page would load, and its text."""

    def __init__(self) -> None:
        super().__init__()
        self.loads: list[str] = []
        self.tags: set[str] = set()
        self.text = ""

    def handle_starttag(self, tag: str, attrs: list[tuple[str, str | None]]) -> None:
        self.tags.add(tag)
        self.loads += [value or "" for name, value in attrs if name in {"src", "href"}]

    def handle_data(self, data: str) -> None:
        self.text += data


def test_a_run_gives_products_with_a_manifest_and_a_report_that_loads_nothing(
    sqlite_planned_day: PlannedDay,
) -> None:
    api, mission, plan = sqlite_planned_day.api, sqlite_planned_day.mission.id, sqlite_planned_day.plan
    evil = {"name": "<script>x</script>"}
    api("PATCH", f"/missions/{mission}", evil, headers={"If-Match": "*"})
    job = finished(api, api.post(f"/missions/{mission}/runs", {"plan_id": plan["id"], "seed": 4}, status=202))
    run = job["subject_id"]
    drawing = api("GET", f"/plans/{plan['id']}/drawing")
    assert ET.fromstring(drawing.text).tag.endswith("svg")
    assert api("GET", f"/plans/{plan['id']}/drawing?form=dot").text.startswith("digraph plan {")

    archive = zipfile.ZipFile(io.BytesIO(api("GET", f"/runs/{run}/products").content))
    manifest = json.loads(archive.read("manifest.json"))
    known = api.get(f"/missions/{mission}/products?run_id={run}")["items"]
    assert {f["path"] for f in manifest["files"]} | {"manifest.json"} == set(archive.namelist())
    assert {(f["id"], f["request_id"], f["task_id"]) for f in manifest["files"]} == {
        (p["id"], p["request_id"], p["task_id"]) for p in known
    }
    for file in manifest["files"]:
        assert hashlib.sha256(archive.read(file["path"])).hexdigest() == file["sha256"]

    answer = api("GET", f"/runs/{run}/report")
    assert "default-src 'none'" in answer.headers["content-security-policy"]
    page = Page()
    page.feed(answer.text)
    assert [link[:22] for link in page.loads] == ["data:image/png;base64,"]
    assert "script" not in page.tags
    for word in (
        "<script>x</script>",
        "SUCCEEDED",
        "Top failure modes",
        "Near",
        "Far",
        *(p["file_name"] for p in known),
    ):
        assert word in page.text


def test_a_rehearsal_says_when_the_ground_knows_what(sqlite_planned_day: PlannedDay) -> None:
    api, mission, plan = sqlite_planned_day.api, sqlite_planned_day.mission.id, sqlite_planned_day.plan
    passes = [{"name": "dusk", "start_s": 50_000.0, "end_s": 51_000.0, "data_mbit": 5000.0}]
    url = f"/sols/{plan['sol_id']}"
    assert api("PATCH", url, {"passes": passes}, headers={"If-Match": "*"}).status_code == 200

    def report(**link: Any) -> tuple[str, dict[str, Any]]:
        body = {"plan_id": plan["id"], "seed": 4, **link}
        job = finished(api, api.post(f"/missions/{mission}/runs", body, status=202))
        page = Page()
        page.feed(api("GET", f"/runs/{job['subject_id']}/report").text)
        run: dict[str, Any] = api.get(f"/runs/{job['subject_id']}")
        return page.text, run

    text, plain = report()
    assert "Known on the ground" not in text
    late = [{"operation": "abort", "sent_s": 10.0}]
    text, run = report(light_time_s=600, commands=late)
    assert (run["outcome"], run["utility"]) == (plain["outcome"], plain["utility"])
    for word in ("Known on the ground", "dusk 50000 to 51000 s", "known on the ground at 50,600 s"):
        assert word in text
    assert "abort10 s50,000 s" in text  # sent, and held until it arrives in the pass
    text, run = report(light_time_s=0, commands=[{"operation": "abort", "sent_s": 50_000.5}])
    assert run["outcome"] == plain["outcome"]
    problem(
        api("POST", f"/missions/{mission}/runs", {"plan_id": plan["id"], "light_time_s": -1}),
        422,
        "invalid-input",
    )


def test_a_plan_is_reported_before_its_run(sqlite_planned_day: PlannedDay) -> None:
    api, mission, plan = sqlite_planned_day.api, sqlite_planned_day.mission.id, sqlite_planned_day.plan
    evil = {"name": "<script>x</script>"}
    api("PATCH", f"/missions/{mission}", evil, headers={"If-Match": "*"})
    remark = {"subject_kind": "plan", "subject_id": plan["id"], "text": "mind the <i>ditch</i>"}
    api.post(f"/missions/{mission}/comments", remark)

    def read() -> Page:
        answer = api("GET", f"/plans/{plan['id']}/report")
        assert (answer.status_code, answer.headers["content-type"]) == (200, "text/html; charset=utf-8")
        assert "default-src 'none'" in answer.headers["content-security-policy"]
        page = Page()
        page.feed(answer.text)
        assert [link[:22] for link in page.loads] == ["data:image/png;base64,"]
        assert page.tags.isdisjoint({"script", "i"})
        return page

    text = read().text
    rules = [rule["rule"] for rule in api.get(f"/plans/{plan['id']}/flight-rules")]
    for word in ("<script>x</script>", "mind the <i>ditch</i>", "Near", "Far", plan["crl_sha256"], *rules):
        assert word in text
    assert "the plan is computed; it has to be verified" in text
    finished(api, api.post(f"/missions/{mission}/runs", {"plan_id": plan["id"], "seed": 4}, status=202))
    for rule in api.get(f"/plans/{plan['id']}/flight-rules"):
        assert rule["holds"] or f"{rule['rule']} does not hold" in text
        if not rule["holds"]:
            waiver = {"rule": rule["rule"], "reason": "small yard"}
            api.post(f"/plans/{plan['id']}/waivers", waiver, status=201, who="Flight Director")
            assert "waived: small yard" in read().text
    assert "has approved it yet" in read().text
    key = Ed25519PrivateKey.generate()
    answer = hand_in(api, plan["id"], "approver", "Flight Director", key, note="read and found good")
    assert answer.status_code == 201, answer.text
    text = read().text
    assert "Nothing stands against the uplink" in text
    assert "read and found good" in text
    api.post(f"/missions/{mission}/targets", {"east_m": -3.0, "north_m": 2.0})
    text = read().text
    assert "the mission was edited since the plan was computed" in text
    assert "Nothing stands against the uplink" not in text


def test_the_table_is_plain_csv(world: tuple[Api, str]) -> None:
    api, mission = world
    fill(api, mission)
    rows = list(csv.reader(io.StringIO(api("GET", f"/missions/{mission}/geometry?form=csv").text)))
    assert len({len(row) for row in rows}) == 1
    assert [row[0] for row in rows] == ["kind", "target", "target", "keep_out"]


def test_the_terrain_is_asked_before_the_database_is_held(
    world: tuple[Api, str], monkeypatch: pytest.MonkeyPatch
) -> None:
    """Of a file and of many rows at once, of rows that are wrong too: others write meanwhile."""
    api, mission = world
    held: list[int] = []
    asked: list[bool] = []
    write, surfaces_at = Database.write, create_target.surfaces_at

    @contextlib.contextmanager
    def watched(database: Database) -> Iterator[Session]:
        with write(database) as session:
            held.append(1)
            try:
                yield session
            finally:
                held.pop()

    def seen(*given: Any) -> Any:
        asked.extend([bool(held)] * len(given[1]))
        return surfaces_at(*given)

    monkeypatch.setattr(Database, "write", watched)
    monkeypatch.setattr(create_target, "surfaces_at", seen)
    table = "kind,name,east_m,north_m\n" + "".join(f"target,F{n},{n},1\n" for n in range(5))
    upload_id = upload(api, "good.csv", table.encode())
    assert len(api.post(f"/missions/{mission}/geometry", {"upload_id": upload_id})["targets"]) == 5
    wrong = upload(api, "bad.csv", b"kind,name,east_m,north_m\ntarget,Off,900,0\ntarget,F1,2,2\n")
    told = problem(api("POST", f"/missions/{mission}/geometry", {"upload_id": wrong}), 422, "invalid-input")
    assert "2 of 2 rows cannot be used" in told["detail"]
    rows = [{"name": "B1", "east_m": 1.0, "north_m": 2.0}, {"name": "B2", "east_m": 900.0, "north_m": 2.0}]
    told = problem(api("POST", f"/missions/{mission}/targets/bulk", {"create": rows}), 422, "invalid-input")
    assert [one["pointer"].rpartition("/")[0] for one in told["errors"]] == ["/create/1"]
    assert len(asked) == 5 + 2 + 2
    assert not any(asked)
