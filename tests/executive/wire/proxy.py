"""A link that jitters, loses frames and goes away, between an executive and a rover."""

from __future__ import annotations

import contextlib
import heapq
import random
import socket
import threading
import time
from pathlib import Path

from executive.errors import WireError
from executive.runtime.wire.address import Address, dial, listen


class BadLink:
    """Passes frames on in order, each late by up to `jitter_s`, some never; while `away` nothing passes.

    A frame is dropped whole, so what is lost is what a lossy link under the frames would lose. Bytes that are
    no frames pass as they are. `away` keeps lines open and silent, as a link that is away does.
    """

    def __init__(
        self, path: Path, rover: Address, *, jitter_s: float = 0.5, loss: float = 0.05, seed: int = 1
    ) -> None:
        self.address, self.rover = Address(path), rover
        self.jitter_s, self.loss = jitter_s, loss
        self.away = threading.Event()
        self.lost = self.passed = 0
        self._rng = random.Random(seed)
        self._door = listen(self.address)
        threading.Thread(target=self._accept, daemon=True).start()

    def _accept(self) -> None:
        while True:
            try:
                near, _ = self._door.accept()
            except OSError:
                return
            try:
                far = dial(self.rover)
            except WireError:
                near.close()
                continue
            far.settimeout(None)
            for source, sink in ((near, far), (far, near)):
                threading.Thread(target=self._pass_on, args=(source, sink), daemon=True).start()

    def _pass_on(self, source: socket.socket, sink: socket.socket) -> None:
        queue: list[tuple[float, int, bytes]] = []
        ready = threading.Condition()
        closed = threading.Event()

        def deliver() -> None:
            while True:
                with ready:
                    while not queue and not closed.is_set():
                        ready.wait(0.2)
                    if not queue:
                        break
                    at, _, data = heapq.heappop(queue)
                time.sleep(max(0.0, at - time.monotonic()))
                if self.away.is_set():
                    continue
                try:
                    sink.sendall(data)
                except OSError:
                    break
            for line in (sink, source):
                with contextlib.suppress(OSError):
                    line.shutdown(socket.SHUT_RDWR)
                line.close()

        threading.Thread(target=deliver, daemon=True).start()
        rest, last, count = b"", 0.0, 0
        while True:
            try:
                data = source.recv(65536)
            except OSError:
                data = b""
            if not data:
                break
            rest += data
            for one in self._frames(rest):
                rest = rest[len(one) :]
                if self._rng.random() < self.loss or self.away.is_set():
                    self.lost += 1
                    continue
                self.passed += 1
                last = max(last, time.monotonic() + self._rng.random() * self.jitter_s)
                with ready:
                    count += 1
                    heapq.heappush(queue, (last, count, one))
                    ready.notify()
        closed.set()

    @staticmethod
    def _frames(data: bytes) -> list[bytes]:
        found = []
        while len(data) >= 4:
            size = int.from_bytes(data[:4], "big")
            if not 0 < size <= 1 << 20:
                return [*found, data]
            if len(data) < 4 + size:
                break
            found.append(data[: 4 + size])
            data = data[4 + size :]
        return found

    def close(self) -> None:
        with contextlib.suppress(OSError):
            self._door.shutdown(socket.SHUT_RDWR)
        self._door.close()
