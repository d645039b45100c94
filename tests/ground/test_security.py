"""What people from outside may try, by name; and what each role may do at each endpoint."""

from __future__ import annotations

import asyncio
import io
import json
import logging
import re
import shutil
import stat
import time
import zipfile
from collections import Counter
from collections.abc import Iterator
from pathlib import Path
from typing import Any

import httpx
import pytest
from argon2 import PasswordHasher
from sqlalchemy import select, text, update

from ground.app.api import build_api
from ground.errors import ArchiveError, TooManyAttemptsError
from ground.gdr.archives import extract_zip
from ground.gdr.base import utc_now
from ground.gdr.ids import new_id
from ground.gdr.repository import Repository, open_repository
from ground.jobs.row import JobRow
from ground.logs import JsonFormatter
from ground.records.actor import ALLOWED, SYSTEM_ACTOR, Action, Role
from ground.resources.comments.row import CommentRow
from ground.resources.drafts.row import DraftRow
from ground.resources.frames.row import FrameRow, SolutionRow
from ground.resources.keep_outs.row import KeepOutRow
from ground.resources.missions.value import Mission
from ground.resources.observation_requests.row import ObservationRequestRow
from ground.resources.people.accounts import ensure_profiles
from ground.resources.people.log_in_limits import LogInLimits, address_of
from ground.resources.people.passwords import set_password
from ground.resources.people.row import CredentialRow, PersonRow
from ground.resources.plans.row import PlanRow
from ground.resources.runs.row import RunRow
from ground.resources.site_maps.row import SiteMapRow
from ground.resources.sols.row import SolRow
from ground.resources.targets.row import TargetRow
from ground.resources.traverses.row import TraverseRow
from ground.resources.webhooks.row import WebhookRow
from ground.settings import SettingsError, load_settings
from tests.ground.conftest import Api, open_api, settings_for, yard
from tests.ground.test_missions_api import problem, upload

PASSWORD = "correct horse battery"


def zip_of(**files: bytes) -> bytes:
    out = io.BytesIO()
    with zipfile.ZipFile(out, "w", zipfile.ZIP_DEFLATED) as archive:
        for name, content in files.items():
            archive.writestr(name, content)
    return out.getvalue()


# ---- archives and uploads


@pytest.mark.parametrize("name", ["../evil", "/etc/evil", "a/../../evil", "..\\evil", "C:\\evil", "a\x01b"])
def test_a_name_that_leads_outside_an_archive_is_refused(name: str, tmp_path: Path) -> None:
    (tmp_path / "x.zip").write_bytes(zip_of(**{name: b"x"}))
    with pytest.raises(ArchiveError, match="leads outside"):
        extract_zip(tmp_path / "x.zip", tmp_path / "out", max_bytes=1000)
    assert not (tmp_path / "evil").exists()


def test_a_link_in_an_archive_is_refused(tmp_path: Path) -> None:
    with zipfile.ZipFile(tmp_path / "x.zip", "w") as archive:
        entry = zipfile.ZipInfo("link")
        entry.external_attr = (stat.S_IFLNK | 0o777) << 16
        archive.writestr(entry, "/etc/passwd")
    with pytest.raises(ArchiveError, match="holds a link"):
        extract_zip(tmp_path / "x.zip", tmp_path / "out", max_bytes=1000)


def test_a_zip_bomb_is_refused_before_it_is_unpacked(api: Api, mission: Mission) -> None:
    bomb = zip_of(**{"dem.tif": b"\0" * (64 * 2**20)})
    assert len(bomb) < 100_000
    order = {"name": "Bomb", "terrain": {"source": "uploaded", "upload_id": upload(api, "b.zip", bomb)}}
    assert "unpacks to" in problem(api("POST", "/missions", order), 422, "archive-unusable")["detail"]


@pytest.mark.parametrize("name", ["..%2Fx", "a%2Fb", "a%5Cb", "%00", ""])
def test_a_file_name_with_a_path_is_refused(sqlite_api: Api, name: str) -> None:
    problem(sqlite_api("POST", f"/uploads?file_name={name}", content=b"x"), 422, "invalid-input")


