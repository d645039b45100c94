"""Log lines: text for people, JSON for machines, nothing secret in either."""

from __future__ import annotations

import json
import logging
from contextvars import ContextVar
from datetime import UTC, datetime

from ground.tracing import trace_id

REQUEST_ID: ContextVar[str] = ContextVar("request_id", default="")
"""Of the request that is being answered."""
_OWN = frozenset(logging.LogRecord("", 0, "", 0, "", (), None).__dict__) | {
    "message",
    "asctime",
    "taskName",
    "color_message",
}
SECRET_NAMES = ("password", "secret", "token", "authorization", "cookie")


def extra_fields(record: logging.LogRecord) -> dict[str, object]:
    """Return what was given as `extra`, with secrets blotted out, and the request and trace it belongs to."""
    ids = {"request_id": REQUEST_ID.get(), "trace_id": trace_id()}
    found: dict[str, object] = {name: value for name, value in ids.items() if value}
    for name, value in record.__dict__.items():
        if name not in _OWN and not name.startswith("_"):
            found[name] = "***" if any(s in name.lower() for s in SECRET_NAMES) and name != "token" else value
    return found


class JsonFormatter(logging.Formatter):
    """One JSON object a line."""

    def format(self, record: logging.LogRecord) -> str:
        line: dict[str, object] = {
            "at_utc": datetime.fromtimestamp(record.created, UTC).isoformat(timespec="milliseconds"),
            "level": record.levelname.lower(),
            "logger": record.name,
            "message": record.getMessage(),
            **extra_fields(record),
        }
        if record.exc_info:
            line["exception"] = self.formatException(record.exc_info)
        return json.dumps(line, default=str)


class TextFormatter(logging.Formatter):
    """Time, level, message, then the fields."""

    def format(self, record: logging.LogRecord) -> str:
        line = super().format(record)
        fields = " ".join(f"{k}={v}" for k, v in extra_fields(record).items())
        return f"{line}  {fields}" if fields else line


def set_up_logging(form: str, level: str) -> None:
    """Send log lines to stderr, in the form and from the level on that the settings ask for."""
    handler = logging.StreamHandler()
    if form == "json":
        handler.setFormatter(JsonFormatter())
    else:
        handler.setFormatter(TextFormatter("%(asctime)s %(levelname)-7s %(name)s: %(message)s", "%H:%M:%S"))
    root = logging.getLogger()
    root.handlers[:] = [handler]
    root.setLevel(level.upper())
    for noisy in ("uvicorn.access", "httpx", "numba", "matplotlib", "PIL", "rasterio"):
        logging.getLogger(noisy).setLevel(logging.WARNING)
