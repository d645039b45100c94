"""The orders that one change of an order leads to, as rows of a table."""

from __future__ import annotations

import numpy as np
from numba import njit

from planner.evaluate.model import Ints, Truths


@njit(cache=True, nogil=True)
def changes_of(order: Ints, useful: Truths, asked: int) -> tuple[Ints, Ints]:
    """Return the orders that one change of `order` [n] leads to, once each, and their lengths.

    They are rows of a table [changes, n + 1] with zeros past their ends: one observation left out, one moved,
    two exchanged, one of the `useful` [m] put in, one in another's stead, or a part turned round. All hold
    the observation `asked` if `order` does, and none if not.
    """
    size, m = order.shape[0], useful.shape[0]
    held = np.zeros(m, np.bool_)
    held[order] = True
    others = m - size
    table = np.zeros((size * (2 * size + 1) + others * (2 * size + 1), size + 1), np.int64)
    sizes = np.empty(table.shape[0], np.int64)
    found = 0
    for i in range(size):
        if order[i] != asked:
            table[found, :i], table[found, i : size - 1] = order[:i], order[i + 1 :]
            sizes[found] = size - 1
            found += 1
        for k in range(size):
            if k == i or k == i - 1:  # as it is, or as the one before is moved behind it
                continue
            table[found, :size] = order
            step = 1 if k > i else -1
            for j in range(i, k, step):
                table[found, j] = order[j + step]
            table[found, k] = order[i]
            sizes[found] = size
            found += 1
        for k in range(i + 2, size):
            table[found, :size] = order
            table[found, i], table[found, k] = order[k], order[i]
            sizes[found] = size
            found += 1
    for one in range(m):
        if held[one] or not useful[one] or one == asked:
            continue
        for k in range(size + 1):
            table[found, :k], table[found, k], table[found, k + 1 :] = order[:k], one, order[k:]
            sizes[found] = size + 1
            found += 1
    for k in range(size):
        for one in range(m):
            if held[one] or not useful[one] or one == asked or order[k] == asked:
                continue
            table[found, :size] = order
            table[found, k] = one
            sizes[found] = size
            found += 1
    for i in range(size):
        for k in range(i + 4, size + 1):  # three turned round are two exchanged
            table[found, :size] = order
            table[found, i:k] = order[i:k][::-1]
            sizes[found] = size
            found += 1
    return table[:found], sizes[:found]
