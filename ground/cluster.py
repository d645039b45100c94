"""How a Dask cluster is reached: beyond loopback by TLS alone, and by both sides with the same program.

Whoever reaches a scheduler or worker of Dask runs what they like there. So beyond loopback each side must
show a certificate that the cluster's own authority signed (mutual TLS).
"""

from __future__ import annotations

import hashlib
import os
from collections.abc import Callable
from dataclasses import dataclass
from functools import lru_cache
from importlib.util import find_spec
from ipaddress import ip_address
from pathlib import Path
from typing import Any
from urllib.parse import urlsplit

from ground.errors import OtherProgramError

ROOMS = ("mission", "executive", "planner", "rover_iface", "neighbours", "ground")
TEXTS = (".py", ".toml", ".json", ".crl", ".yaml")


@dataclass(frozen=True, slots=True)
class Cluster:
    """Address of a scheduler, and PEM files: our certificate, its key, the authority that signed all."""

    address: str
    certificate: str = ""
    key: str = ""
    authority: str = ""

    def refusal(self) -> str:
        """Return why the cluster may not be used, in one sentence; empty if it may."""
        files = {"CERTIFICATE": self.certificate, "KEY": self.key, "CA": self.authority}
        missing = [name for name, path in files.items() if not path]
        secure = self.address.startswith("tls://")
        if not secure and not self.on_loopback:
            return (
                f"the Dask scheduler {self.address} is beyond loopback, where TLS is needed: use tls:// and "
                "set OUTCROP_DASK_CERTIFICATE, OUTCROP_DASK_KEY and OUTCROP_DASK_CA"
            )
        if not secure and len(missing) < len(files):
            return f"the Dask scheduler {self.address} takes no certificate: use tls://"
        if secure and missing:
            return f"the Dask scheduler {self.address} needs OUTCROP_DASK_{missing[0]}"
        absent = [(name, path) for name, path in files.items() if path and not Path(path).is_file()]
        if absent:
            return f"OUTCROP_DASK_{absent[0][0]}={absent[0][1]!r}: there is no such file"
        return ""

    @property
    def on_loopback(self) -> bool:
        """Return whether the scheduler is on this machine; a name other than `localhost` is not."""
        host = urlsplit(self.address if "//" in self.address else f"tcp://{self.address}").hostname or ""
        try:
            return ip_address(host).is_loopback
        except ValueError:
            return host == "localhost"

    def options(self) -> dict[str, object]:
        """Return what a client of Dask is given besides the address: nothing without TLS."""
        if not self.certificate:
            return {}
        from distributed import Security

        files = {
            "tls_client_cert": self.certificate,
            "tls_client_key": self.key,
            "tls_ca_file": self.authority,
        }
        return {"security": Security(require_encryption=True, **files)}


@lru_cache(maxsize=1)
def program() -> str:
    """Return version and digest of this program: of its code, dictionaries and profiles, and of one's own."""
    from importlib.metadata import version

    digest = hashlib.sha256()
    folders = [Path(spec.origin).parent for room in ROOMS if (spec := find_spec(room)) and spec.origin]
    own = os.environ.get("OUTCROP_PROFILES", "")
    for folder in [*folders, *([Path(own)] if own else [])]:
        for path in sorted(p for p in folder.rglob("*") if p.suffix in TEXTS and p.is_file()):
            name = path.relative_to(folder).as_posix()
            digest.update(f"{name}\0{hashlib.sha256(path.read_bytes()).hexdigest()}\n".encode())
    return f"{version('outcrop')} ({digest.hexdigest()[:12]})"


def do_as(ours: str, work: Callable[..., Any], *given: Any) -> Any:
    """Do work on a worker of the cluster if it runs the program that asked for it.

    Raises
    ------
    OtherProgramError
        If it runs another: the same order could have another answer there.
    """
    theirs = program()
    if theirs != ours:
        raise OtherProgramError(f"a Dask worker runs outcrop {theirs}; this program is {ours}")
    return work(*given)
