"""Files and folders in an object store (S3 and its like), by `fsspec`; the extra `objects`."""

from __future__ import annotations

import contextlib
import logging
import threading
import time
from collections.abc import Callable, Iterator
from pathlib import Path
from typing import Any, TypeVar

from ground.durable import make_folder, put_in_place
from ground.errors import StoreAwayError
from ground.gdr.store import CHUNK, scratch_name
from ground.settings import MARK

logger = logging.getLogger(__name__)
Found = TypeVar("Found")

FIRST_WAIT_S, LONGEST_WAIT_S = 0.5, 5.0
"""Before an object store that is away is asked again."""
PART = 1 << 23
"""Bytes that are asked for at once: less would be a request for each chunk, more would be held in memory."""
SIGN = ".outcrop"
"""A piece that says that the place is in use, and by which it is seen whether the store answers."""
_OPTIONS: dict[str, dict[str, Any]] = {
    "s3": {
        "config_kwargs": {
            "connect_timeout": 5,
            "read_timeout": 60,
            "retries": {"max_attempts": 1},  # we ask again ourselves, and say so
        }
    }
}
"""Of the file systems of fsspec, by the scheme of a URL."""

_lock = threading.Lock()
_open: dict[str, Any] = {}


def _file_system(url: str) -> Any:
    """Return the file system of a URL, one for all threads of this process; nothing it lists is remembered,
    since other processes write.
    """
    scheme = url.partition("://")[0]
    with _lock:
        if scheme not in _open:
            import fsspec

            options = {"use_listings_cache": False, "skip_instance_cache": True, **_OPTIONS.get(scheme, {})}
            _open[scheme] = fsspec.filesystem(scheme, **options)
        return _open[scheme]


class Bucket:
    """Pieces as objects below a URL, those that were brought in a folder of this machine.

    An object is there whole or not at all, and is durable when the store has answered: the store promises
    that. Who may read and write is asked of the environment, as the store's own tools do (`AWS_*`).
    """

    is_local = False

    def __init__(self, url: str, root: Path, patience_s: float = 0.0) -> None:
        self.url, self.root, self.patience_s = url.rstrip("/"), root, patience_s

    @property
    def address(self) -> str:
        return f"{self.url}{MARK}{self.root}"

    def at(self, name: str) -> Bucket:
        return Bucket(f"{self.url}/{name}", self.root / name, self.patience_s)

    def put(self, key: str, draft: Path) -> None:
        put_in_place(draft, self.root / key)
        self.keep(key)

    def keep(self, key: str) -> None:
        try:
            self._ask(lambda fs: fs.put_file(str(self.root / key), self._object(key)))
        except FileNotFoundError as err:
            raise StoreAwayError(f"the object store {self.url} is not there: make its bucket") from err

    def bring(self, *keys: str) -> bool:
        if any((self.root / key).is_file() for key in keys):
            return True
        make_folder(self.root)
        draft = self.root / scratch_name()
        try:
            for key in keys:
                try:
                    with draft.open("wb") as out:
                        out.writelines(self.chunks(key))
                except FileNotFoundError:
                    continue
                put_in_place(draft, self.root / key)
                return True
        finally:
            draft.unlink(missing_ok=True)
        return False

    def holds(self, key: str) -> bool:
        try:
            self.size(key)
        except FileNotFoundError:
            return False
        return True

    def size(self, key: str) -> int:
        found = self._ask(lambda fs: fs.info(self._object(key), refresh=True))
        if found["type"] != "file":
            raise FileNotFoundError(key)
        return int(found["size"])

    def chunks(self, key: str, start: int = 0, stop: int | None = None) -> Iterator[bytes]:
        end = self.size(key) if stop is None else stop
        for at in range(start, end, PART):
            part = self._part(key, at, min(at + PART, end))
            yield from (part[n : n + CHUNK] for n in range(0, len(part), CHUNK))

    def _part(self, key: str, start: int, stop: int) -> bytes:
        found: bytes = self._ask(lambda fs: fs.cat_file(self._object(key), start=start, end=stop))
        return found

    def pieces(self) -> Iterator[tuple[str, float]]:
        found = self._ask(lambda fs: fs.find(self._object(""), detail=True))
        cut = len(self._object("x")) - 1
        for name, about in found.items():
            if about["type"] == "file" and not name.endswith(f"/{SIGN}"):
                when = about.get("LastModified") or about["created"]
                yield name[cut:], when.timestamp()

    def names(self) -> list[str]:
        try:
            found = self._ask(lambda fs: fs.ls(self._object(""), detail=False, refresh=True))
        except FileNotFoundError:
            return []
        names = {name.rstrip("/").rpartition("/")[2] for name in found}
        return sorted(name for name in names if name and name[0] != ".")

    def remove(self, key: str) -> None:
        self.forget(key)
        with contextlib.suppress(FileNotFoundError):
            self._ask(lambda fs: fs.rm_file(self._object(key)))

    def forget(self, key: str) -> bool:
        (self.root / key).unlink(missing_ok=True)
        return True

    def trouble(self) -> str:
        try:
            if not self.holds(SIGN):
                self._ask(lambda fs: fs.pipe_file(self._object(SIGN), b"files of Outcrop\n"))
        except StoreAwayError as err:
            return str(err)
        except FileNotFoundError:
            return f"the object store {self.url} is not there: make its bucket"
        return ""

    def _object(self, key: str) -> str:
        return f"{self.url.partition('://')[2]}/{key}".rstrip("/")

    def _ask(self, do: Callable[[Any], Found]) -> Found:
        """Return what the store answers; one that does not is asked again while patience lasts.

        Raises
        ------
        FileNotFoundError
            If there is no such object.
        StoreAwayError
            If it does not answer, or refuses.
        """
        until, wait_s = time.monotonic() + self.patience_s, FIRST_WAIT_S
        while True:
            try:
                return do(_file_system(self.url))
            except FileNotFoundError:
                raise
            except PermissionError as err:
                raise StoreAwayError(f"the object store {self.url} refuses: {_reason(err)}") from err
            except Exception as err:
                told = StoreAwayError(f"the object store {self.url} does not answer ({_reason(err)})")
                if time.monotonic() + wait_s > until:
                    raise told from err
                logger.warning("the object store is away", extra={"why": str(told), "wait_s": wait_s})
            time.sleep(wait_s)
            wait_s = min(2 * wait_s, LONGEST_WAIT_S)


def _reason(err: BaseException) -> str:
    return (str(err).strip() or type(err).__name__).splitlines()[0][:160]
