"""The server signs for nobody: forged rows, archives and signatures never become an approval or a package."""

from __future__ import annotations

import copy
import hashlib
import io
import json
import shutil
import zipfile
from collections.abc import Callable, Iterator
from contextlib import contextmanager
from pathlib import Path
from typing import Any

import pytest
from cryptography.hazmat.primitives.asymmetric.ed25519 import Ed25519PrivateKey
from sqlalchemy import update

from executive.crl import canonical_text, digest, parse
from ground.gdr.history import GENESIS
from ground.gdr.repository import open_repository
from ground.resources.approvals.row import ApprovalRow
from ground.resources.packages.row import SignatureRow, StatementRow
from ground.resources.people.accounts import ensure_profiles
from ground.resources.plans.row import PlanRow
from ground.resources.problems.row import ProblemRow
from ground.uplink.keys import id_of, public_text, sign
from ground.uplink.training import Team
from ground.uplink.verify import read_package
from tests.ground.approving import forged, hand_in, registered, signed_by_all, team_of, waived
from tests.ground.conftest import Api, open_api, settings_for, yard
from tests.ground.planning import file_requests, finished, planned
from tests.ground.test_missions_api import problem, upload

EVIL = canonical_text(parse("(plan :id p :node (task :id go :action safemode))"))


@pytest.fixture(scope="module")
def day(
    sqlite_template: Path, terrain_folder: Path, tmp_path_factory: pytest.TempPathFactory
) -> tuple[Path, dict[str, Any]]:
    """Give a data folder with a verified plan of Planner's, and the plan."""
    folder = tmp_path_factory.mktemp("verified")
    shutil.copyfile(sqlite_template, folder / "outcrop.db")
    repo = open_repository(settings_for(folder))
    ensure_profiles(repo)
    with contextmanager(open_api)(repo) as api:
        mission = yard(repo, terrain_folder)
        file_requests(api, mission)
        plan = planned(api, mission)
        order = {"plan_id": plan["id"], "seed": 4}
        finished(api, api.post(f"/missions/{mission.id}/runs", order, status=202))
    repo.database.dispose()
    return folder, plan


@pytest.fixture
def verified(day: tuple[Path, dict[str, Any]], tmp_path: Path) -> Iterator[tuple[Api, dict[str, Any]]]:
    """Give a verified plan of Planner's in a copy of its own."""
    shutil.copytree(day[0], tmp_path / "data")
    repo = open_repository(settings_for(tmp_path / "data"))
    with contextmanager(open_api)(repo) as api:
        yield api, copy.deepcopy(day[1])
    repo.database.dispose()


def tampered(api: Api, plan: str, **columns: Any) -> None:
    """Change a plan's row behind the server's back."""
    with api.repo.database.write() as session:
        session.execute(update(PlanRow).where(PlanRow.id == plan).values(**columns))


def test_rules_look_at_what_the_text_observes_and_not_at_a_list_that_came_with_it(
    verified: tuple[Api, dict[str, Any]],
) -> None:
    """An archive's author writes the list of planned requests too: an empty one passed every rule."""
    api, plan = verified
    url = f"/plans/{plan['id']}/flight-rules"
    before = api.get(url)
    assert {r["rule"]: r["value"] for r in before}["FR-ARM"] > 0.0
    tampered(api, plan["id"], planned_request_ids=[])
    assert api.get(url) == before


def test_a_rule_whose_facts_are_absent_does_not_hold(verified: tuple[Api, dict[str, Any]]) -> None:
    api, plan = verified
    with api.repo.database.write() as session:
        row = session.get_one(ProblemRow, session.get_one(PlanRow, plan["id"]).problem_id)
        document = copy.deepcopy(row.document)
        for target in document["targets"]:
            target.pop("observation_point")
        row.document = document
    found = {r["rule"]: r for r in api.get(f"/plans/{plan['id']}/flight-rules")}
    assert not found["FR-TILT"]["holds"]
    assert "no observation_point" in found["FR-TILT"]["detail"]


