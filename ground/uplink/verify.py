"""Check an uplink package offline, with nothing but the standard library and `cryptography`.

A package is worth what the people say who signed it, and a trust file says whose word counts for what. This
module is part of the on-board file and imports nothing else of ours; `docs/formats/` describes both formats.

`trust/1` is a chain of versions. The text of each is signed by enough root keys of the version before it and
of itself, so a rover that knows one version can follow to any later one and never back (the idea of the root
metadata of The Update Framework, https://theupdateframework.github.io/specification/latest/#root).
"""

from __future__ import annotations

import base64
import hashlib
import io
import json
import re
import zipfile
from collections.abc import Callable, Mapping, Set
from dataclasses import dataclass, replace
from datetime import UTC, datetime
from typing import Any

from cryptography.exceptions import InvalidSignature
from cryptography.hazmat.primitives.asymmetric.ed25519 import Ed25519PublicKey

PACKAGE, OLD_PACKAGE, TRUST = "package/2", "package/1", "trust/1"
MANIFEST, CRL, LANDMARKS = "manifest.json", "plan.crl", "landmarks.json"
SIGNATURES = {PACKAGE: "signatures.json", OLD_PACKAGE: "signature.json"}
SIGNERS = ("author", "verifier", "approver")
MAX_BYTES, MAX_SIGNATURES = 64 * 2**20, 100
MAX_COUNTER = 2**53 - 1
"""The largest integer that every reader of JSON keeps exactly (RFC 8259, section 6)."""

_ID, PERSON = re.compile(r"[A-Za-z0-9_.-]{1,80}"), re.compile(r"[^\W_](?:[\w .'-]{0,78}[\w.])?")


class RefusedError(Exception):
    """A package or trust file that must not be used; the message is one sentence for people."""


@dataclass(frozen=True, slots=True)
class Trust:
    """A trust file whose chain holds: newest version, and the SHA-256 of the text of each, first to last."""

    rover: str
    version: int
    training: bool
    chain: tuple[str, ...]
    missions: tuple[str, ...]
    keys: Mapping[str, Mapping[str, Any]]
    roles: Mapping[str, Mapping[str, Any]]
    expires_utc: datetime

    def people(self, role: str, valid: Callable[[str, Ed25519PublicKey], bool]) -> set[str]:
        """Return the people of a role for whose key `valid(key id, key)` holds."""
        named = self.roles.get(role, {}).get("keys", ())
        return {self.keys[k]["person"] for k in named if valid(k, public_key(self.keys[k]["public"]))}

    def threshold(self, role: str) -> int:
        """Return how many people have to sign for a role."""
        return int(self.roles[role]["threshold"])


@dataclass(frozen=True, slots=True)
class Package:
    """A package that holds together; `signers` are the people of each role that the trust file counted."""

    format: str
    manifest: Mapping[str, Any]
    crl_text: str
    landmarks: Mapping[str, Any]
    sha256: str
    mission: str
    counter: int
    signers: Mapping[str, tuple[str, ...]]


def key_id(public: bytes) -> str:
    """Return the name of a key: 16 hexadecimal digits of the SHA-256 of its 32 raw bytes."""
    return hashlib.sha256(public).hexdigest()[:16]


def public_key(text: str) -> Ed25519PublicKey:
    """Return the key of its raw bytes in base64."""
    return Ed25519PublicKey.from_public_bytes(base64.b64decode(text, validate=True))


def message(form: str, role: str, content: bytes) -> bytes:
    """Return the bytes a person signs: what they sign it as, then the content."""
    return f"outcrop {form} {role}\n".encode() + content


def signed_by(key: Ed25519PublicKey, signature: object, content: bytes) -> bool:
    """Return whether a signature, base64, is that of the key over the content."""
    try:
        key.verify(base64.b64decode(str(signature), validate=True), content)
    except (InvalidSignature, ValueError):
        return False
    return True


