"""The port for files and folders, over both adapters: a disk, and an object store (S3, a local server)."""

from __future__ import annotations

import hashlib
import os
import shutil
import time
from pathlib import Path
from typing import Any

import pytest
from hypothesis import HealthCheck, given, settings
from hypothesis import strategies as st

from ground.durable import SUMS
from ground.errors import DamagedFileError, StoreAwayError
from ground.gdr.files import FileStore, key_of
from ground.gdr.places import (
    bring_checked,
    brought_folder,
    damaged_pieces,
    fetched,
    inside_of,
    keep_folder,
    open_store,
    place_of,
    remove_folder,
    store_at,
)
from ground.gdr.store import Store
from tests.ground.s3 import S3

A_GIBBERISH = "0" * 64


@pytest.fixture
def objects(s3_server: S3) -> str:
    """Give the URL of a place in an empty bucket."""
    return f"s3://{s3_server.bucket()}/mission"


@pytest.fixture(params=["disk", "s3"])
def store(request: pytest.FixtureRequest, tmp_path: Path) -> Store:
    url = "" if request.param == "disk" else request.getfixturevalue("objects")
    return store_at(url, tmp_path / "here", "files")


def elsewhere(store: Store, tmp_path: Path) -> Store:
    """Return the same store as another machine sees it; of a disk there is but one machine."""
    if store.is_local:
        return store
    return open_store(f"{store.address.split('!')[0]}!{tmp_path / 'there' / 'files'}")


def put(store: Store, key: str, content: bytes) -> None:
    store.root.mkdir(parents=True, exist_ok=True)
    draft = store.root / ".draft-test"
    draft.write_bytes(content)
    store.put(key, draft)
    assert not draft.exists()


def test_what_was_put_is_there_for_every_machine_by_its_key(store: Store, tmp_path: Path) -> None:
    began = time.time()
    put(store, "ab/one", b"0123456789")
    put(store, "ab/one", b"9876543210")  # takes the place of what lay there
    put(store, "two", b"")
    far = elsewhere(store, tmp_path)
    assert far.holds("ab/one")
    assert far.holds("two")
    assert not far.holds("ab")
    assert not far.holds("ab/three")
    assert (far.size("ab/one"), far.size("two")) == (10, 0)
    assert b"".join(far.chunks("ab/one")) == b"9876543210"
    assert b"".join(far.chunks("ab/one", 3, 6)) == b"654"
    assert b"".join(far.chunks("ab/one", 8)) == b"10"
    pieces = dict(far.pieces())
    assert set(pieces) == {"ab/one", "two"}
    assert all(abs(when - began) < 60.0 for when in pieces.values())
    assert far.names() == ["ab", "two"]
    assert not far.bring("missing", "gone")
    assert far.bring("missing", "ab/one")
    assert (far.root / "ab/one").read_bytes() == b"9876543210"
    far.remove("ab/one")
    far.remove("ab/one")
    assert not far.holds("ab/one")
    assert far.trouble() == ""


def test_a_piece_that_is_not_there_has_no_size_and_no_bytes(store: Store) -> None:
    assert list(store.pieces()) == store.names() == []
    with pytest.raises(FileNotFoundError):
        store.size("none")
    with pytest.raises(FileNotFoundError):
        list(store.chunks("none"))


@settings(max_examples=15, deadline=None, suppress_health_check=[HealthCheck.function_scoped_fixture])
@given(content=st.binary(max_size=3000), packed=st.booleans())
def test_a_file_is_read_back_by_its_hash(store: Store, tmp_path: Path, content: bytes, packed: bool) -> None:
    files, far = FileStore(store), FileStore(elsewhere(store, tmp_path))
    stored = files.put_packed(content) if packed else files.put_bytes(content)
    assert stored.sha256 == hashlib.sha256(content).hexdigest()
    assert stored.size_bytes == len(content)
    assert far.read(stored.sha256) == content
    assert far.holds(stored.sha256)
    assert far.is_sound(stored.sha256)
    assert stored.sha256 in set(far.hashes())


def test_a_file_of_many_parts_comes_whole_and_in_parts(objects: str, tmp_path: Path) -> None:
    """Longer than a request asks for at once, and than one part of an upload."""
    content = bytes(range(256)) * 80_000
    files, far = FileStore(store_at(objects, tmp_path / "a", "files")), None
    sha256 = files.put_bytes(content).sha256
    far = FileStore(store_at(objects, tmp_path / "b", "files"))
    found = far.far(sha256)
    assert found is not None
    assert found.size_bytes == len(content)
    assert b"".join(found.part(8_388_600, 8_388_620)) == content[8_388_600:8_388_620]
    assert not far.path(sha256).with_name("none").exists()
    assert far.read(sha256) == content
    assert far.far(sha256) is None  # it lies here now
    assert far.far(A_GIBBERISH) is None


def spoil(s3: S3, objects: str, key: str, content: bytes) -> None:
    """Put something else where an object lies, behind our back."""
    bucket, _, folder = objects.removeprefix("s3://").partition("/")
    client: Any = s3.client
    client.put_object(Bucket=bucket, Key=f"{folder}/{key}", Body=content)


