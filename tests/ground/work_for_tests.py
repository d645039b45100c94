"""Work that jobs of the tests do; imported by name in other processes."""

from __future__ import annotations

import logging
import os
import signal
import time
from collections.abc import Callable
from pathlib import Path
from typing import Any

from ground.errors import JobFailedError
from ground.jobs.queue import WorkStoppedError
from mission.codec import Codec
from mission.values import value


@value
class Count:
    """What to do, and the file in which each start is noted."""

    what: str
    log: str


ORDERS = Codec(Count, "count/1", "order to count")


def count(order: Count, report: Callable[[float, str], None], stop: Callable[[], bool]) -> dict[str, Any]:
    """Do what the order says: note each start, then succeed, fail, die or wait to be stopped."""
    with Path(order.log).open("a", encoding="utf-8") as log:
        log.write(f"{os.getpid()}\n")
    report(0.5, "half")
    match order.what:
        case "fail":
            raise JobFailedError("as it was told")
        case "break":
            raise ZeroDivisionError("nobody told it")
        case "die":
            os.kill(os.getpid(), signal.SIGKILL)
        case "die-once":
            if len(Path(order.log).read_text().splitlines()) == 1:
                os.kill(os.getpid(), signal.SIGKILL)
        case "wait":
            until = time.monotonic() + 60.0
            while time.monotonic() < until:
                if stop():
                    raise WorkStoppedError
                time.sleep(0.01)
        case "keep":
            while not stop():
                time.sleep(0.01)
            return {"answer": 41, "stopped": "the best so far"}
        case "hang-once":
            if Path(order.log).read_text().count("\n") == 2:  # a first job was before
                time.sleep(60.0)
        case "log":
            (handler,) = logging.getLogger().handlers
            record = logging.LogRecord("work", logging.INFO, "", 0, "nearly done", (), None)
            return {"line": handler.format(record)}
        case "hang":
            time.sleep(60.0)
    return {"answer": 42}
