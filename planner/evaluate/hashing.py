"""Numbers by hashing: every draw is a function of a key and a counter, in whatever order it is asked for.

SplitMix64 over a counter gives uniform bits; normal deviates come from them by the ziggurat of Marsaglia and
Tsang (2000) in the form of Doornik (2005), exact in distribution and five times as fast here as the method of
Box and Muller. Only compiled code calls these.
"""

from __future__ import annotations

import math
from typing import Any

import numpy as np
from numba import njit, uint64

from planner.evaluate.model import Floats

LAYERS = 128
TAIL = 3.442619855899
"""Where the lowest layer ends and the tail begins."""

AREA = 9.91256303526217e-3
"""Of each layer under exp(-x^2 / 2)."""


def _layers() -> Floats:
    """Return the right edges of the layers, the widest first; shape (LAYERS + 1,)."""
    height = math.exp(-0.5 * TAIL * TAIL)
    edges = np.zeros(LAYERS + 1)
    edges[0], edges[1] = AREA / height, TAIL
    for k in range(2, LAYERS):
        edges[k] = math.sqrt(-2.0 * math.log(AREA / edges[k - 1] + height))
        height = math.exp(-0.5 * edges[k] * edges[k])
    return edges


EDGES = _layers()
INNER = EDGES[1:] / EDGES[:-1]


@njit(inline="always")
def mix(x: Any) -> Any:
    """Return 64 bits that depend on all bits of x."""
    x = (x ^ (x >> uint64(30))) * uint64(0xBF58476D1CE4E5B9)
    x = (x ^ (x >> uint64(27))) * uint64(0x94D049BB133111EB)
    return x ^ (x >> uint64(31))


@njit(inline="always")
def next_bits(x: Any) -> Any:
    """Return the bits that follow bits x in their stream (SplitMix64)."""
    return mix(x + uint64(0x9E3779B97F4A7C15))


@njit(inline="always")
def bits(key: Any, counter: Any) -> Any:
    """Return the 64 bits of a counter under a key."""
    return mix(key + (uint64(counter) + uint64(1)) * uint64(0x9E3779B97F4A7C15))


@njit(inline="always")
def unit(x: Any) -> Any:
    """Return a number in (0, 1) from the upper 53 bits."""
    return (float(x >> uint64(11)) + 0.5) * (1.0 / 9007199254740992.0)


@njit(inline="always")
def uniform(key: Any, counter: Any) -> Any:
    """Return a number between 0 and 1 of a counter under a key."""
    return unit(bits(key, counter))


@njit(cache=True)
def _at_the_edge(x: Any, layer: Any, u: Any) -> Any:
    """Return the deviate where the first look did not settle it: once in 80 times."""
    while True:
        if layer == 0:
            while True:
                x = next_bits(x)
                over = -math.log(unit(x)) / TAIL
                x = next_bits(x)
                if -2.0 * math.log(unit(x)) >= over * over:
                    break
            return TAIL + over if u > 0.0 else -TAIL - over
        z = u * EDGES[layer]
        low = math.exp(-0.5 * (EDGES[layer] * EDGES[layer] - z * z))
        high = math.exp(-0.5 * (EDGES[layer + 1] * EDGES[layer + 1] - z * z))
        x = next_bits(x)
        if high + unit(x) * (low - high) < 1.0:
            return z
        x = next_bits(x)
        layer = int(x & uint64(LAYERS - 1))
        u = 2.0 * unit(x) - 1.0
        if abs(u) < INNER[layer]:
            return u * EDGES[layer]


@njit(inline="always")
def normal(key: Any, counter: Any) -> Any:
    """Return the standard normal deviate of a counter under a key."""
    x = bits(key, counter)
    layer = int(x & uint64(LAYERS - 1))  # the lowest bits choose the layer, the upper 53 the place in it
    u = 2.0 * unit(x) - 1.0
    if abs(u) < INNER[layer]:
        return u * EDGES[layer]
    return _at_the_edge(x, layer, u)