def test_an_object_that_is_not_what_its_name_says_is_never_given_out(
    s3_server: S3,
    objects: str,
    tmp_path: Path,
) -> None:
    files = FileStore(store_at(objects, tmp_path / "a", "files"))
    sha256 = files.put_bytes(b"a picture").sha256
    spoil(s3_server, objects, f"files/{key_of(sha256)}", b"a forgery")
    assert not files.is_sound(sha256)
    far = FileStore(store_at(objects, tmp_path / "b", "files"))
    for look in (far.path, far.read):
        with pytest.raises(DamagedFileError, match=rf"the file .*{sha256} of s3://.* is damaged or missing"):
            look(sha256)
    assert not (tmp_path / "b" / "files" / key_of(sha256)).exists()
    files.put_bytes(b"a picture")  # takes the place of the damaged one
    assert far.read(sha256) == b"a picture"


def test_a_copy_that_is_damaged_on_this_machine_is_brought_again(objects: str, tmp_path: Path) -> None:
    files = FileStore(store_at(objects, tmp_path, "files"))
    for put_it in (files.put_bytes, files.put_packed):
        stored = put_it(put_it.__name__.encode())
        (copy,) = (p for p in files.folder.rglob(f"{stored.sha256}*") if p.is_file())
        copy.write_bytes(b"rust")
        assert files.read(stored.sha256) == put_it.__name__.encode()


def test_content_that_lies_there_whole_is_not_written_again(
    tmp_path: Path, monkeypatch: pytest.MonkeyPatch
) -> None:
    files = FileStore(tmp_path)
    sha256 = files.put_bytes(b"a picture").sha256
    place = files.path(sha256)
    os.utime(place, (1.0, 1.0))
    inode = place.stat().st_ino
    synced: list[Path] = []
    monkeypatch.setattr("ground.gdr.files.sync", synced.append)
    assert FileStore(tmp_path).put_bytes(b"a picture").sha256 == sha256
    assert place.stat().st_ino == inode
    assert synced == [place.parent], "who put it may not have come to this"
    assert files.sweep(set(), time.time() - 3600.0) == [], "it is as good as new"
    FileStore(tmp_path).put_bytes(b"a picture")
    assert synced == [place.parent], "a name that is durable stays so"
    place.write_bytes(b"a forgery")
    files.put_bytes(b"a picture")
    assert files.read(sha256) == b"a picture"
    assert place.stat().st_ino != inode


def test_a_sweep_takes_old_files_of_no_record_alone(store: Store) -> None:
    files = FileStore(store)
    wanted, stray, text = files.put_bytes(b"1"), files.put_bytes(b"2"), files.put_packed(b"3")
    assert files.sweep({wanted.sha256}, time.time() - 60.0) == []
    assert sorted(files.sweep({wanted.sha256}, time.time() + 60.0)) == sorted([stray.sha256, text.sha256])
    assert list(files.hashes()) == [wanted.sha256]


# ---- folders


def terrain(store: Store) -> Store:
    folder = store.at("trn-1")
    (folder.root / "tiles").mkdir(parents=True)
    (folder.root / "dem.tif").write_bytes(b"heights")
    (folder.root / "tiles" / "0 0.png").write_bytes(b"tile")
    keep_folder(folder)
    return folder


def content_of(folder: Path) -> dict[str, bytes]:
    names = {p.relative_to(folder).as_posix(): p for p in folder.rglob("*") if p.is_file()}
    return {name: path.read_bytes() for name, path in names.items() if name != SUMS}


WHOLE = {"dem.tif": b"heights", "tiles/0 0.png": b"tile"}


def test_a_kept_folder_comes_whole_to_every_machine(store: Store, tmp_path: Path) -> None:
    folder = terrain(store)
    far = elsewhere(store, tmp_path).at("trn-1")
    assert content_of(brought_folder(far)) == WHOLE
    assert damaged_pieces(far) == []
    assert content_of(fetched(far.address)) == WHOLE
    assert fetched(inside_of(far.address, Path("tiles"))) == place_of(far.address) / "tiles"
    remove_folder(far)
    assert not far.root.exists()
    assert elsewhere(store, tmp_path).names() == []
    shutil.rmtree(folder.root, ignore_errors=True)
    assert not brought_folder(folder).exists()


def test_what_an_attempt_left_gives_way_to_the_folder_that_was_kept(objects: str, tmp_path: Path) -> None:
    terrain(store_at(objects, tmp_path / "a", "terrains"))
    here = store_at(objects, tmp_path / "b", "terrains").at("trn-1")
    here.root.mkdir(parents=True)
    (here.root / "half.txt").write_text("an attempt that died")
    assert content_of(brought_folder(here)) == WHOLE
    assert [p.name for p in here.root.parent.iterdir()] == ["trn-1"]