@pytest.mark.parametrize(
    "path", ["/../../etc/passwd", "/..%2f..%2fetc%2fpasswd", "/assets/..%2f..%2f__init__.py"]
)
def test_a_path_that_leads_outside_the_ui_is_not_served(sqlite_api: Api, path: str) -> None:
    answer = sqlite_api("GET", path, raw=True)
    assert "root:" not in answer.text
    assert "DIST" not in answer.text


# ---- bodies and headers


def test_an_oversized_body_is_refused(sqlite_api: Api) -> None:
    answer = sqlite_api(
        "POST", "/missions", content=b" " * (9 * 2**20), headers={"content-type": "application/json"}
    )
    problem(answer, 413, "too-large")


def test_the_document_says_of_all_that_takes_a_body_that_a_large_one_is_refused() -> None:
    document = json.loads((Path(__file__).parents[2] / "ground/openapi.json").read_text())
    taking = [
        operation
        for path in document["paths"].values()
        for operation in path.values()
        if "requestBody" in operation
    ]
    assert len(taking) > 50
    assert [operation["operationId"] for operation in taking if "413" not in operation["responses"]] == []


def test_an_oversized_body_without_a_length_is_refused(sqlite_api: Api) -> None:
    async def endless() -> Any:
        for _ in range(100):
            yield b" " * 2**20

    answer = sqlite_api("POST", "/missions", content=endless(), headers={"content-type": "application/json"})
    problem(answer, 413, "too-large")


def test_an_upload_over_the_limit_is_refused(sqlite_template: Path, tmp_path: Path) -> None:
    (tmp_path / "data").mkdir()
    shutil.copyfile(sqlite_template, tmp_path / "data" / "outcrop.db")
    repo = open_repository(settings_for(tmp_path / "data", max_body_mib=1.0))
    ensure_profiles(repo)
    for api in open_api(repo):
        problem(api("POST", "/uploads?file_name=x", content=b"x" * (2**20 + 1)), 413, "too-large")
    repo.database.dispose()


NASTY = [
    "x'); DROP TABLE missions;--",
    '" OR 1=1 --',
    "%' UNION SELECT * FROM people --",
    "<script>alert(1)</script>",
]


@pytest.mark.parametrize("nasty", NASTY)
def test_names_and_filters_are_data_and_never_sql_or_html(api: Api, mission: Mission, nasty: str) -> None:
    target = api.post(f"/missions/{mission.id}/targets", {"name": nasty, "east_m": 1.0, "north_m": 1.0})
    answer = api("GET", f"/targets/{target['id']}")
    assert answer.json()["name"] == nasty
    assert answer.headers["content-type"] == "application/json"
    assert answer.headers["x-content-type-options"] == "nosniff"
    found = api("GET", f"/missions/{mission.id}/products", params={"run_id": nasty})
    problem(found, 422, "invalid-input")
    with api.repo.database.read() as session:
        assert session.execute(text("SELECT count(*) FROM missions")).scalar() == 1


def test_a_line_break_in_a_name_cannot_reach_a_header(api: Api, mission: Mission) -> None:
    body = {"name": "a\r\nSet-Cookie: x=1", "east_m": 1.0, "north_m": 1.0}
    problem(api("POST", f"/missions/{mission.id}/targets", body), 422, "invalid-input")


def test_pages_forbid_foreign_scripts_and_frames(sqlite_api: Api) -> None:
    page = sqlite_api("GET", "/", raw=True)
    assert "script-src 'self'" in page.headers["content-security-policy"]
    assert page.headers["x-frame-options"] == "DENY"
    assert "default-src 'none'" in sqlite_api("GET", "/docs").headers["content-security-policy"]


# ---- other sites


