"""Streams of chance by name."""

from __future__ import annotations

import numpy as np
import pytest

from rover_iface.streams import stream


@pytest.mark.parametrize(
    ("drawn", "entropy"),
    [
        (stream("wheels and sensors", 7), [7, 0x5B]),
        (stream("unmapped rocks", 7), [7, 0xD1]),
        (stream("microscope", 7), [7, 0xF0C]),
        (stream("ground plane", 7), [7, 0x6F]),
        (stream("strewn rocks", 7), [7, 0x5E]),
        (stream("shapes of rocks", 7), [7, 0x5F]),
        (stream("small stones", 7, 3, 0xFFFF), [7, 3, 0xFFFF, 0x53]),
        (stream("ledges", 7), [7, 77]),
        (stream("approach", 7), [7, 0x5E]),
    ],
)
def test_stream_draws_what_recorded_days_were_drawn_with(
    drawn: np.random.Generator, entropy: list[int]
) -> None:
    assert (drawn.random(8) == np.random.default_rng(entropy).random(8)).all()


def test_streams_of_other_names_seeds_and_keys_are_apart() -> None:
    made = [
        stream("dust", 1),
        stream("gusts", 1),
        stream("dust", 2),
        stream("dust", 1, 0),
        stream("dust", 1, 1),
    ]
    first = {rng.random() for rng in made}
    assert len(first) == len(made)
    assert stream("dust", 1, 1).random() in first
