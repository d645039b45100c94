"""Addresses of a wire, and who may speak on it.

A Unix socket is its owner's alone (mode 0600). TCP without keys stays on the machine. TCP beyond it needs
mutual TLS: both ends show a certificate of an authority that both were given, and nothing starts without.
"""

from __future__ import annotations

import contextlib
import ipaddress
import os
import socket
import ssl
from collections.abc import Iterator
from dataclasses import dataclass
from pathlib import Path

from executive.errors import WireError

LONGEST_NAME = 100
"""Bytes that a Unix socket's path may have everywhere; a longer one is reached through its folder."""
UNUSABLE = (OSError, ValueError, TypeError)
"""What sockets raise for a place that cannot be used; the last two for names that make no question."""


@dataclass(frozen=True, slots=True)
class Keys:
    """Files (PEM) for mutual TLS: own certificate and its key, and the authority that both ends trust."""

    certificate: Path
    key: Path
    authority: Path

    @classmethod
    def of(cls, certificate: Path | None, key: Path | None, authority: Path | None) -> Keys | None:
        """Return the keys of three files, None if none is given.

        Raises
        ------
        WireError
            If only some are given: half of mutual TLS is none.
        """
        if certificate is None and key is None and authority is None:
            return None
        if certificate is None or key is None or authority is None:
            raise WireError("mutual TLS needs all three: --cert, --key and --ca")
        return cls(certificate, key, authority)

    def context(self, *, server: bool) -> ssl.SSLContext:
        """Return a context that refuses whoever shows no certificate of the authority.

        Raises
        ------
        WireError
            If a file cannot be read or holds no such thing.
        """
        context = ssl.SSLContext(ssl.PROTOCOL_TLS_SERVER if server else ssl.PROTOCOL_TLS_CLIENT)
        context.minimum_version = ssl.TLSVersion.TLSv1_3
        context.verify_mode = ssl.CERT_REQUIRED
        try:
            context.load_cert_chain(self.certificate, self.key)
            context.load_verify_locations(self.authority)
        except (OSError, ssl.SSLError) as error:
            names = ", ".join(str(path) for path in (self.certificate, self.key, self.authority))
            raise WireError(f"the keys {names} cannot be used: {error}") from error
        return context


@dataclass(frozen=True, slots=True)
class Address:
    """Where a rover listens: `unix:/path`, or `tcp://host:port`."""

    path: Path | None
    host: str = ""
    port: int = 0

    @classmethod
    def parse(cls, text: str) -> Address:
        """Return the address of its text.

        Raises
        ------
        WireError
            If it has another form.
        """
        if text.startswith("unix:") and len(text) > len("unix:"):
            return cls(Path(text.removeprefix("unix:")))
        host, mark, port = text.removeprefix("tcp://").rpartition(":")
        if not text.startswith("tcp://") or not mark or not host or not (port.isascii() and port.isdigit()):
            raise WireError(f"{text!a} is not an address; write unix:/path or tcp://host:port")
        if int(port) > 65535:
            raise WireError(f"{text!a}: a port is 0 to 65535")
        if not host.isprintable():
            raise WireError(f"{text!a}: a host's name has letters that cannot be printed")
        return cls(None, host.strip("[]"), int(port))

    def __str__(self) -> str:
        if self.path is not None:
            return f"unix:{self.path}"
        return f"tcp://[{self.host}]:{self.port}" if ":" in self.host else f"tcp://{self.host}:{self.port}"

    @property
    def stays_here(self) -> bool:
        """Return whether nothing leaves the machine."""
        if self.path is not None or self.host == "localhost":
            return True
        try:
            return ipaddress.ip_address(self.host).is_loopback
        except ValueError:
            return False

    def require_keys(self, keys: Keys | None) -> None:
        """Raise if the address leads off the machine and there are no keys."""
        if not self.stays_here and keys is None:
            raise WireError(
                f"{self} leads off this machine; that needs mutual TLS: a certificate, its key and the "
                "authority of both ends (--cert, --key, --ca)"
            )


@contextlib.contextmanager
def _reachable(path: Path) -> Iterator[str]:
    """Give a name of a socket that is short enough for the system."""
    if len(os.fsencode(path)) <= LONGEST_NAME:
        yield str(path)
        return
    folder = os.open(path.parent, os.O_RDONLY | os.O_DIRECTORY)
    try:
        yield f"/proc/self/fd/{folder}/{path.name}"
    finally:
        os.close(folder)


def listen(address: Address, keys: Keys | None = None) -> socket.socket:
    """Return a socket that listens; a Unix socket has mode 0600 from its first instant.

    Raises
    ------
    WireError
        If keys are missing, or the place is taken or cannot be used.
    """
    address.require_keys(keys)
    try:
        if address.path is None:
            family = socket.AF_INET6 if ":" in address.host else socket.AF_INET
            return socket.create_server((address.host, address.port), family=family, backlog=16)
        _clear(address.path)
        with contextlib.ExitStack() as unless_ready:
            door = unless_ready.enter_context(socket.socket(socket.AF_UNIX))
            # The mode is the socket's own: a umask belongs to the whole process, its other threads included.
            # Where a system does not know that, nobody can connect before `chmod`: nothing listens yet.
            with contextlib.suppress(OSError):
                os.fchmod(door.fileno(), 0o600)
            with _reachable(address.path) as name:
                door.bind(name)
                Path(name).chmod(0o600)
            door.listen(16)
            unless_ready.pop_all()
    except UNUSABLE as error:
        raise WireError(f"{address!s:.200} cannot be listened on: {_why(error)}") from error
    return door


def _why(error: Exception) -> str:
    return str(getattr(error, "strerror", None) or error)


def _clear(path: Path) -> None:
    """Remove the socket of a process that is gone."""
    if not path.is_socket():
        return
    with socket.socket(socket.AF_UNIX) as probe:
        probe.settimeout(1.0)
        try:
            with _reachable(path) as name:
                probe.connect(name)
        except (ConnectionRefusedError, FileNotFoundError):
            path.unlink(missing_ok=True)
            return
        except OSError:  # somebody who is hung, or whom we may not ask, is somebody
            pass
    raise WireError(f"unix:{path} is in use by another process")


def bound_address(address: Address, door: socket.socket) -> Address:
    """Return the address with the port that the system chose for port 0."""
    return address if address.path is not None else Address(None, address.host, door.getsockname()[1])


def dial(address: Address, keys: Keys | None = None, timeout_s: float = 5.0) -> socket.socket:
    """Return a line to whoever listens.

    Raises
    ------
    WireError
        If keys are missing, nobody listens, or the other end is not trusted.
    """
    address.require_keys(keys)
    try:
        with contextlib.ExitStack() as unless_ready:
            if address.path is not None:
                line = unless_ready.enter_context(socket.socket(socket.AF_UNIX))
                line.settimeout(timeout_s)
                with _reachable(address.path) as name:
                    line.connect(name)
            else:
                line = socket.create_connection((address.host, address.port), timeout_s)
                unless_ready.enter_context(line)
                line.setsockopt(socket.IPPROTO_TCP, socket.TCP_NODELAY, 1)
                if keys is not None:
                    line = keys.context(server=False).wrap_socket(line, server_hostname=address.host)
            unless_ready.pop_all()
        return line
    except UNUSABLE as error:
        raise WireError(f"{address!s:.200} does not answer: {_why(error)}") from error
