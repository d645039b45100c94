"""The open constraints of a request: documents that the mission's codec reads."""

from __future__ import annotations

from collections.abc import Mapping, Sequence

from ground.errors import InvalidInputError
from mission import Constraint, FormatError
from mission.codec import Codec, Document
from mission.values import value


@value
class Carried:
    """The constraints that one request carries."""

    constraints: tuple[Constraint, ...] = ()


CARRIED = Codec(Carried, "constraints/1", "observation request")
FLAT = {"tracked": "tracked", "must_do": "must_do", "after": "after"}
"""Kinds that a request has a member of its own for, in which ids are kept true."""


def read_constraints(documents: Sequence[object]) -> tuple[Constraint, ...]:
    """Return the constraints in a list of documents.

    Raises
    ------
    InvalidInputError
        If one is of no kind that is known, or a member of it is wrong.
    """
    if not documents:
        return ()
    try:
        found = CARRIED.from_document({"format": CARRIED.format, "constraints": list(documents)})
    except FormatError as err:
        place = "".join(f"/{step}" for step in err.members) or "/constraints"
        raise InvalidInputError(str(err), pointer=place) from err
    for index, constraint in enumerate(found.constraints):
        if constraint.kind in FLAT:
            raise InvalidInputError(
                f'constraints[{index}].kind is "{constraint.kind}", for which a request has the member '
                f"{FLAT[constraint.kind]}",
                pointer=f"/constraints/{index}/kind",
            )
    return found.constraints


def written_constraints(documents: Sequence[object]) -> list[Mapping[str, object]]:
    """Return a list of documents as it is stored, every member written; raises as `read_constraints` does."""
    if not documents:
        return []
    made: list[Document] = CARRIED.document(Carried(read_constraints(documents)))["constraints"]
    return made
