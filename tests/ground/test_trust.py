"""A rover carries out what enough of the right people signed, by a trust file that needs no server."""

from __future__ import annotations

import ast
import base64
import json
import sys
import time
from collections.abc import Callable
from datetime import UTC, datetime, timedelta
from pathlib import Path
from typing import Any

import pytest
from cryptography.hazmat.primitives.asymmetric.ed25519 import Ed25519PrivateKey

from ground.errors import AlreadyExecutedError, ArchiveError, ForbiddenError, InvalidInputError
from ground.uplink import verify
from ground.uplink.admission import commission
from ground.uplink.execute import Place, execute_package
from ground.uplink.keys import id_of, load_key, make_key, public_text, sign
from ground.uplink.package import Signature, write_package
from ground.uplink.training import ROOT, Team, make_team
from ground.uplink.trust import allow, change_trust, new_trust, require, revoke, write_trust
from ground.uplink.verify import RefusedError, read_package, read_trust, verify_package
from tests.ground.signed import package_1, parts, signed_package, small_site, small_world, unzipped, zipped

NOW = datetime.now(UTC)


@pytest.fixture
def team(tmp_path: Path) -> Team:
    return make_team(tmp_path / "keys", training=False)


def checked(content: bytes, team: Team, now: datetime = NOW) -> verify.Package:
    return verify_package(content, read_trust(team.trust.read_bytes()), now)


def root_of(team: Team) -> Ed25519PrivateKey:
    return load_key(team.trust.parent / ROOT)


def change(team: Team, edit: Callable[[dict[str, Any]], None], *roots: Ed25519PrivateKey) -> None:
    signers = roots or (root_of(team),)
    team.trust.write_bytes(change_trust(team.trust.read_bytes(), signers, edit))


def with_signers(*signers: tuple[str, Ed25519PrivateKey], **more: Any) -> bytes:
    manifest, crl, landmarks = parts(**more)
    signatures = [
        Signature(role, id_of(public_text(key)), sign(key, "package/2", role, manifest.encode()))
        for role, key in signers
    ]
    return write_package(manifest, crl, landmarks, signatures)


def test_a_package_names_the_people_who_signed_it(team: Team) -> None:
    found = checked(signed_package(team), team)
    assert (found.mission, found.counter) == ("M", 3)
    planner, director = ("Planner",), ("Flight Director",)
    assert found.signers == {"author": planner, "verifier": planner, "approver": director}


@pytest.mark.parametrize("lacking", ["author", "verifier", "approver"])
def test_a_package_without_one_of_the_three_signatures_is_refused(team: Team, lacking: str) -> None:
    keys = {"author": team.author, "verifier": team.author, "approver": team.approver}
    content = with_signers(*((role, key) for role, key in keys.items() if role != lacking))
    with pytest.raises(RefusedError, match=f"needs {lacking} signatures of 1 trusted people, has 0"):
        checked(content, team)


def test_an_author_does_not_approve_even_with_the_role_or_a_second_key(team: Team) -> None:
    second = Ed25519PrivateKey.generate()

    def edit(document: dict[str, Any]) -> None:
        allow(document, "Planner", public_text(team.author), ["approver"])
        allow(document, "Planner", public_text(second), ["approver"])

    change(team, edit)
    for key in (team.author, second):
        content = with_signers(("author", team.author), ("verifier", team.author), ("approver", key))
        with pytest.raises(RefusedError, match="Planner is its author"):
            checked(content, team)


def test_a_signature_counts_only_for_the_role_it_was_given_in(team: Team) -> None:
    files = unzipped(with_signers(("author", team.approver), ("verifier", team.author)))
    document = json.loads(files["signatures.json"])
    document["signatures"] += [{**document["signatures"][0], "role": "approver"}]
    files["signatures.json"] = json.dumps(document).encode()
    change(team, lambda d: allow(d, "Flight Director", public_text(team.approver), ["author"]))
    with pytest.raises(RefusedError, match="approver signatures"):
        checked(zipped(files), team)