def test_a_folder_of_which_a_file_is_damaged_or_missing_is_not_brought(
    s3_server: S3,
    objects: str,
    tmp_path: Path,
) -> None:
    folder = terrain(store_at(objects, tmp_path / "a", "terrains"))
    far = store_at(objects, tmp_path / "b", "terrains").at("trn-1")
    spoil(s3_server, objects, "terrains/trn-1/dem.tif", b"HEIGHTS")
    for _ in range(2):
        with pytest.raises(DamagedFileError, match=r"the file dem.tif of s3://.* is damaged or missing"):
            brought_folder(far)
        assert not far.root.exists()
        assert damaged_pieces(far) == ["dem.tif"]
        folder.remove("dem.tif")
    spoil(s3_server, objects, f"terrains/trn-1/{SUMS}", b"nonsense\n")
    assert damaged_pieces(far) == [SUMS]
    with pytest.raises(DamagedFileError, match=r"the list .* is damaged"):
        brought_folder(far)


@pytest.mark.parametrize("name", ["../stolen", "/stolen", "tiles/../../stolen", "", "."])
def test_a_list_that_leads_outside_its_folder_is_damaged(
    s3_server: S3, objects: str, tmp_path: Path, name: str
) -> None:
    store = store_at(objects, tmp_path / "a", "terrains")
    terrain(store)
    listed = f"{hashlib.sha256(b'heights').hexdigest()}  {name}\n"
    head = f"#sha256 {hashlib.sha256(listed.encode()).hexdigest()}\n"
    spoil(s3_server, objects, f"terrains/trn-1/{SUMS}", (head + listed).encode())
    far = elsewhere(store, tmp_path).at("trn-1")
    with pytest.raises(DamagedFileError, match="is damaged"):
        brought_folder(far)
    assert not list(tmp_path.rglob("stolen"))
    assert damaged_pieces(far) == [SUMS]


def test_a_folder_without_its_list_was_never_kept(objects: str, tmp_path: Path) -> None:
    """Killed half-way through `keep_folder`: the list comes last."""
    half = store_at(objects, tmp_path / "a", "runs").at("run-1")
    half.root.mkdir(parents=True)
    (half.root / "journal.jsonl").write_bytes(b"{}\n")
    half.keep("journal.jsonl")
    far = store_at(objects, tmp_path / "b", "runs").at("run-1")
    assert not brought_folder(far).exists()


# ---- a store that is away


def test_a_store_that_is_away_is_one_sentence_and_nothing_is_lost(
    s3_server: S3,
    objects: str,
    tmp_path: Path,
) -> None:
    files = FileStore(store_at(objects, tmp_path, "files"))
    before = files.put_bytes(b"before").sha256
    far = FileStore(store_at(objects, tmp_path / "far", "files"))
    away = rf"^the object store {objects}/files does not answer \(.*\)$"
    with s3_server.away():
        assert files.read(before) == b"before"  # what lies here needs no store
        for ask in (
            lambda: files.put_bytes(b"during"),
            lambda: far.read(before),
            lambda: far.holds(before),
            lambda: far.is_sound(before),
            lambda: list(far.hashes()),
            lambda: brought_folder(store_at(objects, tmp_path, "terrains").at("trn-9")),
        ):
            with pytest.raises(StoreAwayError, match="does not answer") as said:
                ask()
            assert "\n" not in str(said.value)
        with pytest.raises(StoreAwayError, match=away):
            far.read(before)
        assert "does not answer" in files.store.trouble()
    assert files.store.trouble() == ""
    assert far.read(before) == b"before"
    assert set(files.hashes()) == {before}  # what could not be stored is not half there
    assert far.read(files.put_bytes(b"during").sha256) == b"during"


def test_a_job_waits_for_a_store_that_is_away(
    s3_server: S3,
    objects: str,
    tmp_path: Path,
    monkeypatch: pytest.MonkeyPatch,
) -> None:
    files = FileStore(open_store(f"{objects}/files!{tmp_path}", 60.0))
    waits: list[float] = []

    def rest(wait_s: float) -> None:
        waits.append(wait_s)
        if len(waits) == 3:
            s3_server.start()

    monkeypatch.setattr("ground.gdr.bucket.time.sleep", rest)
    s3_server.stop()
    sha256 = files.put_bytes(b"late, not lost").sha256
    assert waits == [0.5, 1.0, 2.0]
    assert files.is_sound(sha256)


def test_a_bucket_that_was_never_made_is_named(s3_server: S3, tmp_path: Path) -> None:
    files = FileStore(store_at(f"s3://never-made-{s3_server.port}/x", tmp_path, "files"))
    for said in (files.store.trouble(), _refusal(files)):
        assert (
            said == f"the object store s3://never-made-{s3_server.port}/x/files is not there: make its bucket"
        )


def _refusal(files: FileStore) -> str:
    with pytest.raises(StoreAwayError) as said:
        files.put_bytes(b"x")
    return str(said.value)


def test_a_checked_piece_that_lies_here_is_not_asked_for_again(
    s3_server: S3,
    objects: str,
    tmp_path: Path,
) -> None:
    store = store_at(objects, tmp_path, "files")
    sha256 = FileStore(store).put_bytes(b"x").sha256
    with s3_server.away():
        assert bring_checked(store, key_of(sha256), sha256)
        assert fetched(FileStore(store).address_of(sha256)).read_bytes() == b"x"
