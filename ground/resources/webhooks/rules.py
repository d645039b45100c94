"""Where a webhook may lead: https, to hosts that the operator allows, at public addresses."""

from __future__ import annotations

from collections.abc import Collection
from dataclasses import dataclass
from ipaddress import IPv4Address, IPv6Address, IPv6Network, ip_address
from urllib.parse import urlsplit

from ground.errors import InvalidInputError

HTTPS = 443
NAT64 = (IPv6Network("64:ff9b::/96"), IPv6Network("64:ff9b:1::/48"))
"""IPv4 addresses as a translator's network writes them: RFC 6052 and RFC 8215."""


@dataclass(frozen=True, slots=True)
class Place:
    """Where a webhook leads."""

    host: str
    port: int
    path: str

    @property
    def authority(self) -> str:
        """Return what stands in the header Host."""
        name = f"[{self.host}]" if ":" in self.host else self.host
        return name if self.port == HTTPS else f"{name}:{self.port}"


def place_of(url: str, allowed: Collection[str]) -> Place:
    """Return where a webhook leads.

    Raises
    ------
    InvalidInputError
        If it is not https, holds a name or password, or its host is none of those that are allowed.
    """
    try:
        parts = urlsplit(url)
        host, port = (parts.hostname or "").rstrip("."), parts.port or HTTPS
    except ValueError as err:
        raise _refused(f"the address {url!r} cannot be read: {err}") from err
    if not url.isascii() or any(c.isspace() or c in "\\#" or ord(c) < 32 for c in url):
        raise _refused(f"the address {url!r} holds a character that it may not hold")
    if parts.scheme.lower() != "https" or not host:
        raise _refused(f"a webhook needs an address with https://, not {url!r}")
    if "@" in parts.netloc:
        raise _refused("the address of a webhook may not hold a name or a password")
    place = Place(host, port, (parts.path or "/") + (f"?{parts.query}" if parts.query else ""))
    if place.authority not in allowed:
        raise _refused(f"webhooks may not lead to {place.authority}; OUTCROP_WEBHOOK_HOSTS names the hosts")
    return place


def _refused(why: str) -> InvalidInputError:
    return InvalidInputError(why, pointer="/url")


def why_refused(text: str) -> str:
    """Return why an address that a name resolved to is not connected to; empty if it may be.

    IPv4 addresses that are written as IPv6 ones are checked against the same rules.
    """
    try:
        address = ip_address(text.partition("%")[0])
    except ValueError:
        return "not an address"
    if isinstance(address, IPv6Address):
        inner = _inside(address)
        if inner is not None:
            return why_refused(str(inner))
        if address.is_site_local:
            return "private"
    for word, holds in (
        ("unspecified", address.is_unspecified),
        ("loopback", address.is_loopback),
        ("link-local", address.is_link_local),
        ("multicast", address.is_multicast),
        ("private", address.is_private),
    ):
        if holds:
            return word
    return "" if address.is_global and not address.is_reserved else "not public"


def _inside(address: IPv6Address) -> IPv4Address | None:
    """Return the IPv4 address to which packets for an IPv6 address go in the end."""
    if address.ipv4_mapped is not None:
        return address.ipv4_mapped
    if address.sixtofour is not None:
        return address.sixtofour
    if address.teredo is not None:
        return address.teredo[1]
    if any(address in network for network in NAT64) or (int(address) >> 32 == 0 and int(address) > 1):
        return IPv4Address(int(address) & 0xFFFFFFFF)
    return None
