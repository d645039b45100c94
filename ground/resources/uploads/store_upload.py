"""Receive a file."""

from __future__ import annotations

import tempfile
from pathlib import Path
from types import TracebackType
from typing import Self

from sqlalchemy.orm import Session

from ground.errors import InvalidInputError, NotFoundError, TooLargeError
from ground.gdr.history import SYSTEM, Change, record
from ground.gdr.ids import new_id
from ground.gdr.repository import Repository
from ground.records.actor import Action, Actor
from ground.resources.uploads.kind import UPLOAD
from ground.resources.uploads.row import UploadRow
from ground.resources.uploads.value import Upload


class UploadDraft:
    """A file being received: written to a scratch file, stored and recorded at the end."""

    def __init__(self, repo: Repository, actor: Actor, file_name: str) -> None:
        if not actor.may_somewhere(Action.UPLINK):  # a run that came down is uploaded too
            actor.require_somewhere(Action.EDIT_SCIENCE)
        self._repo, self._actor, self._name = repo, actor, file_name
        self._file = tempfile.TemporaryFile(dir=repo.data_dir)  # noqa: SIM115 - closed by close()
        self._size = 0
        self._limit = int(repo.settings.max_body_mib * 2**20)

    def __enter__(self) -> Self:
        return self

    def __exit__(self, *_: type[BaseException] | BaseException | TracebackType | None) -> None:
        self.close()

    def write(self, chunk: bytes) -> None:
        """Take a part.

        Raises
        ------
        TooLargeError
            If the file grows over the limit of a body.
        """
        self._size += len(chunk)
        if self._size > self._limit:
            raise TooLargeError(f"the file is over {self._limit} bytes (OUTCROP_MAX_BODY_MIB)")
        self._file.write(chunk)

    def finish(self) -> Upload:
        """Store the file and return its record."""
        if self._size == 0:
            raise InvalidInputError("the body is empty; send the file as the body")
        self._file.seek(0)
        stored = self._repo.files.put(iter(lambda: self._file.read(1 << 20), b""))
        with self._repo.database.write() as session:
            row = UploadRow(
                id=new_id("upl"),
                author=self._actor.name,
                file_name=self._name,
                size_bytes=stored.size_bytes,
                sha256=stored.sha256,
            )
            session.add(row)
            session.flush()
            after = {"file_name": self._name, "sha256": stored.sha256}
            record(session, SYSTEM, Change(self._actor.name, "create", "upload", row.id, None, after))
            return UPLOAD.show_one(session, row)

    def close(self) -> None:
        self._file.close()


def find_upload(session: Session, actor: Actor, upload_id: str, pointer: str = "/upload_id") -> UploadRow:
    """Return an upload, which is there for who uploaded it and for administrators.

    Raises
    ------
    NotFoundError
        If there is none; `pointer` is the member of the form that names it.
    """
    row: UploadRow | None = session.get(UploadRow, upload_id)
    if row is None or not (row.author == actor.name or actor.may(Action.ADMINISTER)):
        raise NotFoundError(f"there is no {UPLOAD.title} {upload_id}", pointer=pointer)
    return row


def uploaded_file(repo: Repository, actor: Actor, upload_id: str) -> Path:
    """Return where an upload of the actor lies; see `find_upload`."""
    with repo.database.read() as session:
        return repo.files.path(find_upload(session, actor, upload_id).sha256)
