"""How many passwords may be tried: paid for before the costly check, by name and address together.

A guess is paid for first, so that guesses at the same time cannot all find the door open. Who guesses from
one address shuts out nobody who comes from another. The payment is kept in this process, which refuses most
without asking the database, and in the database, which holds for all servers and over a restart.

Before the payment comes a place among those that are looked at: who is turned away because many log in at
this moment has not paid, so a flood uses up nobody's guesses. A place is given when the body has come whole,
before anything is made of it: what is turned away costs its connection and no more.

Passwords are checked one at a time: argon2id takes 64 MiB for each (RFC 9106), and log-ins are rare.
"""

from __future__ import annotations

import asyncio
import hashlib
import ipaddress
import threading
import time
from collections import Counter, OrderedDict
from collections.abc import Callable, Iterator
from concurrent.futures import ThreadPoolExecutor
from contextlib import contextmanager
from dataclasses import dataclass, field
from datetime import timedelta
from typing import TypeVar

from sqlalchemy import delete, func, select, text

from ground.errors import TooManyAttemptsError
from ground.gdr.base import utc_now
from ground.gdr.ids import new_id
from ground.gdr.repository import Repository
from ground.resources.people.row import LoginFailureRow

T = TypeVar("T")
TRIES = 5
"""Passwords that may be tried for a name from an address within `WINDOW`."""
TRIES_OF_ADDRESS = 50
"""The same for all names together: one after the other would be as good as many for one."""
WINDOW = timedelta(minutes=5)
PLACES, PLACES_OF_ADDRESS = 32, 2
"""Log-ins that are looked at or wait for it, in all and of one address: so none takes all the places."""
REMEMBERED = 20_000
"""Payments kept in memory, about 4 MB; the oldest are forgotten, and stand in the database."""

CHECKS = ThreadPoolExecutor(1, "password")


def address_of(host: str | None) -> str:
    """Return what counts as one address: an IPv4 address, the /64 of an IPv6 one."""
    try:
        found = ipaddress.ip_address((host or "").partition("%")[0])
    except ValueError:
        return host or "unknown"
    if isinstance(found, ipaddress.IPv4Address):
        return str(found)
    mapped = found.ipv4_mapped
    return str(mapped or ipaddress.ip_network((found, 64), strict=False).network_address)


def too_many(name: str) -> TooManyAttemptsError:
    """Return the refusal of a guess that is not paid for."""
    minutes = WINDOW.seconds // 60
    return TooManyAttemptsError(
        f"too many failed logins for {name!r} from this address; try again in {minutes} minutes",
        retry_after_s=WINDOW.seconds,
    )


def _bucket(name: str, address: str) -> str:
    return hashlib.sha256(f"{address}\n{name}".encode()).hexdigest()


@dataclass
class LogInLimits:
    """The payments of this process."""

    clock: Callable[[], float] = time.monotonic
    _paid: OrderedDict[tuple[str, str], tuple[float, int]] = field(default_factory=OrderedDict)
    _held: Counter[str] = field(default_factory=Counter)
    _lock: threading.Lock = field(default_factory=threading.Lock)

    def knock(self, name: str, address: str) -> None:
        """Pay for one guess in this process, or refuse it; takes microseconds.

        Raises
        ------
        TooManyAttemptsError
            If name and address have used up theirs, or the address all of its own.
        """
        with self._lock:
            accounts = (((name, address), TRIES), (("", address), TRIES_OF_ADDRESS))
            now = self.clock()
            for account, most in accounts:
                began, count = self._paid.get(account, (now, 0))
                if now - began < WINDOW.total_seconds() and count >= most:
                    raise too_many(name)
            for account, _ in accounts:
                began, count = self._paid.pop(account, (now, 0))
                fresh = now - began >= WINDOW.total_seconds()
                self._paid[account] = (now, 1) if fresh else (began, count + 1)
            while len(self._paid) > REMEMBERED:
                self._paid.popitem(last=False)

    def forgive(self, name: str, address: str) -> None:
        """Give back what a name and address paid: the password was right."""
        with self._lock:
            self._paid.pop((name, address), None)
            if ("", address) in self._paid:
                began, count = self._paid[("", address)]
                self._paid[("", address)] = (began, max(0, count - 1))

    @contextmanager
    def place(self, address: str) -> Iterator[None]:
        """Hold a place for one log-in; nothing is paid for it.

        Raises
        ------
        TooManyAttemptsError
            If all places are taken, or all of the address.
        """
        if self._held.total() >= PLACES or self._held[address] >= PLACES_OF_ADDRESS:
            raise TooManyAttemptsError("many log in at this moment; try again in a second", retry_after_s=1)
        self._held[address] += 1
        try:
            yield
        finally:
            self._held[address] -= 1
            if not self._held[address]:
                del self._held[address]


async def check(work: Callable[[], T]) -> T:
    """Return what a costly check says, when its turn has come."""
    return await asyncio.get_running_loop().run_in_executor(CHECKS, work)


def pay(repo: Repository, name: str, address: str) -> None:
    """Pay for one guess in the database, for the name from this address and for the address.

    Raises
    ------
    TooManyAttemptsError
        If either has used up theirs, on whichever server.
    """
    whole, since = _bucket("", address), utc_now() - WINDOW
    accounts = ((whole, TRIES_OF_ADDRESS), (_bucket(name, address), TRIES))
    with repo.database.write() as session:
        if not repo.database.is_sqlite:  # two servers count one after the other
            session.execute(text("SELECT pg_advisory_xact_lock(hashtext(:bucket))"), {"bucket": whole})
        session.execute(delete(LoginFailureRow).where(LoginFailureRow.at_utc <= since))
        for bucket, most in accounts:
            query = select(func.count()).select_from(LoginFailureRow).where(LoginFailureRow.name == bucket)
            if int(session.scalar(query) or 0) >= most:
                raise too_many(name)
        session.add_all(LoginFailureRow(id=new_id("lfl"), name=bucket) for bucket, _ in accounts)


def refund(repo: Repository, name: str, address: str) -> None:
    """Give back what a name and address paid in the database, and of the address this one guess."""
    whole = _bucket("", address)
    newest = (
        select(LoginFailureRow.id)
        .where(LoginFailureRow.name == whole)
        .order_by(LoginFailureRow.at_utc.desc())
        .limit(1)
        .scalar_subquery()
    )
    with repo.database.write() as session:
        session.execute(delete(LoginFailureRow).where(LoginFailureRow.name == _bucket(name, address)))
        session.execute(delete(LoginFailureRow).where(LoginFailureRow.id == newest))


def paid(repo: Repository, name: str, address: str) -> int:
    """Return how many guesses are paid for in the database and not given back."""
    with repo.database.read() as session:
        mine = LoginFailureRow.name == _bucket(name, address)
        return int(session.scalar(select(func.count()).select_from(LoginFailureRow).where(mine)) or 0)
