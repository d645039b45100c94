"""A run as live topics for Foxglove: its journal, followed while it grows, over Foxglove's protocol.

The bridge reads the folder of a run and nothing else; it sends nothing to the run. Topics and messages are
those of `run_messages`. When somebody subscribes, what went before is sent anew to all who listen there,
as the library offers no way to one client; so a message may come twice.
"""

from __future__ import annotations

import json
import threading
import time
from collections import deque
from collections.abc import Callable, Iterator
from pathlib import Path
from typing import Any

from executive.errors import JournalError
from executive.runtime.journal import record_of
from ground.errors import InvalidInputError, UnavailableError
from ground.uplink.run_messages import JOURNAL, Message, messages, schema_text, zero_of

LOOK_S = 0.1
"""How often the journal is looked at."""
KEPT = 20_000
"""Messages of a topic that a late subscriber is given; of pictures the last ones."""
KEPT_PICTURES = 5
BACKLOG = 65_536
"""Messages that wait for one client before the oldest are dropped."""


def follow(path: Path, over: Callable[[], bool]) -> Iterator[dict[str, object]]:
    """Yield the whole records of a journal as they come, until `over`; a line still being written waits.

    Raises
    ------
    JournalError
        If a line that is complete is not a record.
    """
    rest, number = b"", 0
    with path.open("rb") as file:
        while True:
            ending = over()
            data = file.read()
            *lines, rest = (rest + data).split(b"\n")
            for line in lines:
                record = record_of(line.decode("utf-8", "replace"))
                number += 1
                if record is None:
                    raise JournalError(f"journal {path}: line {number} is damaged")
                yield record
            if ending:
                return
            if not data:
                time.sleep(LOOK_S)


class Bridge:
    """A server of one run's topics; `port` is where it listens."""

    def __init__(self, run: Path, *, host: str = "127.0.0.1", port: int = 8765) -> None:
        try:
            import foxglove
        except ImportError:
            raise InvalidInputError("the bridge needs foxglove-sdk: pip install 'outcrop[mcap]'") from None
        self.run = run
        self._sdk = foxglove
        self._context = foxglove.Context()
        self._lock = threading.Lock()
        listener: Any = _Late(self.catch_up)  # two of the many callbacks; the server asks for what is there
        self._channels: dict[str, Any] = {}
        self._kept: dict[str, deque[tuple[bytes, int]]] = {}
        try:
            self._server = foxglove.start_server(
                name=f"outcrop {run.name}",
                host=host,
                port=port,
                context=self._context,
                server_listener=listener,
                message_backlog_size=BACKLOG,
            )
        except (OSError, RuntimeError) as error:
            raise UnavailableError(f"the bridge cannot listen at {host}:{port}: {error}") from error
        self.port: int = self._server.port

    def serve(self, over: Callable[[], bool]) -> int:
        """Send what the run's journal holds and what comes, until `over`; return how many messages."""
        records = follow(self.run / JOURNAL, over)
        header = next(records, None)
        if header is None or header.get("k") != "header":
            raise JournalError(f"journal {self.run / JOURNAL} has no header")
        zero_ns, count = zero_of(header), 0
        for message in messages(self.run, records, zero_ns):
            self._send(message, zero_ns)
            count += 1
        return count

    def close(self) -> None:
        """Stop listening."""
        self._server.stop()

    def _send(self, message: Message, zero_ns: int) -> None:
        data = json.dumps(message.content, allow_nan=False).encode()
        at_ns = zero_ns + 1_000_000 * message.t_ms
        with self._lock:
            channel = self._channels.get(message.topic)
            if channel is None:
                channel = self._open(message)
            self._kept[message.topic].append((data, at_ns))
            channel.log(data, log_time=at_ns)

    def _open(self, message: Message) -> Any:
        schema = self._sdk.Schema(
            name=message.schema, encoding="jsonschema", data=schema_text(message.schema)
        )
        channel = self._sdk.Channel(
            message.topic, schema=schema, message_encoding="json", context=self._context
        )
        pictures = message.schema == "foxglove.CompressedImage"
        self._kept[message.topic] = deque(maxlen=KEPT_PICTURES if pictures else KEPT)
        self._channels[message.topic] = channel
        return channel

    def catch_up(self, topic: str) -> None:
        """Send what a topic has had so far."""
        with self._lock:
            channel = self._channels.get(topic)
            if channel is None:
                return
            for data, at_ns in self._kept[topic]:
                channel.log(data, log_time=at_ns)


class _Late:
    """What the server tells of its clients; those who subscribe late are caught up by a thread of its own,
    since the server waits for the answer.
    """

    def __init__(self, catch_up: Callable[[str], None]) -> None:
        self._catch_up = catch_up

    def on_subscribe(self, _client: Any, channel: Any) -> None:
        threading.Thread(target=self._catch_up, args=(channel.topic,), daemon=True).start()

    def on_unsubscribe(self, client: Any, channel: Any) -> None:
        """Nothing is kept for a client."""
