"""The uplink package, `package/2`: a zip that is the same byte for byte for the same content.

===================  ===============================================================================
`manifest.json`      format, mission, plan, counter, when it was issued and expires, the digests of
                     CRL, terrain, dictionary, profile, models and verifying run, the author, and
                     the SHA-256 of the two files that follow
`plan.crl`           the canonical text that was approved
`landmarks.json`     targets with point, normal and covariance; the start pose; the frame
`signatures.json`    what author, verifier and approver signed: role, key and signature over the
                     bytes of `manifest.json`
===================  ===============================================================================

`ground.uplink.verify` reads it.
"""

from __future__ import annotations

import hashlib
import io
import json
import zipfile
from collections.abc import Mapping, Sequence
from dataclasses import asdict, dataclass

from ground.uplink.verify import CRL, LANDMARKS, MANIFEST, PACKAGE, SIGNATURES

_EPOCH = (1980, 1, 1, 0, 0, 0)


@dataclass(frozen=True, slots=True)
class Signature:
    """What one person signed a package as."""

    role: str
    key: str
    signature: str


def json_text(document: Mapping[str, object]) -> str:
    """Return a document as it is stored, signed and sent."""
    return json.dumps(document, sort_keys=True, indent=1, ensure_ascii=False) + "\n"


def manifest_text(about: Mapping[str, object], crl_text: str, landmarks: str) -> str:
    """Return the text that people sign: what the package is about, bound to its files."""
    files = {CRL: crl_text, LANDMARKS: landmarks}
    digests = {name: hashlib.sha256(text.encode()).hexdigest() for name, text in files.items()}
    return json_text({"format": PACKAGE, **about, "crl_sha256": digests[CRL], "files": digests})


def signing_keys(content: bytes) -> set[str]:
    """Return the names of the keys that signed a package; its signatures were not looked at."""
    with zipfile.ZipFile(io.BytesIO(content)) as archive:
        document = json.loads(archive.read(SIGNATURES[PACKAGE]))
    return {str(entry["key"]) for entry in document["signatures"]}


def write_package(manifest: str, crl_text: str, landmarks: str, signatures: Sequence[Signature]) -> bytes:
    """Return the bytes of a package; nothing is signed here."""
    signed = json_text({"signatures": [asdict(s) for s in signatures]})
    parts = {MANIFEST: manifest, CRL: crl_text, LANDMARKS: landmarks, SIGNATURES[PACKAGE]: signed}
    out = io.BytesIO()
    with zipfile.ZipFile(out, "w") as archive:
        for name, text in parts.items():
            entry = zipfile.ZipInfo(name, _EPOCH)
            entry.compress_type = zipfile.ZIP_DEFLATED
            archive.writestr(entry, text.encode(), compresslevel=6)
    return out.getvalue()