def test_text_that_was_changed_after_the_approval_never_leaves(
    verified: tuple[Api, dict[str, Any]], tmp_path: Path
) -> None:
    api, plan = verified
    signed_by_all(api, plan["id"], team_of(tmp_path / "keys"))
    tampered(api, plan["id"], crl_text=EVIL)
    answer = problem(api("POST", f"/plans/{plan['id']}/package", who="Operator"), 409, "wrong-state")
    assert "was changed since it was computed" in answer["detail"]
    tampered(api, plan["id"], crl_sha256=hashlib.sha256(EVIL.encode()).hexdigest())
    problem(api("POST", f"/plans/{plan['id']}/package", who="Operator"), 409, "wrong-state")


def test_an_approval_written_into_the_database_signs_nothing(
    verified: tuple[Api, dict[str, Any]], tmp_path: Path
) -> None:
    api, plan = verified
    team = team_of(tmp_path / "keys")
    for role in ("author", "verifier"):
        assert hand_in(api, plan["id"], role, "Planner", team.author).status_code == 201
    with api.repo.database.write() as session:
        (statement,) = session.query(StatementRow).all()
        common = {"author": "Flight Director", "mission_id": plan["mission_id"]}
        digests = {f"{name}_sha256": "0" * 64 for name in ("crl", "terrain", "dictionary", "models")}
        session.add(ApprovalRow(id="apv-forged", plan_id=plan["id"], **digests, **common))
        row = {"statement_id": statement.id, "role": "approver", "key_id": id_of(public_text(team.author))}
        session.add(SignatureRow(id="sgn-forged", signature=forged(), **row, **common))
    tampered(api, plan["id"], state="approved", approved_by="Flight Director")
    answer = problem(api("POST", f"/plans/{plan['id']}/package", who="Operator"), 409, "wrong-state")
    assert "lacks the signature of its approver" in answer["detail"]


def test_a_key_signs_for_its_owner_alone(verified: tuple[Api, dict[str, Any]], tmp_path: Path) -> None:
    api, plan = verified
    team = team_of(tmp_path / "keys")
    waived(api, plan["id"])
    registered(api, "Planner", team.author)
    mine = public_text(team.author)
    proof = sign(team.author, "signing-key/1", "owner", b"Flight Director")
    taken = api("POST", "/signing-keys", {"public": mine, "proof": proof}, who="Flight Director")
    problem(taken, 409, "conflict")
    unproved = {"public": public_text(team.approver), "proof": forged()}
    problem(api("POST", "/signing-keys", unproved, who="Flight Director"), 422, "invalid-input")
    statement = api.post(f"/plans/{plan['id']}/statement", None)
    body = {
        "role": "approver",
        "sha256": statement["sha256"],
        "key": id_of(mine),
        "signature": sign(team.author, "package/2", "approver", statement["manifest"].encode()),
    }
    url = f"/plans/{plan['id']}/signatures"
    answer = problem(api("POST", url, body, who="Flight Director"), 422, "invalid-input")
    assert "has no key" in answer["detail"]
    registered(api, "Flight Director", team.approver)
    for wrong in (forged(), sign(team.approver, "package/2", "author", statement["manifest"].encode())):
        other = {**body, "key": id_of(public_text(team.approver)), "signature": wrong}
        answer = problem(api("POST", url, other, who="Flight Director"), 422, "invalid-input")
        assert "is not that of the key" in answer["detail"]
    assert api.get(f"/plans/{plan['id']}")["state"] == "verified"


def test_a_revoked_key_is_refused_and_stays_in_the_list(
    verified: tuple[Api, dict[str, Any]], tmp_path: Path
) -> None:
    api, plan = verified
    key = Ed25519PrivateKey.generate()
    name = registered(api, "Planner", key)
    assert api("DELETE", f"/signing-keys/{name}", who="Scientist").status_code == 403
    assert api("DELETE", f"/signing-keys/{name}", who="Planner").status_code == 204
    statement = api.post(f"/plans/{plan['id']}/statement", None)
    signature = sign(key, "package/2", "author", statement["manifest"].encode())
    body = {"role": "author", "sha256": statement["sha256"], "key": name, "signature": signature}
    problem(api("POST", f"/plans/{plan['id']}/signatures", body), 422, "invalid-input")
    (listed,) = api.get("/signing-keys")
    assert listed["revoked_utc"] is not None