def test_two_approvers_can_be_asked_for(team: Team) -> None:
    other = Ed25519PrivateKey.generate()
    change(team, lambda d: (allow(d, "Ada", public_text(other), ["approver"]), require(d, "approver", 2))[-1])
    base = (("author", team.author), ("verifier", team.author), ("approver", team.approver))
    with pytest.raises(RefusedError, match="of 2 trusted people, has 1"):
        checked(with_signers(*base), team)
    assert checked(with_signers(*base, ("approver", other)), team).signers["approver"] == (
        "Ada",
        "Flight Director",
    )


def test_the_author_who_is_named_is_the_one_who_signed(team: Team) -> None:
    with pytest.raises(RefusedError, match="names as author 'Somebody'"):
        checked(signed_package(team, author="Somebody"), team)


def test_every_altered_byte_of_the_content_is_noticed(team: Team) -> None:
    content = signed_package(team)
    files = unzipped(content)
    for name, text in files.items():
        for place in range(0, len(text), 41):
            harmed = text[:place] + bytes([text[place] ^ 1]) + text[place + 1 :]
            if name == "signatures.json" and json_of(harmed) == json_of(text):
                continue
            with pytest.raises(RefusedError):
                checked(zipped({**files, name: harmed}), team)
    for place in range(0, len(content), 53):
        with pytest.raises(RefusedError):
            checked(content[:place], team)


def json_of(text: bytes) -> object:
    try:
        return json.loads(text)
    except ValueError:
        return None


def test_an_expired_package_is_refused(team: Team) -> None:
    before = datetime.now(UTC)
    content = signed_package(team, life=timedelta(hours=1))
    after = datetime.now(UTC)
    assert checked(content, team, before + timedelta(minutes=59))
    with pytest.raises(RefusedError, match="the package expired"):
        checked(content, team, after + timedelta(minutes=61))
    with pytest.raises(RefusedError, match="the trust file expired"):
        checked(signed_package(team, life=timedelta(days=900)), team, NOW + timedelta(days=400))


def test_a_trust_file_for_one_mission_accepts_no_other(tmp_path: Path) -> None:
    team = make_team(tmp_path / "keys", training=False)
    root = root_of(team)
    document = new_trust("rover", {"Root": root}, missions=["other"])
    team.trust.write_bytes(write_trust(document, [root]))
    with pytest.raises(RefusedError, match="not for packages of the mission M"):
        checked(signed_package(team), team)


# ---- package/1


def test_a_package_of_one_server_key_is_refused_unless_the_trust_file_allows_it_by_name(team: Team) -> None:
    server = Ed25519PrivateKey.generate()
    content = package_1(server)
    assert read_package(content).counter == 3
    with pytest.raises(RefusedError, match="package/1, which the trust file does not allow by name"):
        checked(content, team)
    change(team, lambda d: allow(d, "Server", public_text(server), ["package/1"]))
    assert checked(content, team).signers == {"package/1": ("Server",)}
    with pytest.raises(RefusedError, match="needs package/1 signatures"):
        checked(package_1(Ed25519PrivateKey.generate()), team)


def test_a_new_package_cannot_be_passed_off_as_an_old_one(team: Team) -> None:
    server = Ed25519PrivateKey.generate()
    change(team, lambda d: allow(d, "Server", public_text(server), ["package/1"]))
    files = unzipped(signed_package(team))
    head = files["manifest.json"].replace(b"package/2", b"package/1")
    del files["signatures.json"]
    mine = {
        "key": id_of(public_text(team.author)),
        "signature": base64.b64encode(team.author.sign(head)).decode(),
    }
    harmed = zipped({**files, "manifest.json": head, "signature.json": json.dumps(mine).encode()})
    with pytest.raises(RefusedError):
        checked(harmed, team)


# ---- the chain of versions


def test_a_version_needs_the_old_root_and_the_new(team: Team) -> None:
    new = Ed25519PrivateKey.generate()
    old = root_of(team)

    def rotate(document: dict[str, Any]) -> None:
        allow(document, "Root", public_text(new), ["root"])
        revoke(document, id_of(public_text(old)))

    for too_few in ((new,), (old,), (Ed25519PrivateKey.generate(), new)):
        with pytest.raises(InvalidInputError, match="needs root signatures"):
            change_trust(team.trust.read_bytes(), too_few, rotate)
    change(team, rotate, old, new)
    assert read_trust(team.trust.read_bytes()).version == 2
    with pytest.raises(InvalidInputError, match="needs root signatures"):  # the old one has no say any more
        change_trust(team.trust.read_bytes(), [old], lambda d: require(d, "author", 1))


