"""The heads of all histories, signed by a person, to be kept where the owner of the database cannot write.

A chain of hashes shows that nothing in it was altered by itself; whoever can write the database can rewrite
the whole chain. Checked against a head that was signed and kept elsewhere, that shows too.
"""

from __future__ import annotations

import json
from collections.abc import Mapping
from datetime import UTC, datetime
from pathlib import Path

from ground.errors import InvalidInputError
from ground.uplink.keys import id_of, load_public
from ground.uplink.signing_key import open_key
from ground.uplink.verify import message, public_key, signed_by

FORM, ROLE = "audit-head/1", "auditor"


def write_head(target: Path, heads: Mapping[str, tuple[int, str]], key: Path) -> None:
    """Write heads, by chain number and SHA-256 of its newest event, signed with a key or by its signer."""
    private = open_key(key)
    made = datetime.now(UTC).isoformat(timespec="seconds")
    said = json.dumps({"format": FORM, "made_utc": made, "heads": dict(heads)}, sort_keys=True)
    public = private.public_text()
    signature = private.sign(FORM, ROLE, said.encode())
    document = {"said": said, "key": id_of(public), "public": public, "signature": signature}
    target.write_text(json.dumps(document, indent=1) + "\n", encoding="utf-8")


def read_head(source: Path, key: str | None = None) -> dict[str, tuple[int, str]]:
    """Return the heads of a file, by chain, whose signature is right.

    `key` is the public key, or its file, that must have signed; without it the file vouches for itself only
    where nobody else could write it.

    Raises
    ------
    InvalidInputError
        If the file is damaged, of another form, or not signed by the key.
    """
    try:
        document = json.loads(source.read_text(encoding="utf-8"))
        said, public, signature = document["said"], document["public"], document["signature"]
        signed = signed_by(public_key(public), signature, message(FORM, ROLE, said.encode()))
        content = json.loads(said)
        heads = {str(k): (int(seq), str(sha256)) for k, (seq, sha256) in content["heads"].items()}
    except (OSError, ValueError, LookupError, TypeError, AttributeError, RecursionError) as err:
        raise InvalidInputError(f"{source} is not a file of `outcrop audit head`: {err}") from err
    if content.get("format") != FORM or not signed:
        raise InvalidInputError(f"{source} is damaged: its signature does not fit what it says")
    if key is not None and load_public(key) != public:
        raise InvalidInputError(f"{source} is signed by {id_of(public)}, not by the key that is wanted")
    return heads
