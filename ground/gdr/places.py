"""Places of files and folders by their address, and folders that are kept whole.

An *address* is how the order of a job names a place: `PATH` on a disk, `URL!PATH` in an object store, where
`PATH` is the place of what was brought to this machine. `URL!PATH!INSIDE` is a part of a folder.
"""

from __future__ import annotations

import hashlib
import shutil
from collections.abc import Iterator, Mapping
from pathlib import Path

from ground.durable import SUMS, make_folder, put_in_place, read_sums, seal_folder
from ground.errors import DamagedFileError, StoreAwayError
from ground.gdr.store import Disk, Store, scratch_name
from ground.settings import MARK

JOB_PATIENCE_S = 60.0
"""How long a job waits for an object store that is away; the job is queued again after that."""


def store_at(objects: str, data_dir: Path, name: str) -> Store:
    """Return the store of what lies below a name of the data folder; `objects` is a URL, or empty."""
    return open_store(
        f"{objects.rstrip('/')}/{name}{MARK}{data_dir / name}" if objects else str(data_dir / name)
    )


def open_store(address: str, patience_s: float = 0.0) -> Store:
    """Return the store at an address; one that is away is waited for as long as `patience_s`."""
    url, *places = _parts(address)
    if not places:
        return Disk(Path(url))
    from ground.gdr.bucket import Bucket

    return Bucket(url, Path(places[0]), patience_s)


def _parts(address: str) -> list[str]:
    """Return a path alone, or URL, path and what is inside."""
    return address.split(MARK) if "://" in address.partition(MARK)[0] else [address]


def place_of(address: str) -> Path:
    """Return where on this machine an address leads, whether or not anything is there."""
    parts = _parts(address)
    return Path(parts[0]) if len(parts) == 1 else Path(*parts[1:])


def inside_of(address: str, place: Path) -> str:
    """Return the address of a part of the folder at an address."""
    return f"{address}{MARK}{place.as_posix()}" if len(_parts(address)) > 1 else str(Path(address) / place)


def fetched(address: str) -> Path:
    """Return where on this machine the file or folder at an address lies; for a job it is brought if need be.

    Raises
    ------
    FileNotFoundError
        If it is not there.
    DamagedFileError
        If it is not what was kept.
    StoreAwayError
        If the object store is away for longer than a job waits.
    """
    url, *places = _parts(address)
    if not places:
        return Path(url)
    place, inside = Path(places[0]), places[1:]
    if len(place.name) == 64:
        above = open_store(f"{url.rpartition('/')[0]}{MARK}{place.parent}", JOB_PATIENCE_S)
        bring_checked(above, place.name, place.name)
        return place
    return brought_folder(open_store(f"{url}{MARK}{place}", JOB_PATIENCE_S)).joinpath(*inside)


def digest_of(store: Store, key: str) -> str:
    """Return the SHA-256 of a piece as it is kept."""
    digest = hashlib.sha256()
    for chunk in store.chunks(key):
        digest.update(chunk)
    return digest.hexdigest()


def bring_checked(store: Store, key: str, sha256: str) -> bool:
    """Bring a piece that has a hash; return whether it is there.

    Raises
    ------
    DamagedFileError
        If what was brought is not what the hash says; it is dropped again.
    """
    fresh = not store.is_local and not (store.root / key).is_file()
    if not store.bring(key):
        return False
    if fresh:
        with (store.root / key).open("rb") as file:
            found = hashlib.file_digest(file, "sha256").hexdigest()
        if found != sha256:
            store.forget(key)
            raise DamagedFileError(_damage(store, key))
    return True


# ---- folders that are kept whole: terrains, runs, campaigns


def keep_folder(store: Store) -> None:
    """Keep the folder `store.root` whole; its list of hashes comes last, so one with a list is all there.

    On a disk it is kept already.
    """
    if store.is_local:
        return
    seal_folder(store.root)
    for name in listed(store.root / SUMS):
        store.keep(name)
    store.keep(SUMS)


def brought_folder(store: Store) -> Path:
    """Return the folder `store.root`, brought if it is kept and was not; each file is checked by its hash.

    A folder here that no list closes is of a run that goes on, or of an attempt that died. What the store
    keeps takes its place.

    Raises
    ------
    DamagedFileError
        If a file is not what the list of the folder says, or is missing.
    """
    if store.is_local or (store.root / SUMS).is_file():
        return store.root
    try:
        kept = store.holds(SUMS)
    except StoreAwayError:
        if store.root.is_dir():
            return store.root
        raise
    if not kept:
        return store.root
    make_folder(store.root.parent)
    draft = store.root.with_name(scratch_name())
    try:
        draft.mkdir()
        text = b"".join(store.chunks(SUMS))
        (draft / SUMS).write_bytes(text)
        for name, sha256 in listed(draft / SUMS).items():
            target = draft / name
            target.parent.mkdir(parents=True, exist_ok=True)
            digest = hashlib.sha256()
            with target.open("wb") as out:
                for chunk in _there(store, name):
                    digest.update(chunk)
                    out.write(chunk)
            if digest.hexdigest() != sha256:
                raise DamagedFileError(_damage(store, name))
        _take_place(draft, store.root)
    finally:
        shutil.rmtree(draft, ignore_errors=True)
    return store.root


def _take_place(draft: Path, target: Path) -> None:
    """Put a folder where another may lie; who was faster with the same is as good."""
    old = target.with_name(scratch_name())
    try:
        if target.is_dir() and not (target / SUMS).is_file():
            target.rename(old)
        put_in_place(draft, target)
    except OSError:
        if not (target / SUMS).is_file():
            raise
    finally:
        shutil.rmtree(old, ignore_errors=True)


def damaged_pieces(store: Store) -> list[str]:
    """Return the files of a kept folder that are not what its list says; none where there is no list."""
    try:
        said = read_sums(b"".join(store.chunks(SUMS)))
    except FileNotFoundError:
        return []
    if said is None:
        return [SUMS]
    there = {key for key, _ in store.pieces()} - {SUMS}
    return sorted(
        name for name in said.keys() | there if name not in there or digest_of(store, name) != said.get(name)
    )


def remove_folder(store: Store) -> None:
    """Remove a kept folder, here and in its store: its list goes first, so that no half of it counts."""
    if not store.is_local:
        store.remove(SUMS)
        for key, _ in list(store.pieces()):
            store.remove(key)
    shutil.rmtree(store.root, ignore_errors=True)


def listed(path: Path) -> Mapping[str, str]:
    """Return names and hashes in a folder's list.

    Raises
    ------
    DamagedFileError
        If the list itself is damaged.
    """
    found = read_sums(path.read_bytes())
    if found is None:
        raise DamagedFileError(f"the list {path.parent.name}/{path.name} is damaged")
    return found


def _there(store: Store, name: str) -> Iterator[bytes]:
    try:
        yield from store.chunks(name)
    except FileNotFoundError as err:
        raise DamagedFileError(_damage(store, name)) from err


def _damage(store: Store, name: str) -> str:
    return f"the file {name} of {_parts(store.address)[0]} is damaged or missing: its SHA-256 differs"