def test_a_revoked_key_signs_nothing_any_more_and_the_old_file_is_refused(tmp_path: Path) -> None:
    package, place = small_site(tmp_path)
    team = Team(load_key(tmp_path / "keys/author.key"), load_key(tmp_path / "keys/approver.key"), place.trust)
    before = place.trust.read_bytes()
    execute_package(package, place, tmp_path / "run")
    change(team, lambda d: revoke(d, id_of(public_text(team.approver))))
    package.write_bytes(signed_package(team, counter=4))
    with pytest.raises(ArchiveError, match="needs approver signatures"):
        execute_package(package, place, tmp_path / "revoked")
    place.trust.write_bytes(before)
    with pytest.raises(ArchiveError, match="older than, or another than, the one last used"):
        execute_package(package, place, tmp_path / "rolled-back")


def test_a_foreign_trust_file_is_refused_by_a_rover_that_knows_one(tmp_path: Path) -> None:
    package, place = small_site(tmp_path)
    execute_package(package, place, tmp_path / "run")
    foreign = make_team(tmp_path / "foreign", training=False)
    package.write_bytes(signed_package(foreign, counter=9))
    with pytest.raises(ArchiveError, match="another than, the one last used"):
        execute_package(package, Place("abstract", place.world, foreign.trust), tmp_path / "other")
    with pytest.raises(ForbiddenError, match="bound to another trust file"):
        commission(place.world, foreign.trust)


def test_a_training_file_counts_only_where_it_was_installed(tmp_path: Path) -> None:
    team = make_team(tmp_path / "keys")
    world = small_world(tmp_path)
    (tmp_path / "package.zip").write_bytes(signed_package(team))
    place = Place("abstract", world, team.trust, 5)
    with pytest.raises(ArchiveError, match="for training"):
        execute_package(tmp_path / "package.zip", place, tmp_path / "run")
    commission(world, team.trust)
    assert execute_package(tmp_path / "package.zip", place, tmp_path / "run")[1].outcome.outcome is not None


@pytest.mark.parametrize(
    "harm",
    [
        lambda d: d.update(version=2),
        lambda d: d.update(training="no"),
        lambda d: d.update(missions=[1]),
        lambda d: d.update(expires_utc="2030-01-01"),
        lambda d: d.update(expires_utc="9999-12-31T23:59:59-23:59"),
        lambda d: d["roles"].pop("approver"),
        lambda d: d["roles"]["author"].update(threshold=0),
        lambda d: d["roles"]["author"].update(threshold=True),
        lambda d: d["roles"]["author"].update(keys=["0" * 16]),
        lambda d: next(iter(d["keys"].values())).update(person="\ud800"),
        lambda d: next(iter(d["keys"].values())).update(public="AAAA"),
        lambda d: d.update(keys=[]),
        lambda d: d.update(roles=None),
    ],
)
def test_a_malformed_version_is_refused_in_a_sentence(
    team: Team, harm: Callable[[dict[str, Any]], None]
) -> None:
    whole = json.loads(team.trust.read_bytes())
    document = json.loads(whole["versions"][0]["signed"])
    harm(document)
    text = json.dumps(document)
    whole["versions"][0] = {
        "signed": text,
        "signatures": [
            {
                "key": id_of(public_text(root_of(team))),
                "signature": sign(root_of(team), "trust/1", "root", text.encode()),
            }
        ],
    }
    with pytest.raises(RefusedError, match="of the trust file"):
        read_trust(json.dumps(whole).encode())


@pytest.mark.parametrize(
    "content",
    [b"", b"[]", b"{}", b"\xff", b"[" * 200_000, b'{"format":"trust/1"}',
     b'{"format":"trust/1","versions":[]}',
     b'{"format":"trust/1","versions":[1]}', b'{"format":"trust/1","versions":[{"signed":"\\ud800"}]}',
     b'{"format":"trust/1","versions":[{"signed":"{}","signatures":7}]}'],
)  # fmt: skip
def test_any_bytes_are_a_trust_file_or_refused_in_a_sentence(content: bytes) -> None:
    with pytest.raises(RefusedError, match=r"^[^\n]{10,200}$"):
        read_trust(content)