def read_trust(content: bytes, *, pinned: str | None = None) -> Trust:
    """Return the newest version of a trust file after following its chain from the first.

    `pinned` is the SHA-256 of the text of the version last used here.

    Raises
    ------
    RefusedError
        If the chain is broken, or does not hold the pinned version.
    """
    document = _object(content, "the trust file")
    found, entries = _show(document.get("format")), document.get("versions")
    _hold(document.get("format") == TRUST, f"the trust file has the format {found}, not {TRUST}")
    before: Trust | None = None
    for entry in entries if isinstance(entries, list) else ():
        text = entry.get("signed") if isinstance(entry, dict) else None
        raw = text.encode("utf-8", "surrogatepass") if isinstance(text, str) else b""
        trust = _version(raw, () if before is None else before.chain)
        given = _signatures(entry.get("signatures"), "the trust file")
        for holder in (before or trust, trust):
            _need(holder, "root", given, message(TRUST, "root", raw), f"version {trust.version}")
        same = before is None or (trust.training, trust.rover) == (before.training, before.rover)
        _hold(same, f"version {trust.version} of the trust file is for another rover")
        before = trust
    if before is None:
        raise RefusedError("the trust file has no version")
    later = pinned is None or pinned in before.chain
    _hold(later, "the trust file is older than, or another than, the one last used on this rover")
    return before


def read_package(content: bytes) -> Package:
    """Return a package of any version for reading; its digests hold, its signatures were not looked at."""
    return _open(content)[0]


def verify_package(content: bytes, trust: Trust, now_utc: datetime) -> Package:
    """Return a package that may be executed at `now_utc` by the word of enough people.

    Raises
    ------
    RefusedError
        If it is damaged, expired, for another rover, or too few of the right people signed it.
    """
    package, files = _open(content)
    what, head, form = "the package", files[MANIFEST], package.format
    _hold(trust.expires_utc > now_utc, f"the trust file expired at {trust.expires_utc.isoformat()}")
    served = not trust.missions or package.mission in trust.missions
    _hold(served, f"the trust file is not for packages of the mission {package.mission}")
    if form == OLD_PACKAGE:
        named = form in trust.roles
        _hold(named, f"the package has the format {form}, which the trust file does not allow by name")
        given = _signatures([{**_object(files[SIGNATURES[form]], what), "role": form}], what)
        signers = {form: _need(trust, form, given, head, what)}
    else:
        expires = _time(package.manifest.get("expires_utc"), "expires_utc of the package")
        _hold(expires > now_utc, f"the package expired at {expires.isoformat()}")
        given = _signatures(_object(files[SIGNATURES[form]], what).get("signatures"), what)
        signers = {role: _need(trust, role, given, message(form, role, head), what) for role in SIGNERS[:2]}
        signed, authors = message(form, "approver", head), signers["author"]
        signers["approver"] = _need(trust, "approver", given, signed, what, authors)
        author = package.manifest.get("author")
        _hold(
            author in list(authors), f"the package names as author {_show(author)}, who did not sign as such"
        )
    return replace(package, signers={role: tuple(sorted(names)) for role, names in signers.items()})


def _need(
    trust: Trust,
    role: str,
    given: Mapping[tuple[str, str], str],
    content: bytes,
    what: str,
    barred: Set[str] = frozenset(),
) -> set[str]:
    """Return the people who signed for a role; those who are `barred` do not count."""
    valid = trust.people(role, lambda k, key: signed_by(key, given.get((role, k)), content))
    found, wanted = valid - barred, trust.threshold(role)
    also = f"; {min(valid & barred)} is its author" if valid & barred else ""
    _hold(
        len(found) >= wanted,
        f"{what} needs {role} signatures of {wanted} trusted people, has {len(found)}{also}",
    )
    return found


def _version(text: bytes, earlier: tuple[str, ...]) -> Trust:
    what = f"version {len(earlier) + 1} of the trust file"
    document = _object(text, what)
    keys, roles = (d if isinstance(d := document.get(name), dict) else {} for name in ("keys", "roles"))
    missions, rover, training = (document.get(name) for name in ("missions", "rover", "training"))
    sound = document.get("version") == len(earlier) + 1 and isinstance(rover, str) and type(training) is bool
    _hold(sound, f"{what} is malformed: its number, rover or training")
    listed = isinstance(missions, list) and all(isinstance(m, str) for m in missions)
    _hold(listed, f"{what} is malformed: its missions")
    for name, key in keys.items():
        _hold(_is_key(name, key), f"{what} is malformed: the key {_show(name)}")
    for role in ("root", *SIGNERS, *roles):
        _hold(_is_rule(roles.get(role), keys), f"{what} is malformed: the role {_show(role)}")
    expires = _time(document.get("expires_utc"), f"expires_utc of {what}")
    chain = (*earlier, hashlib.sha256(text).hexdigest())
    return Trust(str(rover), len(chain), bool(training), chain, tuple(missions or ()), keys, roles, expires)