def test_only_author_and_verifier_sign_as_such_and_once(
    verified: tuple[Api, dict[str, Any]], tmp_path: Path
) -> None:
    api, plan = verified
    team: Team = team_of(tmp_path / "keys")
    for role in ("author", "verifier"):
        problem(hand_in(api, plan["id"], role, "Flight Director", team.approver), 403, "forbidden")
        assert hand_in(api, plan["id"], role, "Planner", team.author).status_code == 201
        problem(hand_in(api, plan["id"], role, "Planner", team.author), 409, "conflict")


def test_what_is_signed_stays_until_something_it_names_changes(
    verified: tuple[Api, dict[str, Any]], tmp_path: Path, monkeypatch: pytest.MonkeyPatch
) -> None:
    api, plan = verified
    url = f"/plans/{plan['id']}/statement"
    assert api.get(url) is None
    first = api.post(url, None)
    assert api.post(url, None) == first == api.get(url)
    finished(
        api, api.post(f"/missions/{plan['mission_id']}/runs", {"plan_id": plan["id"], "seed": 9}, status=202)
    )
    assert api.post(url, None) == first  # another dry run takes nothing away
    monkeypatch.setattr("ground.resources.packages.statement.models_digest", lambda _profile: "1" * 64)
    assert api.get(url)["current"] is False
    second = api.post(url, None)
    assert (second["counter"], second["current"]) == (first["counter"] + 1, True)


# ---- archives


def archive_of(api: Api, mission: str, change: Callable[[dict[str, Any]], None]) -> bytes:
    """Return an archive of a mission whose rows were changed, with its hashes made to fit."""
    whole = api("GET", f"/missions/{mission}/archive").content
    with zipfile.ZipFile(io.BytesIO(whole)) as source:
        files = {name: source.read(name) for name in source.namelist()}
    rows = json.loads(files["rows.json"])
    change(rows)
    files["rows.json"] = json.dumps(rows).encode()
    manifest = json.loads(files["manifest.json"])
    manifest["files"]["rows.json"] = hashlib.sha256(files["rows.json"]).hexdigest()
    files["manifest.json"] = json.dumps(manifest).encode()
    out = io.BytesIO()
    with zipfile.ZipFile(out, "w") as target:
        for name, content in files.items():
            target.writestr(name, content)
    return out.getvalue()


def without_history(rows: dict[str, Any]) -> None:
    rows["events"] = []
    rows["event_chains"][0] |= {"seq": 0, "sha256": GENESIS}


def brought_in(api: Api, mission: str, content: bytes) -> Any:
    gone = api("DELETE", f"/missions/{mission}", headers={"If-Match": "*"}, who="Administrator")
    assert gone.status_code == 204
    return api("POST", "/missions/import", {"upload_id": upload(api, "m.zip", content)})


def test_an_archive_in_which_somebody_approved_a_plan_approves_nothing(
    verified: tuple[Api, dict[str, Any]],
) -> None:
    api, plan = verified
    mission = plan["mission_id"]

    def forge(rows: dict[str, Any]) -> None:
        (row,) = rows["plans"]
        row |= {"crl_text": EVIL, "crl_sha256": digest(parse(EVIL)), "state": "approved"}
        row |= {"approved_by": "Flight Director", "author": "Nobody"}
        rows["runs"][0]["crl_sha256"] = row["crl_sha256"]
        stamp = {k: row[k] for k in ("created_utc", "modified_utc", "mission_id", "terrain_sha256")}
        approval = {
            "id": "apv-1",
            "plan_id": row["id"],
            "author": "Flight Director",
            "revision": 1,
            "note": "",
        }
        others = {"dictionary_sha256": "0" * 64, "models_sha256": "0" * 64, "crl_sha256": row["crl_sha256"]}
        rows["approvals"] = [{**stamp, **approval, **others}]
        without_history(rows)

    assert brought_in(api, mission, archive_of(api, mission, forge)).status_code == 201
    found = api.get(f"/plans/{plan['id']}")
    assert (found["state"], found["approved_by"], found["author"]) == ("computed", None, "Planner")
    assert api.get(f"/missions/{mission}/approvals")["items"] == []
    problem(api("POST", f"/plans/{plan['id']}/package", who="Operator"), 409, "wrong-state")
    problem(api("POST", f"/plans/{plan['id']}/statement"), 409, "wrong-state")
    (elsewhere,) = api.get(f"/missions/{mission}/elsewhere")
    assert elsewhere["document"]["approvals"][0]["author"] == "Flight Director"
    assert elsewhere["document"]["states"] == {plan["id"]: "approved"}


