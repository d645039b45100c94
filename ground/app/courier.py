"""The courier: sends the events of missions by their webhooks.

An event is sent before it is written down that it was: who dies in between sends it again, with the same id
(at least once). A webhook is held by one courier at a time, and its next event waits until the one before was
taken or given up (in order).
"""

from __future__ import annotations

import logging
import threading
from collections.abc import Callable, Mapping
from concurrent.futures import Future, ThreadPoolExecutor
from dataclasses import dataclass
from datetime import datetime, timedelta
from typing import TypeVar, get_args

from sqlalchemy import ColumnElement, delete, or_, select
from sqlalchemy.exc import SQLAlchemyError
from sqlalchemy.orm import Session

from ground.errors import GroundError
from ground.gdr.base import utc_now
from ground.gdr.history import ChainRow, EventRow
from ground.gdr.ids import new_id
from ground.gdr.repository import Repository
from ground.records.actor import Action
from ground.resources.kinds import KINDS
from ground.resources.people.accounts import actor_of
from ground.resources.people.row import PersonRow
from ground.resources.webhooks.bodies import EventKind
from ground.resources.webhooks.message import PREFIX, body_of, message_id, type_of
from ground.resources.webhooks.row import WebhookDeliveryRow, WebhookRow, WebhookStateRow
from ground.resources.webhooks.rules import place_of
from ground.resources.webhooks.send import Answer, Sender
from ground.resources.webhooks.signature import signed_headers
from ground.resources.webhooks.value import DeliveryState

READ_AT: Mapping[str, str] = {
    name: KINDS[name].collection for name in get_args(EventKind) if name != "approval"
}
"""Where the API gives what an event is about; an approval stands in its plan."""
T = TypeVar("T")
logger = logging.getLogger(__name__)

WAITS_S = (5, 30, 120, 600, 1800, 7200, 18000)
"""Before the second try and so on: eight tries within eight hours. Standard Webhooks recommends such a
schedule, of some hours or days; a control room that hears of an event a sol later has no use for it.
"""
LEASE_S = 120.0
"""Longer than a message can take; then another courier may go on."""
AT_ONCE = 8
"""Webhooks that are served at the same time: one message takes at most 15 s, mostly of waiting."""
KEPT = 200
"""Deliveries of a webhook that are remembered."""


@dataclass(frozen=True, slots=True)
class Errand:
    """An event that is to be sent, and with what."""

    webhook_id: str
    lease: str
    url: str
    secrets: tuple[str, ...]
    event: EventRow
    again: bool
    """Whether a person asked for it; then it is beside the order."""