@pytest.mark.parametrize(
    "headers", [{"Origin": "https://evil.example"}, {"Origin": "null"}, {"Sec-Fetch-Site": "cross-site"}]
)
def test_a_page_of_another_site_cannot_change_anything(sqlite_api: Api, headers: dict[str, str]) -> None:
    problem(
        sqlite_api("POST", "/people", {"name": "Eve"}, headers=headers, who="Administrator"), 403, "forbidden"
    )


def test_a_name_rebound_to_loopback_is_refused(sqlite_api: Api) -> None:
    problem(sqlite_api("GET", "/missions", headers={"Host": "evil.example:8000"}), 422, "invalid-input")


def test_a_plain_text_post_is_not_taken_for_json(sqlite_api: Api) -> None:
    answer = sqlite_api(
        "POST",
        "/people",
        content=b'{"name": "Eve"}',
        headers={"content-type": "text/plain"},
        who="Administrator",
    )
    assert answer.status_code in {415, 422}


# ---- accounts


@pytest.fixture(scope="module")
def hashed() -> str:
    return PasswordHasher().hash(PASSWORD)


@pytest.fixture
def accounts(sqlite_template: Path, hashed: str, tmp_path: Path) -> Iterator[Api]:
    (tmp_path / "data").mkdir()
    shutil.copyfile(sqlite_template, tmp_path / "data" / "outcrop.db")
    repo = open_repository(settings_for(tmp_path / "data", auth="accounts"))
    ensure_profiles(repo)
    with repo.database.write() as session:
        for role in Role:
            session.add(
                PersonRow(
                    id=new_id("psn"),
                    author="",
                    name=role.value,
                    role=role.value,
                    mission_roles={},
                    password_hash=hashed,
                )
            )
    yield from open_api(repo)
    repo.database.dispose()


def log_in(api: Api, name: str, password: str = PASSWORD) -> dict[str, str]:
    """Return the headers of a session."""
    answer = api("POST", "/session", {"name": name, "password": password})
    assert answer.status_code == 201, answer.text
    cookie = answer.headers["set-cookie"]
    assert "HttpOnly" in cookie
    assert "SameSite=strict" in cookie
    return {"Cookie": cookie.split(";")[0], "X-CSRF-Token": answer.json()["csrf_token"]}


def test_without_an_account_nothing_is_seen(accounts: Api) -> None:
    problem(accounts("GET", "/missions"), 401, "not-authenticated")
    problem(accounts("GET", "/missions", who="admin"), 401, "not-authenticated")
    assert accounts.get("/session")["person"] is None
    assert accounts("GET", "/healthz").status_code == 200


def test_a_session_changes_things_only_with_its_csrf_token(accounts: Api) -> None:
    headers = log_in(accounts, "admin")
    accounts.client.cookies.clear()
    assert accounts.get("/session", headers=headers)["person"]["name"] == "admin"
    body = {"name": "New", "password": PASSWORD}
    assert accounts("POST", "/people", body, headers=headers).status_code == 201
    bare = {"Cookie": headers["Cookie"]}
    problem(accounts("POST", "/people", body, headers=bare), 403, "forbidden")
    wrong = {**bare, "X-CSRF-Token": "0" * 40}
    problem(accounts("POST", "/people", body, headers=wrong), 403, "forbidden")
    assert accounts("DELETE", "/session", headers=headers).status_code == 204
    problem(accounts("GET", "/missions", headers=headers), 401, "not-authenticated")


def test_forged_and_outdated_tokens_are_refused(accounts: Api) -> None:
    for header in ("Bearer oc_forged", "Bearer ", "Basic YWRtaW46YWRtaW4="):
        problem(accounts("GET", "/missions", headers={"Authorization": header}), 401, "not-authenticated")
    problem(
        accounts("GET", "/missions", headers={"Cookie": "outcrop_session=forged"}), 401, "not-authenticated"
    )
    headers = log_in(accounts, "viewer")
    accounts.client.cookies.clear()
    with accounts.repo.database.write() as session:
        session.execute(update(CredentialRow).values(expires_utc=utc_now()))
    problem(accounts("GET", "/missions", headers=headers), 401, "not-authenticated")


