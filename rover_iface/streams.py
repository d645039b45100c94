"""Streams of chance by name: a run has one seed, and each use of chance a stream of its own."""

from __future__ import annotations

from types import MappingProxyType

import numpy as np

_TAGS = MappingProxyType(
    {
        "wheels and sensors": 0x5B,
        "unmapped rocks": 0xD1,
        "microscope": 0xF0C,
        "ground plane": 0x6F,
        "strewn rocks": 0x5E,
        "shapes of rocks": 0x5F,
        "small stones": 0x53,
        "ledges": 77,
        "approach": 0x5E,
    }
)
"""What recorded days and generated sites were drawn with; a new stream needs no number."""


def stream(name: str, seed: int, *key: int) -> np.random.Generator:
    """Return the generator of one stream of a run.

    Parameters
    ----------
    name
        What is drawn. Another name gives an independent stream, so a new use of chance leaves the others
        as they were.
    seed
        The run's own; not negative.
    key
        Which of several like it: a tile, a stop; not negative.
    """
    tag = (_TAGS[name],) if name in _TAGS else tuple(name.encode())
    return np.random.default_rng([seed, *key, *tag])
