"""Errors of the ground system.

GroundError
├── NotFoundError            there is no such thing (or not for this person)
├── InvalidInputError        a member of what was sent cannot be used
│   ├── OutsideTerrainError  a point off the mission's terrain
│   ├── UnobservedGroundError  ground whose height was filled in, not seen
│   ├── UnreachableError     a request without any observation point
│   ├── TerrainFileError     a terrain that cannot be read, with the reason
│   └── ArchiveError         an archive or package that is damaged, unsafe or of another form
├── UnusableQueryError       parameters of an address that cannot be used (status 400)
├── ConflictError            the request does not fit the state of the thing
│   ├── StateError           the state machine does not allow the step
│   ├── NameTakenError       the name is in use
│   └── AlreadyExecutedError a package or run that was taken in before
├── StaleRevisionError       somebody else changed it in between; carries the present value
├── PreconditionRequiredError a change without If-Match
├── IdempotencyError         the same key with another request
├── ForbiddenError           not allowed for this role
│   └── NarrowedKeyError     a narrowed API key asks for what is its owner's matter
├── AuthenticationError      nobody, or not who they say
├── TooManyAttemptsError     the door is closed for a while
├── TooLargeError            a body over the limit
├── UnavailableError         a part that is needed is not there
│   ├── BusyError            the database is taken up by other writes
│   ├── OtherProgramError    a worker of the cluster runs another version of this program
│   ├── StoreAwayError       the object store that keeps the files does not answer
│   └── DamagedDataError     a row holds what the server never writes
│       └── DamagedFileError a stored file is not what was stored
└── JobFailedError           the work of a job ended with an expected failure
"""

from __future__ import annotations

from typing import Any


class GroundError(Exception):
    """Base of all: the message is for people, `pointer` the JSON pointer of the member that is wrong."""

    def __init__(self, message: str, *, pointer: str | None = None, **extra: Any) -> None:
        super().__init__(message)
        self.message = message
        self.pointer = pointer
        self.extra = extra


class NotFoundError(GroundError):
    """There is no such thing."""


class InvalidInputError(GroundError):
    """A member of what was sent cannot be used."""


class UnusableQueryError(GroundError):
    """Parameters of an address that cannot be used, where a standard asks for status 400."""


class OutsideTerrainError(InvalidInputError):
    """A point off the mission's terrain."""


class UnobservedGroundError(InvalidInputError):
    """Ground whose height was filled in, not seen by a camera."""


class UnreachableError(InvalidInputError):
    """A request without any observation point."""


class TerrainFileError(InvalidInputError):
    """A terrain that cannot be read."""


class ArchiveError(InvalidInputError):
    """An archive or package that is damaged, unsafe or of another form."""


class ConflictError(GroundError):
    """The request does not fit the state of the thing."""


class StateError(ConflictError):
    """The state machine does not allow the step."""


class NameTakenError(ConflictError):
    """The name is in use."""


class AlreadyExecutedError(ConflictError):
    """A package or run that was taken in before."""


class StaleRevisionError(GroundError):
    """Somebody else changed it in between; `extra['current']` is the present value."""


class PreconditionRequiredError(GroundError):
    """A change without If-Match."""


class IdempotencyError(GroundError):
    """The same Idempotency-Key with another request."""


class ForbiddenError(GroundError):
    """Not allowed for this role."""


class NarrowedKeyError(ForbiddenError):
    """A narrowed API key asks for what is its owner's matter: keys, sessions and passwords."""


class AuthenticationError(GroundError):
    """Nobody, or not who they say."""


class TooManyAttemptsError(GroundError):
    """The door is closed for a while."""


class TooLargeError(GroundError):
    """A body over the limit."""


class UnavailableError(GroundError):
    """A part that is needed is not there."""


class BusyError(UnavailableError):
    """The database is taken up by other writes; the same may go well in a moment."""


class OtherProgramError(UnavailableError):
    """A worker of the cluster runs another version, or has other dictionaries or profiles."""


class StoreAwayError(UnavailableError):
    """The object store that keeps the files does not answer; nothing is lost by it."""


class DamagedDataError(UnavailableError):
    """A row or file holds what the server never writes there: the disk, or somebody behind its back."""


class DamagedFileError(DamagedDataError, OSError):
    """A stored file is not what was stored; an error of the disk for who only asks whether it is sound."""


class JobFailedError(GroundError):
    """The work of a job ended with an expected failure."""
