"""How large the files of the data folder are, counted now and then beside what asks."""

from __future__ import annotations

import os
import threading
import time
from pathlib import Path


class StoreSize:
    """Bytes of all that lies in the folders of the data folder: not of a database, which lies beside them."""

    EVERY_S = 900.0
    """A million files take some seconds to count."""

    def __init__(self, folder: Path) -> None:
        self._folder = folder
        self._lock = threading.Lock()
        self._known: int | None = None
        self._begun = -self.EVERY_S
        self._thread: threading.Thread | None = None

    def known(self) -> int | None:
        """Return what was counted last, None before the first, and count again if that is long ago."""
        with self._lock:
            idle = self._thread is None or not self._thread.is_alive()
            if idle and time.monotonic() - self._begun >= self.EVERY_S:
                self._begun = time.monotonic()
                self._thread = threading.Thread(target=self._count, name="store-size", daemon=True)
                self._thread.start()
        return self._known

    def wait(self) -> None:
        """Wait until it is counted."""
        if self._thread is not None:
            self._thread.join()

    def _count(self) -> None:
        try:
            folders = [path for path in self._folder.iterdir() if path.is_dir()]
        except FileNotFoundError:  # the data folder was taken away: whoever asks for more is told
            folders = []
        self._known = sum(_size(path) for path in folders)


def _size(folder: Path) -> int:
    """Return the bytes of the files below a folder; what goes meanwhile counts nothing."""
    total = 0
    for place, _, names in os.walk(folder):
        for name in names:
            try:
                total += Path(place, name).lstat().st_size
            except OSError:
                continue
    return total
