"""The uplink package, `package/1`: a zip that is the same byte for byte for the same content.

==================  ================================================================================
`manifest.json`     format, mission, plan, sequence number, digests of CRL, terrain, dictionary,
                    models, author and approver, and the SHA-256 of every other file
`plan.crl`          the canonical text that was approved
`landmarks.json`    targets with point, normal and covariance; the start pose; the frame
`signature.json`    Ed25519 signature over the bytes of `manifest.json`, name of the key
==================  ================================================================================
"""

from __future__ import annotations

import base64
import binascii
import hashlib
import io
import json
import zipfile
import zlib
from collections.abc import Mapping
from dataclasses import dataclass
from pathlib import Path
from typing import Any

from cryptography.hazmat.primitives.asymmetric.ed25519 import Ed25519PrivateKey, Ed25519PublicKey

from ground.errors import ArchiveError
from ground.uplink.keys import key_id, verified

FORMAT = "package/1"
MANIFEST, CRL, LANDMARKS, SIGNATURE = "manifest.json", "plan.crl", "landmarks.json", "signature.json"
MAX_BYTES = 64 * 2**20
_EPOCH = (1980, 1, 1, 0, 0, 0)


@dataclass(frozen=True, slots=True)
class Package:
    """A package whose signature and digests were checked."""

    manifest: Mapping[str, Any]
    crl_text: str
    landmarks: Mapping[str, Any]
    sha256: str
    key_id: str


def _json(document: Mapping[str, Any]) -> bytes:
    return json.dumps(document, sort_keys=True, indent=1, ensure_ascii=False).encode() + b"\n"


def write_package(
    manifest: Mapping[str, Any], crl_text: str, landmarks: Mapping[str, Any], key: Ed25519PrivateKey
) -> bytes:
    """Return the bytes of a signed package."""
    files = {CRL: crl_text.encode(), LANDMARKS: _json(landmarks)}
    digests = {name: hashlib.sha256(content).hexdigest() for name, content in files.items()}
    head = _json({"format": FORMAT, **manifest, "files": digests})
    signature = {
        "algorithm": "ed25519",
        "key": key_id(key.public_key()),
        "signature": base64.b64encode(key.sign(head)).decode(),
    }
    out = io.BytesIO()
    with zipfile.ZipFile(out, "w") as archive:
        for name, content in ((MANIFEST, head), *files.items(), (SIGNATURE, _json(signature))):
            entry = zipfile.ZipInfo(name, _EPOCH)
            entry.compress_type = zipfile.ZIP_DEFLATED
            archive.writestr(entry, content, compresslevel=6)
    return out.getvalue()


def read_package(source: Path | bytes, trusted: Ed25519PublicKey) -> Package:
    """Return a package after checking signature, digests and form; nothing of it is used before.

    Raises
    ------
    ArchiveError
        If it is damaged, truncated, signed by another key or of another form; the message says which.
    """
    content = source if isinstance(source, bytes) else _read(source)
    try:
        with zipfile.ZipFile(io.BytesIO(content)) as archive:
            names = archive.namelist()
            if len(names) != len(set(names)):
                raise ArchiveError("the package holds a file twice")
            if sum(entry.file_size for entry in archive.infolist()) > MAX_BYTES:
                raise ArchiveError(f"the package unpacks to more than {MAX_BYTES} bytes")
            files = {name: archive.read(name) for name in names}
    except (zipfile.BadZipFile, EOFError, RuntimeError, NotImplementedError, OSError) as err:
        raise ArchiveError(f"the package is damaged: {err}") from err
    except zlib.error as err:
        raise ArchiveError(f"the package is damaged: {err}") from err
    for name in (MANIFEST, CRL, LANDMARKS, SIGNATURE):
        if name not in files:
            raise ArchiveError(f"the package is damaged: {name} is missing")
    _check_signature(files, trusted)
    manifest = _object(files[MANIFEST], MANIFEST)
    if manifest.get("format") != FORMAT:
        raise ArchiveError(f"the package has the format {manifest.get('format')!r}; {FORMAT} is readable")
    listed = manifest.get("files")
    if not isinstance(listed, dict) or set(listed) != set(files) - {MANIFEST, SIGNATURE}:
        raise ArchiveError("the package holds other files than its manifest lists")
    for name, digest in listed.items():
        if hashlib.sha256(files[name]).hexdigest() != digest:
            raise ArchiveError(
                f"the package is damaged: {name} is not what the manifest says (SHA-256 differs)"
            )
    landmarks = _object(files[LANDMARKS], LANDMARKS)
    sha256 = hashlib.sha256(content).hexdigest()
    return Package(manifest, files[CRL].decode(), landmarks, sha256, key_id(trusted))


def _read(path: Path) -> bytes:
    try:
        return path.read_bytes()
    except OSError as err:
        raise ArchiveError(f"the package {path} cannot be read: {err.strerror}") from err


def _object(content: bytes, name: str) -> dict[str, Any]:
    try:
        document = json.loads(content)
    except ValueError as err:
        raise ArchiveError(f"the package is damaged: {name} is no JSON") from err
    if not isinstance(document, dict):
        raise ArchiveError(f"the package is damaged: {name} is no object")
    return document


def _check_signature(files: Mapping[str, bytes], trusted: Ed25519PublicKey) -> None:
    document = _object(files[SIGNATURE], SIGNATURE)
    try:
        signature = base64.b64decode(str(document.get("signature")), validate=True)
    except binascii.Error as err:
        raise ArchiveError("the package is damaged: its signature is malformed") from err
    if document.get("key") != key_id(trusted):
        raise ArchiveError(
            f"the package was signed by the key {document.get('key')!r}; trusted is {key_id(trusted)!r}"
        )
    if not verified(trusted, signature, files[MANIFEST]):
        raise ArchiveError("the signature of the package does not fit its content")