class Courier:
    """Sends what is due."""

    LOOK_S = 1.0

    def __init__(
        self,
        repo: Repository,
        sender: Sender | None = None,
        now: Callable[[], datetime] = utc_now,
    ) -> None:
        self.repo, self.now = repo, now
        self.sender = sender or Sender()
        self._stop = threading.Event()
        self._thread: threading.Thread | None = None

    def start(self) -> None:
        """Begin to look for events, in a thread, where the operator allows any host."""
        if self.repo.settings.hook_hosts:
            self._thread = threading.Thread(target=self._run, name="courier", daemon=True)
            self._thread.start()

    def stop(self) -> None:
        """Stop looking; a message that is under way is waited for."""
        self._stop.set()
        if self._thread is not None:
            self._thread.join(timeout=self.sender.time_limit_s + 5.0)

    def _run(self) -> None:
        """Serve each webhook in one thread at a time: who answers slowly holds up nobody else."""
        under_way: dict[str, Future[int]] = {}
        with ThreadPoolExecutor(AT_ONCE, "courier") as threads:
            while not self._stop.is_set():
                under_way = {hook: served for hook, served in under_way.items() if not served.done()}
                for hook in self._guarded(self._due) or ():
                    if hook not in under_way and len(under_way) < AT_ONCE:
                        under_way[hook] = threads.submit(self._serve_all, hook)
                self._stop.wait(self.LOOK_S)

    def _serve_all(self, webhook_id: str) -> int:
        """Send what a webhook has to send, as long as it is taken; return how much was tried."""
        tried = 0
        while not self._stop.is_set() and self._guarded(lambda: self._serve(webhook_id)):
            tried += 1
        return tried

    def _guarded(self, act: Callable[[], T]) -> T | None:
        """Return what an act returns; None after an error, which ends that act alone."""
        try:
            return act()
        except (SQLAlchemyError, GroundError, OSError):
            logger.exception("webhooks cannot be sent now")
        return None

    def step(self) -> int:
        """Send at most one event of each webhook; return how many were tried."""
        return sum(self._serve(hook) for hook in self._due())

    def _due(self) -> list[str]:
        """Return the webhooks that may have something to send."""
        with self.repo.database.read() as session:
            query = select(WebhookRow.id).join(WebhookStateRow, WebhookStateRow.webhook_id == WebhookRow.id)
            hooks = session.scalars(query.where(WebhookRow.active, self._free()).order_by(WebhookRow.id))
            return [hook for hook in hooks.all() if self._has_something(hook)]

    def _serve(self, webhook_id: str) -> bool:
        """Send the next event of a webhook; return whether there was one."""
        errand = self.take(webhook_id)
        if errand is None:
            return False
        self.settle(errand, self.send(errand))
        return True

    def _free(self) -> ColumnElement[bool]:
        return or_(WebhookStateRow.leased_until_utc.is_(None), WebhookStateRow.leased_until_utc < self.now())

    def _has_something(self, webhook_id: str) -> bool:
        """Return whether a webhook may have something to send, without a lock."""
        with self.repo.database.read() as session:
            state = session.get(WebhookStateRow, webhook_id)
            hook = session.get(WebhookRow, webhook_id)
            if state is None or hook is None:
                return False
            head = session.scalar(select(ChainRow.seq).where(ChainRow.id == hook.mission_id)) or 0
            return (state.due_utc <= self.now() and head != state.position) or _asked(
                session, hook
            ) is not None

    def take(self, webhook_id: str) -> Errand | None:
        """Return what a webhook is to send next, held for this courier; None if there is nothing."""
        with self.repo.database.write() as session:
            state = session.scalars(
                select(WebhookStateRow)
                .where(WebhookStateRow.webhook_id == webhook_id, self._free())
                .with_for_update()
            ).first()
            hook = session.get(WebhookRow, webhook_id)
            if state is None or hook is None or not hook.active:
                return None
            trouble = self._trouble(session, hook)
            if trouble:
                state.trouble = trouble
                state.due_utc = self.now() + timedelta(seconds=WAITS_S[1])
                return None
            event, again = _asked(session, hook), True
            if event is None:
                event, again = self._next(session, hook, state), False
            if event is None:
                return None
            state.lease = new_id("lse")
            state.leased_until_utc = self.now() + timedelta(seconds=LEASE_S)
            old = state.old_secret if state.old_until_utc and state.old_until_utc > self.now() else None
            secrets = (state.secret, old) if old else (state.secret,)
            session.flush()
            session.expunge(event)
            return Errand(hook.id, state.lease, hook.url, secrets, event, again)

    def _trouble(self, session: Session, hook: WebhookRow) -> str:
        """Return why nothing may be sent for a webhook's author; empty if it may."""
        person = session.scalars(select(PersonRow).where(PersonRow.name == hook.author)).first()
        if person is None or not person.active:
            return f"its author {hook.author} is shut out; somebody else has to make one"[:200]
        if not actor_of(person).may(Action.READ, hook.mission_id):
            return f"its author {hook.author} may not see the mission"[:200]
        return ""

    def _next(self, session: Session, hook: WebhookRow, state: WebhookStateRow) -> EventRow | None:
        """Return the next event of a webhook; what it is not told of is passed over for good."""
        if state.due_utc > self.now():
            return None
        head = session.scalar(select(ChainRow.seq).where(ChainRow.id == hook.mission_id)) or 0
        after = min(state.position, head)  # a restored history may be shorter
        e = EventRow
        query = select(e).where(e.chain_id == hook.mission_id, e.seq > after, e.kind != "rows")
        if hook.kinds:
            query = query.where(e.kind.in_(hook.kinds))
        found = session.scalars(query.order_by(e.seq).limit(1)).first()
        state.position = head if found is None else found.seq - 1
        return found

    def send(self, errand: Errand) -> Answer:
        """Send an event and return what came of it."""
        event = errand.event
        try:
            place = place_of(errand.url, self.repo.settings.hook_hosts)
        except GroundError as err:  # the operator allows the host no more
            return Answer(None, err.message[:200])
        path = f"missions/{event.chain_id}"
        if event.kind in READ_AT and event.action != "delete":
            path = f"{READ_AT[event.kind]}/{event.subject_id}"
        body = body_of(event, f"{self.repo.settings.public_url.rstrip('/')}{PREFIX}/{path}")
        name = message_id(errand.webhook_id, event.seq)
        headers = signed_headers(errand.secrets, name, int(self.now().timestamp()), body)
        kind = {"Content-Type": "application/json", "User-Agent": "Outcrop-Webhooks", "Connection": "close"}
        return self.sender.post(place, headers | kind, body)

    def settle(self, errand: Errand, answer: Answer) -> None:
        """Write down what came of an event; nothing if another courier holds the webhook by now."""
        with self.repo.database.write() as session:
            state = session.scalars(
                select(WebhookStateRow)
                .where(WebhookStateRow.webhook_id == errand.webhook_id, WebhookStateRow.lease == errand.lease)
                .with_for_update()
            ).first()
            if state is None:  # deleted, or held by another
                return
            sent = self._row_of(session, errand)
            sent.attempts += 1
            sent.status, sent.detail, sent.at_utc = answer.status, answer.detail, self.now()
            sent.next_utc = None
            if answer.taken:
                sent.state = DeliveryState.DELIVERED.value
            elif errand.again or sent.attempts > len(WAITS_S):
                sent.state = DeliveryState.GIVEN_UP.value
                told = {"webhook_id": errand.webhook_id, "event": errand.event.seq, "detail": answer.detail}
                logger.warning("a webhook was given up on an event", extra=told)
            else:
                sent.state = DeliveryState.RETRYING.value
                sent.next_utc = self.now() + timedelta(seconds=WAITS_S[sent.attempts - 1])
            state.lease, state.leased_until_utc = "", None
            if not errand.again:
                self._move_on(state, sent)
            self._forget_old(session, errand.webhook_id)

    def _move_on(self, state: WebhookStateRow, sent: WebhookDeliveryRow) -> None:
        if sent.state != DeliveryState.RETRYING.value:
            state.position = max(state.position, sent.event)
        state.due_utc = sent.next_utc or self.now()
        given_up = f"event {sent.event} was given up after {sent.attempts} tries: {sent.detail}"
        failing = f"event {sent.event} failed {sent.attempts} times: {sent.detail}"
        state.trouble = {
            DeliveryState.DELIVERED.value: "",
            DeliveryState.GIVEN_UP.value: given_up[:200],
        }.get(sent.state, failing[:200])

    def _row_of(self, session: Session, errand: Errand) -> WebhookDeliveryRow:
        key = (errand.webhook_id, errand.event.seq)
        sent = session.get(WebhookDeliveryRow, key)
        if sent is None:
            kind = type_of(errand.event)[:80]
            sent = WebhookDeliveryRow(webhook_id=key[0], event=key[1], type=kind, attempts=0)
            session.add(sent)
        return sent

    def _forget_old(self, session: Session, webhook_id: str) -> None:
        session.flush()
        d = WebhookDeliveryRow
        last = (
            select(d.event).where(d.webhook_id == webhook_id).order_by(d.event.desc()).offset(KEPT).limit(1)
        )
        edge = session.scalar(last)
        if edge is not None:
            over = (d.webhook_id == webhook_id, d.event <= edge, d.state != DeliveryState.QUEUED.value)
            session.execute(delete(d).where(*over))


def _asked(session: Session, hook: WebhookRow) -> EventRow | None:
    """Return the first event that a person wants to have sent again."""
    d = WebhookDeliveryRow
    query = (
        select(EventRow)
        .join(d, d.event == EventRow.seq)
        .where(
            EventRow.chain_id == hook.mission_id,
            d.webhook_id == hook.id,
            d.state == DeliveryState.QUEUED.value,
        )
    )
    return session.scalars(query.order_by(EventRow.seq).limit(1)).first()