def test_an_api_key_works_until_it_is_taken_back_and_is_never_stored(accounts: Api) -> None:
    headers = log_in(accounts, "scientist")
    accounts.client.cookies.clear()
    made = accounts.post("/api-keys", {"name": "script"}, headers=headers)
    key = {"Authorization": f"Bearer {made['secret']}"}
    assert accounts.get("/session", headers=key)["person"]["name"] == "scientist"
    assert made["secret"].encode() not in (accounts.repo.data_dir / "outcrop.db").read_bytes()
    other = log_in(accounts, "planner")
    accounts.client.cookies.clear()
    problem(accounts("DELETE", f"/api-keys/{made['id']}", headers=other), 403, "forbidden")
    assert accounts("DELETE", f"/api-keys/{made['id']}", headers=headers).status_code == 204
    until = time.monotonic() + 5.0
    while accounts("GET", "/missions", headers=key).status_code != 401:
        assert time.monotonic() < until


def test_the_door_closes_after_five_failed_logins(accounts: Api) -> None:
    for _ in range(5):
        problem(
            accounts("POST", "/session", {"name": "admin", "password": "wrong"}), 401, "not-authenticated"
        )
    answer = accounts("POST", "/session", {"name": "admin", "password": PASSWORD})
    problem(answer, 429, "too-many-attempts")
    assert int(answer.headers["retry-after"]) > 0
    log_in(accounts, "planner")


def test_a_new_password_ends_sessions_and_the_old_one(accounts: Api) -> None:
    headers = log_in(accounts, "viewer")
    accounts.client.cookies.clear()
    set_password(accounts.repo, SYSTEM_ACTOR, "viewer", "another horse battery")
    accounts.app.state.identities.forget()
    problem(accounts("GET", "/missions", headers=headers), 401, "not-authenticated")
    answer = accounts("POST", "/session", {"name": "viewer", "password": PASSWORD})
    problem(answer, 401, "not-authenticated")
    log_in(accounts, "viewer", "another horse battery")


def test_guesses_at_the_same_time_are_five_and_another_address_still_enters(accounts: Api) -> None:
    app = accounts.app

    async def guess(host: str, password: str, times: int) -> list[int]:
        transport = httpx.ASGITransport(app=app, client=(host, 1))
        async with httpx.AsyncClient(transport=transport, base_url="http://testserver") as client:
            given = {"name": "admin", "password": password}
            sent = [client.post("/api/v1/session", json=given) for _ in range(times)]
            return [answer.status_code for answer in await asyncio.gather(*sent)]

    counts: Counter[int] = Counter()
    for _ in range(5):
        counts.update(accounts.portal.call(guess, "10.0.0.1", "wrong-password", 60))
    assert counts == {401: 5, 429: 295}
    assert accounts.portal.call(guess, "10.0.0.1", PASSWORD, 1) == [429]
    assert accounts.portal.call(guess, "10.0.0.2", PASSWORD, 1) == [201]
    app.state.limits = LogInLimits()  # another server, or this one after a restart
    assert accounts.portal.call(guess, "10.0.0.1", PASSWORD, 1) == [429]


def test_one_guess_for_each_of_many_names_is_limited_by_address() -> None:
    now = 0.0
    limits = LogInLimits(clock=lambda: now)
    for number in range(50):
        limits.knock(f"name {number}", "10.0.0.1")
    with pytest.raises(TooManyAttemptsError):
        limits.knock("another", "10.0.0.1")
    limits.knock("another", "10.0.0.2")
    now = 301.0
    limits.knock("another", "10.0.0.1")


def test_an_address_is_a_whole_network_in_ipv6() -> None:
    assert address_of("2001:db8::1") == address_of("2001:db8::ffff:2") != address_of("2001:db8:0:1::1")
    assert address_of("::ffff:10.0.0.1") == address_of("10.0.0.1") == "10.0.0.1"
    assert address_of(None) == "unknown"