def _generous(rows: dict[str, Any]) -> None:
    """Let the problem of an archive say what every rule likes; its text and digests stay as they are."""
    for row in rows["problems"]:
        document = row["document"]
        document["budget"] |= {"energy_j": 1.0, "time_s": 1.0}
        for target in document["targets"]:
            target["observation_point"] |= {"east_m": target["point_m"][0], "north_m": target["point_m"][1]}


def test_the_problem_of_an_archive_decides_no_rule(
    verified: tuple[Api, dict[str, Any]], tmp_path: Path
) -> None:
    """Whoever writes an archive writes its problem too, with the digests that fit."""
    api, plan = verified
    mission = plan["mission_id"]
    assert brought_in(api, mission, archive_of(api, mission, _generous)).status_code == 201
    order = {"plan_id": plan["id"], "runs": 150, "seed": 5}
    api.post(f"/missions/{mission}/campaigns", order, status=202)
    api.jobs()
    side = {"plan_id": plan["id"]}
    body = {"base": side, "ours": side, "theirs": side}
    merged = api.post(f"/missions/{mission}/plan-merges", body, status=200)["plan"]
    for held in (plan["id"], merged["id"]):  # a merged plan has the problem of the one it began with
        found = {r["rule"]: r for r in api.get(f"/plans/{held}/flight-rules")}
        crl = found.pop("FR-CRL")
        assert crl["holds"], crl
        for rule in found.values():
            assert (rule["holds"], rule["value"]) == (False, None), rule
            assert "came with an archive" in rule["detail"], rule
    order = {"plan_id": plan["id"], "seed": 4}
    finished(api, api.post(f"/missions/{mission}/runs", order, status=202))
    signed_by_all(api, plan["id"], team_of(tmp_path / "keys"))  # each rule waived, with a reason


def test_the_charge_of_an_imported_plan_is_that_of_its_sol(verified: tuple[Api, dict[str, Any]]) -> None:
    """A problem of an archive that grants a million joules hid that the plan falls below its floor."""
    api, plan = verified
    mission = plan["mission_id"]
    text = canonical_text(
        parse(
            "(plan :id p :resources ((energy :consumable :key :battery-energy :floor 20000))"
            " :node (task :id a :action safemode :expectations ((energy -1000 0))))"
        )
    )

    def harm(rows: dict[str, Any]) -> None:
        rows["problems"][0]["document"]["budget"]["energy_j"] = 1e9
        rows["sols"][0]["energy_budget_j"] = 1.0
        rows["plans"][0] |= {"crl_text": text, "crl_sha256": digest(parse(text))}
        rows["runs"][0]["crl_sha256"] = digest(parse(text))
        without_history(rows)

    assert brought_in(api, mission, archive_of(api, mission, harm)).status_code == 201
    assert "W064" in {f["code"] for f in api.get(f"/plans/{plan['id']}/findings")}


def test_a_dry_run_of_elsewhere_verifies_nothing_here(
    verified: tuple[Api, dict[str, Any]], tmp_path: Path
) -> None:
    api, plan = verified
    mission = plan["mission_id"]
    whole = archive_of(api, mission, lambda _rows: None)
    assert brought_in(api, mission, whole).status_code == 201
    tampered(api, plan["id"], state="verified")
    problem(api("POST", f"/plans/{plan['id']}/statement"), 409, "wrong-state")
    tampered(api, plan["id"], state="computed")
    (run,) = api.get(f"/missions/{mission}/runs")["items"]
    assert (run["elsewhere"], run["author"]) == (True, "Planner (elsewhere)")
    order = {"plan_id": plan["id"], "seed": 4}
    finished(api, api.post(f"/missions/{mission}/runs", order, status=202))
    signed_by_all(api, plan["id"], team_of(tmp_path / "keys"))


