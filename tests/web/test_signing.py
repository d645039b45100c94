"""The page that checks packages from disk says what the rover's own check says."""

from __future__ import annotations

from datetime import UTC, datetime, timedelta
from pathlib import Path

import pytest
from cryptography.hazmat.primitives.asymmetric.ed25519 import Ed25519PrivateKey
from playwright.sync_api import Page, expect

from ground.uplink.keys import id_of, load_key, public_text
from ground.uplink.training import Team, make_team
from ground.uplink.trust import allow, change_trust, revoke
from ground.uplink.verify import RefusedError, read_trust, verify_package
from tests.ground.signed import package_1, signed_package, unzipped, zipped
from tests.web.conftest import ROOT
from tests.web.page import chromium

pytestmark = pytest.mark.browser
CHECKER = ROOT / "web" / "public" / "check-package.html"


def judged(page: Page, folder: Path, content: bytes, trust: bytes) -> bool:
    """Return whether the page lets a package pass."""
    (folder / "package.zip").write_bytes(content)
    (folder / "trust.json").write_bytes(trust)
    page.goto(CHECKER.as_uri())
    page.get_by_label("Package").set_input_files(folder / "package.zip")
    page.get_by_label("Trust file").set_input_files(folder / "trust.json")
    verdict = page.get_by_role("status")
    expect(verdict).to_have_class("good" if _accepted(content, trust) else "bad")
    text = verdict.inner_text()
    assert text.startswith(("Package", "Refused: "))
    return text.startswith("Package")


def _accepted(content: bytes, trust: bytes) -> bool:
    try:
        verify_package(content, read_trust(trust), datetime.now(UTC))
    except RefusedError:
        return False
    return True


def variants(team: Team) -> dict[str, tuple[bytes, bytes]]:
    """Return packages and trust files, sound and otherwise, by what was done to them."""
    whole, trust = signed_package(team), team.trust.read_bytes()
    root = load_key(team.trust.parent / "root.key")
    files = unzipped(whole)
    late = signed_package(team, life=timedelta(seconds=-1))
    gone = change_trust(trust, [root], lambda d: revoke(d, id_of(public_text(team.approver))))
    other = Ed25519PrivateKey.generate()
    more = change_trust(trust, [root], lambda d: allow(d, "Ada", public_text(other), ["approver"]))
    text = files["plan.crl"].replace(b"T1", b"T2")
    return {
        "sound": (whole, trust),
        "stored, not deflated": (zipped(files), trust),
        "a later version": (whole, more),
        "text changed": (zipped({**files, "plan.crl": text}), trust),
        "a file too many": (zipped({**files, "more": b""}), trust),
        "a signature of nobody": (zipped({**files, "signatures.json": b'{"signatures": []}'}), trust),
        "expired": (late, trust),
        "approver revoked": (whole, gone),
        "signed by others": (signed_package(make_team(team.trust.parent / "others", training=False)), trust),
        "package/1": (package_1(other), trust),
        "cut off": (whole[: len(whole) // 2], trust),
        "trust file changed": (whole, trust.replace(b"Flight Director", b"Fright Director")),
        "no trust file": (whole, b"{}"),
    }


def test_the_page_and_the_rover_agree_on_every_package(tmp_path: Path) -> None:
    team = make_team(tmp_path / "keys", training=False)
    with chromium() as browser:
        page = browser.new_page()
        for name, (content, trust) in variants(team).items():
            assert judged(page, tmp_path, content, trust) == _accepted(content, trust), name