def test_passwords_never_reach_rows_or_logs(accounts: Api, caplog: pytest.LogCaptureFixture) -> None:
    with caplog.at_level(logging.DEBUG):
        log_in(accounts, "admin")
    assert PASSWORD not in caplog.text
    history = accounts("GET", "/people", headers=log_in(accounts, "admin")).text
    assert "password" not in history
    assert PASSWORD.encode() not in (accounts.repo.data_dir / "outcrop.db").read_bytes()
    record = logging.LogRecord("x", logging.INFO, "", 0, "m", (), None)
    record.password = PASSWORD
    assert PASSWORD not in JsonFormatter().format(record)


def test_profiles_without_passwords_are_refused_off_loopback(tmp_path: Path) -> None:
    with pytest.raises(SettingsError, match=r"OUTCROP_HOST='0\.0\.0\.0'.*OUTCROP_AUTH=accounts"):
        load_settings(data_dir=tmp_path, host="0.0.0.0")


# ---- role x endpoint

RULES: tuple[tuple[str, str, Action], ...] = (
    ("POST", r"/missions(/import)?$", Action.EDIT_MISSION),
    ("PATCH", r"/missions/\{", Action.EDIT_MISSION),
    ("DELETE", r"/missions/\{[a-z_]+\}$", Action.ADMINISTER),
    ("POST", r"/(copy|calibrate)$", Action.EDIT_MISSION),
    ("(POST|PATCH|DELETE)", r"/(targets|observation-requests)(/\{[a-z_]+\}|/bulk)?$", Action.EDIT_SCIENCE),
    ("POST", r"/geometry$", Action.EDIT_SCIENCE),
    ("(POST|PATCH|DELETE)", r"/(sols|keep-outs|site-maps)(/\{[a-z_]+\}|/bulk)?$", Action.EDIT_MISSION),
    ("(POST|PATCH|DELETE)", r"/comments(/\{[a-z_]+\})?$", Action.COMMENT),
    ("(PUT|DELETE)", r"/presence/\{page\}$", Action.READ),  # of oneself, and nobody keeps it
    ("POST", r"/(drafts|sentences/draft)$", Action.DRAFT),
    ("POST", r"/mission-merges$", Action.EDIT_SCIENCE),  # and of what it changes, as by hand
    ("POST", r"/sentences$", Action.READ),
    ("(POST|PATCH|DELETE)", r"/webhooks(/\{[a-z_]+\}(/secret|/redeliver)?)?$", Action.EDIT_MISSION),
    ("POST", r"/drafts/\{[a-z_]+\}/(accept|reject)$", Action.EDIT_SCIENCE),  # of a target, as here
    ("POST", r"/(path-networks|plans|plan-merges|sol-paths|runs|campaigns)$", Action.PLAN),
    ("(PATCH|DELETE)", r"/(plans|runs)/\{[a-z_]+\}$", Action.PLAN),
    ("POST", r"/runs/\{[a-z_]+\}/(control|faults)$", Action.PLAN),
    ("POST", r"/plans/\{[a-z_]+\}/(what-if|crl-check)$", Action.READ),
    ("POST", r"/plans/\{[a-z_]+\}/edits$", Action.PLAN),
    ("POST", r"/jobs/.*(cancel|retry)$", Action.PLAN),
    ("POST", r"/(frames|solutions|frame-files|site-maps)$", Action.EDIT_MISSION),
    ("PATCH", r"/frames/\{[a-z_]+\}$", Action.EDIT_MISSION),
    ("PUT", r"/frames/\{[a-z_]+\}/solution$", Action.EDIT_MISSION),
    ("(PATCH|DELETE)", r"/(solutions|site-maps)/\{[a-z_]+\}$", Action.EDIT_MISSION),
    ("(POST|PATCH|DELETE)", r"/traverses(/\{[a-z_]+\})?$", Action.PLAN),
    ("POST", r"/(signatures|waivers)$", Action.APPROVE),
    ("POST", r"/statement$", Action.PLAN),
    ("POST", r"/(package|ingest|execution)$", Action.UPLINK),
    ("POST", r"/next-sol$", Action.EDIT_MISSION),
    ("POST", r"/uploads$", Action.COMMENT),  # who edits or uplinks: the roles that comment
    ("(POST|PUT|PATCH)", r"/people", Action.ADMINISTER),
)
"""Which right each changing endpoint needs; written down apart from the code that checks it."""
FREE = re.compile(
    r"/(session|first-administrator|api-keys|signing-keys|undo|redo)|/(runs/ingest|runs/import|missions/import)$"
)
"""About oneself, for who has the first token, or with a right that depends on what comes in."""


