"""Two things at once on two cores: work that releases the interpreter's lock (rays, kernels, OpenCV)."""

from __future__ import annotations

from collections.abc import Callable, Iterable
from concurrent.futures import ThreadPoolExecutor
from typing import TypeVar

T = TypeVar("T")
R = TypeVar("R")


def side_by_side(work: Callable[[T], R], things: Iterable[T]) -> list[R]:
    """Return what `work` makes of each thing, in order: the first in this thread, each other in its own.

    What any of them raises is raised, that of the first thing first.
    """
    first, *others = things
    if not others:
        return [work(first)]
    with ThreadPoolExecutor(len(others)) as hands:
        pending = [hands.submit(work, thing) for thing in others]
        return [work(first), *(one.result() for one in pending)]
