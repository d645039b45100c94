"""A run as MCAP (mcap.dev), for Foxglove and its like, or with messages of ROS 2 for bag tools.

All comes from the journal, so a run that goes on, or was cut off, is exported as far as it got. Messages are
JSON with JSON Schema; with profile `ros2` they are CDR with definitions of ROS.
"""

from __future__ import annotations

import json
import os
from collections.abc import Iterator
from pathlib import Path
from typing import Protocol

from executive.runtime.journal import JournalFile
from ground.errors import InvalidInputError, NameTakenError
from ground.uplink.run_messages import JOURNAL, Encoded, Message, messages, schema_text, zero_of


class Encoder(Protocol):
    """How messages are written: profile of the file, encoding of the messages, and each message's bytes."""

    profile: str
    encoding: str

    def schema(self, name: str) -> tuple[str, bytes]:
        """Return encoding and text of a schema."""

    def encoded(self, message: Message) -> Iterator[Encoded]:
        """Yield what is written for a message, in order, all at its time."""


class JsonMessages:
    """Messages as they are, in JSON."""

    profile, encoding = "", "json"

    def schema(self, name: str) -> tuple[str, bytes]:
        return "jsonschema", schema_text(name)

    def encoded(self, message: Message) -> Iterator[Encoded]:
        data = json.dumps(message.content, allow_nan=False).encode()
        yield Encoded(message.topic, message.schema, data)


def export_mcap(run: Path, target: Path, *, ros2: bool = False, capacity_j: float = 0.0) -> dict[str, int]:
    """Write the run in a folder as MCAP; return how many messages each topic has.

    With `ros2` the file has the profile of that name and messages of ROS 2 in CDR; `capacity_j` is then the
    energy of the full battery, of which its state tells the share.

    Raises
    ------
    InvalidInputError
        If a package that is needed is not installed.
    NameTakenError
        If the file exists.
    JournalError
        If the folder holds no journal, or one that is damaged.
    """
    try:
        from mcap.writer import Writer
    except ImportError:
        raise InvalidInputError("MCAP needs the package mcap: pip install 'outcrop[mcap]'") from None
    if target.exists():
        raise NameTakenError(f"{target} exists already")
    journal = JournalFile(run / JOURNAL)
    zero_ns = zero_of(journal.header)
    encoder = _encoder(run, zero_ns, ros2=ros2, capacity_j=capacity_j)
    counts: dict[str, int] = {}
    channels: dict[str, int] = {}
    schemas: dict[str, int] = {}
    fresh = target.with_name(f"{target.name}.part")
    try:
        with fresh.open("wb") as file:
            writer = Writer(file)
            writer.start(profile=encoder.profile, library="outcrop")
            for message in messages(run, journal.records, zero_ns):
                at_ns = zero_ns + 1_000_000 * message.t_ms
                for one in encoder.encoded(message):
                    if one.schema not in schemas:
                        schemas[one.schema] = writer.register_schema(one.schema, *encoder.schema(one.schema))
                    if one.topic not in channels:
                        channels[one.topic] = writer.register_channel(
                            one.topic, encoder.encoding, schemas[one.schema]
                        )
                    writer.add_message(channels[one.topic], at_ns, one.data, at_ns, sum(counts.values()))
                    counts[one.topic] = counts.get(one.topic, 0) + 1
            writer.finish()
            file.flush()
            os.fsync(file.fileno())
        fresh.replace(target)
    finally:
        fresh.unlink(missing_ok=True)
    return counts


def _encoder(run: Path, zero_ns: int, *, ros2: bool, capacity_j: float) -> Encoder:
    if not ros2:
        return JsonMessages()
    from ground.uplink.ros2_messages import Ros2Messages

    return Ros2Messages(run, zero_ns, capacity_j)