def changing_endpoints() -> list[tuple[str, str]]:
    return [
        (method.upper(), path)
        for path, operations in build_api().openapi()["paths"].items()
        for method in operations
        if method.upper() in {"POST", "PUT", "PATCH", "DELETE"} and not FREE.search(path)
    ]


def needed(method: str, path: str) -> Action:
    for verb, pattern, action in RULES:
        if re.fullmatch(verb, method) and re.search(pattern, path):
            return action
    raise AssertionError(f"no rule says who may {method} {path}")


BODIES: dict[str, Any] = {
    "merge_missions": {"from_id": "M", "event": 1, "from_event": 1},
    "merge_plans": {name: {"plan_id": "plan_id"} for name in ("base", "ours", "theirs")},
    "create_mission": {"name": "M", "terrain": {"source": "uploaded", "upload_id": "none"}},
    "copy_mission": {"name": "M"},
    "import_geometry": {"upload_id": "none"},
    "create_sol": {},
    "create_target": {"east_m": 1.0, "north_m": 1.0},
    "create_observation_request": {"target_id": "T", "instrument": "science_camera", "value": 1.0},
    "create_keep_out": {"polygon_m": [[1.0, 1.0], [2.0, 1.0], [2.0, 2.0]]},
    "create_comment": {"subject_kind": "mission", "subject_id": "M", "text": "x"},
    "create_webhook": {"name": "W", "url": "https://hooks.example/in"},
    "redeliver_webhook": {"event": 1},
    "create_draft": {"target": {"east_m": 1.0, "north_m": 1.0}},
    "reject_draft": {},
    "read_sentence": {"text": "image T with the mast camera"},
    "draft_sentence": {"text": "image T with the mast camera"},
    "create_path_network": {},
    "create_plan": {"iterations": 1},
    "create_sol_path": {"sols": 2, "time_limit_s": 1.0},
    "check_crl": {"crl": "(task :id a :action safemode)"},
    "edit_plan": {"crl": "(task :id a :action safemode)"},
    "create_run": {"plan_id": "P"},
    "control_run": {"paused": True},
    "inject_fault": {"kind": "novelty", "amount": 0.5},
    "create_campaign": {"plan_id": "P", "runs": 10},
    "sign_plan": {
        "role": "approver",
        "sha256": "0" * 64,
        "key": "0" * 16,
        "signature": "A" * 86 + "==",
    },
    "create_waiver": {"rule": "FR-TILT", "reason": "x"},
    "create_person": {"name": "Eve"},
    "reset_password": {"password": "a new password"},
    "create_frame": {"name": "SITE_FRAME", "counter": [2]},
    "create_solution": {
        "label": "L",
        "reference_id": "frame_id",
        "offset_m": [0.0, 0.0, 0.0],
        "quaternion": [1.0, 0.0, 0.0, 0.0],
    },
    "choose_solution": {"solution_id": "solution_id"},
    "import_frames": {"upload_id": "none"},
    "create_site_map": {"frame_id": "frame_id", "upload_id": "none"},
    "create_traverse": {
        "name": "N",
        "stops": [{"frame_id": "frame_id", "upload_id": "none"}, {"frame_id": "F", "upload_id": "none"}],
    },
}