@pytest.mark.parametrize(
    ("name", "value"),
    [("counter", "3"), ("counter", True), ("counter", 0), ("counter", 10**30), ("mission", 7),
     ("mission", "a\nb"), ("plan", None), ("expires_utc", 5), ("expires_utc", "soon"),
     ("author", ["Planner"]), ("files", [])],
)  # fmt: skip
def test_a_member_of_the_wrong_kind_is_refused_though_it_is_signed(
    team: Team, name: str, value: object
) -> None:
    manifest, crl, landmarks = parts()
    manifest = json.dumps({**json.loads(manifest), name: value})
    from ground.uplink.training import sign_package

    with pytest.raises(RefusedError, match=r"^[^\n]{10,200}$"):
        checked(sign_package(team, manifest, crl, landmarks), team)


# ---- keys


def test_a_private_key_is_its_owners_alone_and_never_overwritten(tmp_path: Path) -> None:
    from ground.errors import ConflictError, UnavailableError

    path = tmp_path / "new" / "ada.key"
    make_key(path)
    assert path.stat().st_mode & 0o777 == 0o600
    with pytest.raises(ConflictError, match="never overwritten"):
        make_key(path)
    path.chmod(0o640)
    with pytest.raises(UnavailableError, match="others may read the key"):
        load_key(path)


# ---- the verifier itself


def test_the_verifier_is_small_and_needs_cryptography_alone() -> None:
    source = Path(verify.__file__).read_text(encoding="utf-8")
    assert len(source.splitlines()) <= 300
    tree = ast.parse(source)
    named = {a.name for n in ast.walk(tree) if isinstance(n, ast.Import) for a in n.names}
    named |= {str(n.module) for n in ast.walk(tree) if isinstance(n, ast.ImportFrom)}
    others = {name.split(".")[0] for name in named} - set(sys.stdlib_module_names)
    assert others == {"cryptography"}


def test_an_offline_check_takes_at_most_fifty_milliseconds(team: Team) -> None:
    content, trust = signed_package(team), team.trust.read_bytes()

    def seconds() -> float:
        begin = time.process_time()
        verify_package(content, read_trust(trust), NOW)
        return time.process_time() - begin

    assert sorted(seconds() for _ in range(5))[2] <= 0.05


# ---- once


def test_a_package_repacked_or_older_is_refused(tmp_path: Path) -> None:
    package, place = small_site(tmp_path)
    execute_package(package, place, tmp_path / "run")
    package.write_bytes(zipped(unzipped(package.read_bytes())))
    with pytest.raises(AlreadyExecutedError, match="executed before, or the same in another file"):
        execute_package(package, place, tmp_path / "again")


def test_a_clock_that_was_set_back_revives_no_package(tmp_path: Path) -> None:
    package, place = small_site(tmp_path)
    team = Team(load_key(tmp_path / "keys/author.key"), load_key(tmp_path / "keys/approver.key"), place.trust)
    execute_package(package, place, tmp_path / "run", clock=lambda: NOW + timedelta(days=2))
    package.write_bytes(signed_package(team, counter=4, life=timedelta(days=1)))
    with pytest.raises(ArchiveError, match="the package expired"):
        execute_package(package, place, tmp_path / "late", clock=lambda: NOW)


def test_formats_are_published_and_what_is_written_keeps_to_them(team: Team) -> None:
    jsonschema = pytest.importorskip("jsonschema")
    formats = Path(__file__).parents[2] / "docs" / "formats"
    package, trust = (
        json.loads((formats / f"{n}.schema.json").read_text()) for n in ("package-2", "trust-1")
    )
    files = unzipped(signed_package(team))
    jsonschema.validate(json.loads(files["manifest.json"]), package)
    signatures = {**package["$defs"]["signatures"], "$defs": package["$defs"]}
    jsonschema.validate(json.loads(files["signatures.json"]), signatures)
    whole = json.loads(team.trust.read_text())
    jsonschema.validate(whole, trust)
    version = {**trust["$defs"]["version"], "$defs": trust["$defs"]}
    jsonschema.validate(json.loads(whole["versions"][0]["signed"]), version)
