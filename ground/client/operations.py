"""The operations of the interface as methods; the build writes their types into a stub beside this file."""

from __future__ import annotations

from abc import ABC, abstractmethod
from collections.abc import Callable
from functools import partial
from typing import Any

from ground.client.interface import Operation, operations


class Operations(ABC):
    """One method for each operation of the OpenAPI document, by its name there.

    Variables of the path are given by position, in its order; parameters and members of the body by name.
    `revision` of a change is the one that was seen; without it whatever stands there is changed. A list
    comes as an iterator over all its pages, a stream as one over its events, an object as a `Record`, plain
    text as text, any other file as bytes.
    """

    @abstractmethod
    def call(self, operation: Operation, *where: str | int, **members: Any) -> Any:
        """Return the answer to an operation."""

    def __getattr__(self, name: str) -> Callable[..., Any]:
        operation = operations().get(name)
        if operation is None:
            raise AttributeError(f"the interface has no operation {name!r}")
        return partial(self.call, operation)