def test_every_role_may_do_at_every_endpoint_what_its_rights_say_and_no_more(
    sqlite_repo: Repository, terrain_folder: Path
) -> None:
    """A right that is missing answers 403; one that is there answers anything else."""
    pass

    mission = yard(sqlite_repo, terrain_folder)
    common: dict[str, Any] = {"author": "system", "mission_id": mission.id}
    with sqlite_repo.database.write() as session:
        for name in Role:
            session.add(
                PersonRow(
                    id=new_id("psn"), author="", name=f"r-{name.value}", role=name.value, mission_roles={}
                )
            )
        sol = session.scalars(select(SolRow.id)).one()
        target = {
            "name": "T",
            "east_m": 1.0,
            "north_m": 1.0,
            "up_m": 0.0,
            "normal": [0, 0, 1],
            "slope_rad": 0.0,
        }
        session.add(TargetRow(id="target_id", covariance_m2=[], **common, **target))
        session.flush()
        session.add(
            ObservationRequestRow(
                id="observation_request_id",
                target_id="target_id",
                instrument="science_camera",
                value=1.0,
                tracked=False,
                after=[],
                state="open",
                **common,
            )
        )
        session.add(KeepOutRow(id="keep_out_id", name="K", polygon_m=[], **common))
        session.add(
            FrameRow(
                id="frame_id",
                key="SITE_FRAME 1",
                name="SITE_FRAME",
                counter=[1],
                level="site",
                site=1,
                **common,
            )
        )
        session.flush()
        session.add(
            SolutionRow(
                id="solution_id",
                frame_id="frame_id",
                reference_id="frame_id",
                label="L",
                offset_m=[0.0, 0.0, 0.0],
                quaternion=[1.0, 0.0, 0.0, 0.0],
                added_utc=utc_now(),
                position=1,
                source={"kind": "by_hand"},
                **common,
            )
        )
        session.add(
            SiteMapRow(
                id="site_map_id",
                name="M",
                frame_id="frame_id",
                in_frame={},
                outline_m=[],
                sigma_m=0.0,
                file_name="m.tif",
                media="image/tiff",
                size_bytes=0,
                sha256="",
                **common,
            )
        )
        session.add(
            TraverseRow(id="traverse_id", name="N", job_id="job_id", stops=[], solution_ids=[], **common)
        )
        session.add(
            DraftRow(
                id="draft_id",
                kind="target",
                form={"east_m": 1.0, "north_m": 1.0},
                drafted_by="r-assistant",
                drafted_for="r-assistant",
                note="",
                state="open",
                reason="",
                decided_by="",
                made_kind="",
                made_id="",
                **common,
            )
        )
        session.add(
            WebhookRow(
                id="webhook_id", name="W", url="https://hooks.example/", kinds=[], active=False, **common
            )
        )
        session.add(CommentRow(id="comment_id", subject_kind="mission", subject_id="", text="", **common))
        session.add(
            JobRow(
                id="job_id",
                kind="none",
                payload={},
                subject_kind="",
                subject_id="",
                state="succeeded",
                max_attempts=1,
                time_limit_s=1.0,
                log=[],
                **common,
            )
        )
        session.add(
            PlanRow(
                id="plan_id",
                sol_id=sol,
                number=1,
                name="P",
                state="computed",
                strategy="optimal",
                max_branches=1,
                time_limit_s=1.0,
                seed=1,
                job_id="",
                inputs_sha256="",
                terrain_sha256="",
                dictionary="",
                rover_profile="k9",
                findings=[],
                request_ids=[],
                planned_request_ids=[],
                left_out={},
                **common,
            )
        )
        session.flush()
        session.add(
            RunRow(
                id="run_id",
                plan_id="plan_id",
                kind="dry_run",
                rover="abstract",
                seed=1,
                faults=[],
                state="succeeded",
                options_taken=[],
                achieved_request_ids=[],
                crl_sha256="",
                **common,
            )
        )
        person = session.query(PersonRow.id).first()
    assert person is not None
    document = build_api().openapi()["paths"]
    wrong = []
    for api in open_api(sqlite_repo):
        for method, path in changing_endpoints():
            operation = document[path][method.lower()]["operationId"]
            url = (
                path.replace("{mission_id}", mission.id)
                .replace("{person_id}", person.id)
                .replace("{sol_id}", sol)
            )
            url = re.sub(r"\{([a-z_]+)\}", r"\1", url)
            # A revision that is not there: what may be changed answers 412 and stays for the next role.
            headers = {"If-Match": '"99"'} if method != "POST" else {}
            for role in set(Role) - {Role.NONE}:  # who sees nothing: tests/ground/test_visibility.py
                answer = api(
                    method,
                    url + ("?file_name=x" if operation == "create_upload" else ""),
                    BODIES.get(operation, {} if method != "DELETE" else None),
                    who=f"r-{role.value}",
                    headers=headers,
                )
                assert answer.status_code < 500, answer.text
                may = needed(method, path) in ALLOWED[role]
                if (answer.status_code != 403) != may:
                    wrong.append((role.value, method, path, answer.status_code))
    assert wrong == []