def _is_key(name: str, key: object) -> bool:
    person, public = (str(key.get(k)) for k in ("person", "public")) if isinstance(key, dict) else ("", "")
    try:
        public_key(public)
    except ValueError:
        return False
    return PERSON.fullmatch(person) is not None and key_id(base64.b64decode(public)) == name


def _is_rule(rule: object, keys: Mapping[str, Any]) -> bool:
    """Return whether a role names known keys and a threshold."""
    named = rule.get("keys") if isinstance(rule, dict) else None
    if not isinstance(named, list) or not all(isinstance(k, str) and k in keys for k in named):
        return False
    wanted = rule.get("threshold") if isinstance(rule, dict) else None
    return type(wanted) is int and wanted >= 1


def _open(content: bytes) -> tuple[Package, dict[str, bytes]]:
    files = _unzip(content)
    for name in (MANIFEST, CRL, LANDMARKS):
        _hold(name in files, f"the package is damaged: {name} is missing")
    manifest, landmarks = _object(files[MANIFEST], MANIFEST), _object(files[LANDMARKS], LANDMARKS)
    form, listed = str(manifest.get("format")), manifest.get("files")
    known = " and ".join(SIGNATURES)
    _hold(form in SIGNATURES, f"the package has the format {_show(form)}; {known} are readable")
    same = isinstance(listed, dict) and set(files) == {*listed, MANIFEST, SIGNATURES[form]}
    _hold(same, "the package holds other files than its manifest lists")
    for name, digest in dict(listed or {}).items():
        whole = hashlib.sha256(files[name]).hexdigest() == digest
        _hold(whole, f"the package is damaged: {_show(name)} is not what its manifest says (SHA-256 differs)")
    counter = manifest.get("counter" if form == PACKAGE else "sequence")
    whole = type(counter) is int and 0 < counter <= MAX_COUNTER
    _hold(whole, f"the manifest of the package is malformed: the counter {_show(counter)}")
    for name in ("mission", "plan", "crl_sha256"):
        sound = isinstance(manifest.get(name), str) and _ID.fullmatch(manifest[name])
        _hold(sound, f"the manifest of the package is malformed: {name} {_show(manifest.get(name))}")
    approved = form != PACKAGE or hashlib.sha256(files[CRL]).hexdigest() == manifest["crl_sha256"]
    _hold(approved, "the plan of the package is not the one that was approved (SHA-256 differs)")
    try:
        text = files[CRL].decode()
    except UnicodeDecodeError as err:
        raise RefusedError("the package is damaged: plan.crl is not text") from err
    sha256 = hashlib.sha256(content).hexdigest()
    return Package(form, manifest, text, landmarks, sha256, manifest["mission"], int(counter or 0), {}), files


def _unzip(content: bytes) -> dict[str, bytes]:
    try:
        with zipfile.ZipFile(io.BytesIO(content)) as archive:
            entries = archive.infolist()
            once = len({e.filename for e in entries}) == len(entries)
            small = sum(e.file_size for e in entries) <= MAX_BYTES
            _hold(once and small, f"it holds a file twice or unpacks to more than {MAX_BYTES} bytes")
            return {e.filename: archive.read(e) for e in entries}
    except Exception as err:  # zipfile and its decoders raise ten classes without a common one
        raise RefusedError(f"the package is damaged: {_show(str(err))}") from err


def _signatures(value: object, what: str) -> dict[tuple[str, str], str]:
    sound = isinstance(value, list) and len(value) <= MAX_SIGNATURES
    entries = [dict(e) for e in value if isinstance(e, dict)] if isinstance(value, list) else []
    _hold(sound, f"{what} has no sound list of signatures")
    return {(str(e.get("role", "root")), str(e.get("key"))): str(e.get("signature")) for e in entries}


def _hold(condition: object, complaint: str) -> None:
    if not condition:
        raise RefusedError(complaint)


def _object(content: bytes, what: str) -> dict[str, Any]:
    try:
        document = json.loads(content)
    except (ValueError, RecursionError) as err:
        raise RefusedError(f"{what} is not readable JSON") from err
    _hold(isinstance(document, dict), f"{what} is not an object")
    return dict(document)


def _time(value: object, what: str) -> datetime:
    try:
        moment = datetime.fromisoformat(str(value))
        return moment.astimezone(UTC) if moment.tzinfo is not None else datetime.fromisoformat("")
    except (ValueError, OverflowError) as err:
        raise RefusedError(f"{what} is {_show(value)}, no time with its zone") from err


def _show(value: object) -> str:
    return ascii(value)[:80]
