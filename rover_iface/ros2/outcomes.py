"""How a command to ROS 2 can end: a name each, the first word of its reason."""

from __future__ import annotations

from enum import StrEnum


class Outcome(StrEnum):
    """Why a command did not succeed.

    ``unmapped``    the mapping has no such action
    ``malformed``   a parameter or field is missing or no value of its kind, or an answer is
    ``absent``      nobody serves the name
    ``unanswered``  the server said neither yes nor no, or gave no answer
    ``rejected``    the server refused the goal
    ``aborted``     the server gave the goal up
    ``cancelled``   somebody else cancelled the goal
    ``refused``     the answer itself says that it failed
    ``overdue``     it took longer than the mapping allows, and was cancelled
    ``lost``        the server is gone, or knows the goal no more, or its result never came
    ``broken``      ROS itself failed
    """

    UNMAPPED = "unmapped"
    MALFORMED = "malformed"
    ABSENT = "absent"
    UNANSWERED = "unanswered"
    REJECTED = "rejected"
    ABORTED = "aborted"
    CANCELLED = "cancelled"
    REFUSED = "refused"
    OVERDUE = "overdue"
    LOST = "lost"
    BROKEN = "broken"

    def because(self, sentence: str) -> str:
        """Return the reason of a result."""
        return f"{self.value}: {sentence}"[:500]