def test_the_approver_is_never_the_author_whatever_the_role() -> None:
    assert Action.APPROVE in ALLOWED[Role.ADMIN]
    assert Action.APPROVE not in ALLOWED[Role.PLANNER]


def test_a_role_for_one_mission_counts_there_only(api: Api, mission: Mission) -> None:
    person = next(p for p in api.get("/people")["items"] if p["name"] == "Viewer")
    roles = {"mission_roles": {mission.id: "scientist"}}
    answer = api("PATCH", f"/people/{person['id']}", roles, headers={"If-Match": "*"}, who="Administrator")
    assert answer.status_code == 200, answer.text
    body = {"east_m": 1.0, "north_m": 1.0}
    assert api("POST", f"/missions/{mission.id}/targets", body, who="Viewer").status_code == 201
    other = api.post(f"/missions/{mission.id}/copy", {"name": "Other"})
    problem(api("POST", f"/missions/{other['id']}/targets", body, who="Viewer"), 403, "forbidden")


def test_a_role_counts_as_soon_as_the_change_is_answered(api: Api, mission: Mission) -> None:
    """Not a moment later, when another connection may have asked already."""
    person = next(p for p in api.get("/people")["items"] if p["name"] == "Viewer")
    target: Any = {"json": {"east_m": 1.0, "north_m": 1.0}, "headers": {"X-Outcrop-Person": "Viewer"}}
    url = f"/api/v1/missions/{mission.id}/targets"
    problem(api("POST", f"/missions/{mission.id}/targets", target["json"], who="Viewer"), 403, "forbidden")
    client = api.client
    answered: list[int] = []

    async def spy(scope: Any, receive: Any, send: Any) -> None:
        async def first_look(message: Any) -> None:
            if message["type"] == "http.response.start":
                answered.append((await client.post(url, **target)).status_code)
            await send(message)

        await api.app(scope, receive, first_look)

    async def change() -> int:
        async with httpx.AsyncClient(transport=httpx.ASGITransport(spy), base_url="http://testserver") as own:
            answer = await own.patch(
                f"/api/v1/people/{person['id']}",
                json={"mission_roles": {mission.id: "scientist"}},
                headers={"If-Match": "*", "X-Outcrop-Person": "Administrator"},
            )
            return answer.status_code

    assert api.portal.call(change) == 200
    assert answered == [201]


# ---- repeats


def test_a_repeated_post_with_its_key_is_answered_and_not_done_again(api: Api, mission: Mission) -> None:
    url, key = f"/missions/{mission.id}/targets", {"Idempotency-Key": "k-1"}
    body = {"east_m": 1.0, "north_m": 1.0}
    first = api("POST", url, body, headers=key)
    second = api("POST", url, body, headers=key)
    assert (first.status_code, second.status_code) == (201, 201)
    assert first.json() == second.json()
    assert second.headers["idempotent-replay"] == "true"
    assert len(api.get(url)["items"]) == 1
    answer = api("POST", url, {**body, "east_m": 2.0}, headers=key)
    problem(answer, 422, "idempotency-key-reused")
    assert api("POST", url, body, headers=key, who="Scientist").json()["id"] != first.json()["id"]
