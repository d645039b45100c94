"""Packages that people signed, and the places they are for."""

from __future__ import annotations

import base64
import hashlib
import io
import json
import zipfile
from datetime import UTC, datetime, timedelta
from pathlib import Path
from typing import Any

from cryptography.hazmat.primitives.asymmetric.ed25519 import Ed25519PrivateKey

from executive.crl import canonical_text, parse
from ground.uplink.execute import Place
from ground.uplink.keys import id_of, public_text
from ground.uplink.package import manifest_text
from ground.uplink.training import Team, make_team, sign_package
from rover_iface.profile import standard_dictionary
from tests.rover_iface.worlds import small_problem

LANGUAGE = standard_dictionary()
PLAN = """(plan :id day :node (block :id all :node-list (
  (task :id go :action navigate :parameters (target = "T1") :continue-on-failure t)
  (task :id look :action image :parameters (target = "T1" instrument = "scicam")
    :metadata (observation = "T1-img") :continue-on-failure t)
  (task :id on :action navigate :parameters (target = "T2") :continue-on-failure t)
  (task :id rest :action wait :parameters (duration_s = 60)))))"""


def about(counter: int = 3, *, life: timedelta = timedelta(days=3), **more: Any) -> dict[str, Any]:
    """Return what a manifest says but for its files."""
    now = datetime.now(UTC)
    return {
        "mission": "M",
        "plan": "P",
        "counter": counter,
        "issued_utc": now.isoformat(timespec="seconds"),
        "expires_utc": (now + life).isoformat(timespec="seconds"),
        "terrain_sha256": "0" * 64,
        "dictionary": {"name": LANGUAGE.name, "version": LANGUAGE.version, "sha256": LANGUAGE.sha256},
        "profile": {"name": "k9", "version": "1", "sha256": "0" * 64},
        "models_sha256": "0" * 64,
        "verification": {"run": "R", "outcome": "SUCCEEDED", "trace_sha256": "0" * 64},
        "author": "Planner",
        **more,
    }


def parts(counter: int = 3, plan: str = PLAN, **more: Any) -> tuple[str, str, str]:
    """Return manifest, plan and landmarks of a package."""
    crl, landmarks = canonical_text(parse(plan)), '{"format": "landmarks/1"}\n'
    return manifest_text(about(counter, **more), crl, landmarks), crl, landmarks


def signed_package(team: Team, counter: int = 3, plan: str = PLAN, **more: Any) -> bytes:
    return sign_package(team, *parts(counter, plan, **more))


def small_world(folder: Path) -> Path:
    world = folder / "world"
    world.mkdir(parents=True)
    document = {"format": "world/1", "name": "small", "problem": small_problem()}
    (world / "world.json").write_text(json.dumps(document))
    return world


def small_site(folder: Path, **more: Any) -> tuple[Path, Place]:
    """Return a signed package and the place it is for."""
    team = make_team(folder / "keys", training=False)
    (folder / "package.zip").write_bytes(signed_package(team, **more))
    return folder / "package.zip", Place("abstract", small_world(folder), team.trust, seed=5)


def zipped(files: dict[str, bytes]) -> bytes:
    out = io.BytesIO()
    with zipfile.ZipFile(out, "w") as archive:
        for name, content in files.items():
            archive.writestr(name, content)
    return out.getvalue()


def unzipped(content: bytes) -> dict[str, bytes]:
    with zipfile.ZipFile(io.BytesIO(content)) as archive:
        return {name: archive.read(name) for name in archive.namelist()}


def package_1(key: Ed25519PrivateKey, *, sequence: int = 3, plan: str = PLAN) -> bytes:
    """Return a package as versions before 2026 made it: signed by one key of the server."""
    crl = canonical_text(parse(plan)).encode()
    files = {"plan.crl": crl, "landmarks.json": b"{}\n"}
    head = json.dumps(
        {
            "format": "package/1",
            "mission": "M",
            "plan": "P",
            "sequence": sequence,
            "crl_sha256": hashlib.sha256(crl).hexdigest(),
            "dictionary": {"name": LANGUAGE.name, "version": LANGUAGE.version},
            "author": "Planner",
            "approver": "Flight Director",
            "files": {name: hashlib.sha256(content).hexdigest() for name, content in files.items()},
        }
    ).encode()
    signature = {
        "algorithm": "ed25519",
        "key": id_of(public_text(key)),
        "signature": base64.b64encode(key.sign(head)).decode(),
    }
    return zipped({"manifest.json": head, **files, "signature.json": json.dumps(signature).encode()})
