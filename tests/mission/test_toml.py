"""Files of TOML that somebody made to do harm: each reader refuses them by name."""

from __future__ import annotations

from collections.abc import Callable
from pathlib import Path

import pytest

from executive.crl.dictionary import load_dictionary
from executive.crl.errors import DictionaryError
from mission.codec import read_toml
from mission.errors import FormatError
from neighbours.flight.errors import FlightError
from neighbours.flight.flight_map import load_flight_map
from neighbours.robots.errors import RecordingError
from neighbours.robots.recording import read_mapping
from planner.errors import PlannerError
from planner.options import load_options
from rover_iface.cameras.rig import load_cameras
from rover_iface.errors import CameraError, ProfileError
from rover_iface.profile import load_profile

Reader = Callable[[Path], object]
READERS = pytest.mark.parametrize(
    ("reader", "error"),
    [
        (load_flight_map, FlightError),
        (read_mapping, RecordingError),
        (load_profile, ProfileError),
        (load_cameras, CameraError),
        (load_options, PlannerError),
        (load_dictionary, DictionaryError),
    ],
    ids=["flight-map", "recording", "profile", "cameras", "options", "dictionary"],
)
HARMFUL = {
    "deep": "a = " + "[" * 100_000,
    "deep and whole": "a = " + "[" * 100_000 + "]" * 100_000,
    "long": "east_m = " + "9" * 5_000,
    "long and hexadecimal": "east_m = 0x" + "f" * 5_000,
    "no text": "\udcff",
}


@READERS
@pytest.mark.parametrize("text", HARMFUL.values(), ids=HARMFUL)
def test_a_harmful_file_is_refused_by_the_error_of_its_reader(
    reader: Reader, error: type[Exception], text: str, tmp_path: Path
) -> None:
    path = tmp_path / "harm.toml"
    path.write_bytes(text.encode("utf-8", "surrogateescape"))
    with pytest.raises(error, match=r"harm\.toml") as told:
        reader(path)
    assert len(str(told.value)) < 500


def test_whole_numbers_are_of_64_bits_wherever_they_stand() -> None:
    """TOML 1.0, Integer: 64-bit signed; what cannot be held without loss must be an error."""
    assert read_toml(b"a = 9223372036854775807\nb = [-9223372036854775808]", "f") == {
        "a": 2**63 - 1,
        "b": [-(2**63)],
    }
    for text, name in (
        (b"a = 9223372036854775808", "a"),
        (b"[t]\nb = [1, {c = 0x8000000000000000}]", "t.b.c"),
    ):
        with pytest.raises(FormatError, match=rf"f: not TOML: {name} is a whole number of 64 bits"):
            read_toml(text, "f")