def test_what_comes_back_differs_from_what_went_out_in_rights_and_names_alone(
    verified: tuple[Api, dict[str, Any]], tmp_path: Path
) -> None:
    """Export, delete, import: these differences, and no other."""
    api, plan = verified
    mission = plan["mission_id"]
    signed_by_all(api, plan["id"], team_of(tmp_path / "keys"))
    packed = api("POST", f"/plans/{plan['id']}/package", who="Operator").content
    seen: list[dict[str, Any]] = []
    whole = archive_of(api, mission, lambda rows: seen.append(copy.deepcopy(rows)))
    assert brought_in(api, mission, whole).status_code == 201
    archive_of(api, mission, lambda rows: seen.append(copy.deepcopy(rows)))
    before, after = seen
    assert set(before) == set(after)
    rights = {"approvals", "waivers", "packages", "statements", "signatures"}
    for name in rights:
        assert after[name] == []
    assert len(after["elsewhere"]) == 1
    assert {name: before[name] for name in rights} == {
        name: after["elsewhere"][0]["document"][name] for name in rights
    }
    differences: set[tuple[str, str]] = set()
    for name in set(before) - rights - {"elsewhere", "events", "event_chains"}:
        assert len(before[name]) == len(after[name]), name
        for old, new in zip(before[name], after[name], strict=True):
            differences |= {(name, key) for key in old if old[key] != new[key]}
    assert {key for _, key in differences} == {"author", "state", "approved_by", "elsewhere", "job_id"}
    assert {d for d in differences if d[1] != "author"} == {
        ("plans", "state"),
        ("plans", "approved_by"),
        ("plans", "elsewhere"),
        ("runs", "elsewhere"),
        ("runs", "job_id"),
    }
    assert ("plans", "author") not in differences  # its author brought it back
    counter = read_package(packed).counter
    order = {"plan_id": plan["id"], "seed": 4}
    finished(api, api.post(f"/missions/{mission}/runs", order, status=202))
    assert api.post(f"/plans/{plan['id']}/statement", None)["counter"] == counter + 1


def _odd_digest(rows: dict[str, Any]) -> None:
    rows["plans"][0]["crl_text"] = EVIL


def _stranger_file(rows: dict[str, Any]) -> None:
    rows["products"][0]["sha256"] = "../../../../etc/passwd"


MALFORMED: dict[str, Callable[[dict[str, Any]], None]] = {
    "a table that is not a list": lambda rows: rows.update(plans={}),
    "rows that are not objects": lambda rows: rows.update(plans=[1]),
    "two missions": lambda rows: rows["missions"].append(rows["missions"][0]),
    "no chain": lambda rows: rows.update(event_chains=[]),
    "a table too many": lambda rows: rows.update(people=[]),
    "a table too few": lambda rows: rows.pop("sols"),
    "a column too many": lambda rows: rows["plans"][0].update(power=1),
    "a column too few": lambda rows: rows["plans"][0].pop("name"),
    "a wrong type": lambda rows: rows["plans"][0].update(number="many"),
    "a wrong time": lambda rows: rows["plans"][0].update(created_utc="soon"),
    "an id twice": lambda rows: rows["targets"].append(rows["targets"][0]),
    "a history that is cut off": lambda rows: rows["events"].pop(),
    "events that are none": lambda rows: rows.update(events=[{"chain_id": rows["missions"][0]["id"]}]),
    "text of another digest": _odd_digest,
    "a file of another name": _stranger_file,
    "another terrain": lambda rows: rows["terrains"][0].update(sha256="0" * 64),
    "a counter that is none": lambda rows: rows.update(
        packages=[{"mission_id": rows["missions"][0]["id"], "sequence": "x", "sha256": "0" * 64}]
    ),
}


def test_a_malformed_archive_is_refused_in_a_sentence(verified: tuple[Api, dict[str, Any]]) -> None:
    api, plan = verified
    mission = plan["mission_id"]
    contents = {name: archive_of(api, mission, harm) for name, harm in MALFORMED.items()}
    gone = api("DELETE", f"/missions/{mission}", headers={"If-Match": "*"}, who="Administrator")
    assert gone.status_code == 204
    for name, content in contents.items():
        answer = api("POST", "/missions/import", {"upload_id": upload(api, "m.zip", content)})
        assert answer.status_code in {409, 422}, (name, answer.text)
        assert answer.headers["content-type"] == "application/problem+json", name
    assert api("GET", f"/missions/{mission}").status_code == 404
