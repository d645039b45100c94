"""Stop a rover without its executive: the shortest way from a person to the wheels."""

from __future__ import annotations

import time

from executive.errors import WireError
from executive.runtime.wire.address import Address, Keys, dial
from executive.runtime.wire.frames import FrameReader, frame

AGAIN_S = 0.25


def stop_rover(address: Address, keys: Keys | None = None, timeout_s: float = 5.0) -> None:
    """Return when the rover says that it has stopped everything; needs no greeting and no run.

    Raises
    ------
    WireError
        If it does not say so in time.
    """
    end = time.monotonic() + timeout_s
    with dial(address, keys, timeout_s) as line:
        line.settimeout(AGAIN_S)
        reader = FrameReader()
        while time.monotonic() < end:
            try:
                line.sendall(frame({"m": "stop"}))
                data = line.recv(1 << 16)
            except TimeoutError:
                continue
            except OSError as error:
                raise WireError(f"{address}: {error.strerror or error}") from error
            if not data:
                break
            if any(message.get("m") == "stopped" for message in reader.feed(data)):
                return
    raise WireError(f"{address} did not say within {timeout_s:g} s that it has stopped")
