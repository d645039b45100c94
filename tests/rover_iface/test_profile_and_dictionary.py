"""Profiles, command and telemetry dictionaries."""

from __future__ import annotations

from pathlib import Path

import pytest

from executive.crl.dictionary import ValueType
from rover_iface.commands import COMMANDS
from rover_iface.errors import ProfileError
from rover_iface.profile import load_profile, profile_names
from rover_iface.telemetry import TELEMETRY, TrackState, key

NAMES = [
    "navigate", "turn", "trackstart", "trackstop", "pointmast", "image", "imagepanorama", "handoff",
    "ipplaceinstrument", "stow", "heat", "recharge", "wait", "downlink", "safemode",
]  # fmt: skip


def test_dictionary_holds_every_command_of_the_design() -> None:
    assert sorted(COMMANDS.actions) == sorted(NAMES)


def test_every_number_of_the_dictionaries_has_a_unit_or_is_a_share_or_a_count() -> None:
    for action in COMMANDS.actions.values():
        assert action.doc.endswith(".")
        for value in (*action.parameters, *action.results):
            assert value.doc
            if value.type is ValueType.NUMBER and not value.unit:
                assert value.name in {"confidence", "products"}


def test_telemetry_takes_the_states_of_a_tracker() -> None:
    assert TELEMETRY.keys["trackerstate"].choices == ("idle", "tracked", "lost", "failed")
    assert TELEMETRY.arguments["trackerstate"] == 1
    assert key("trackerstate", "T1") == "trackerstate T1"
    assert TrackState.LOST == "lost"


@pytest.mark.parametrize("name", profile_names())
def test_profiles_that_come_with_the_program_are_whole(name: str) -> None:
    profile = load_profile(name)
    assert profile.name == name
    assert profile.arm.reach_m == 0.79
    assert profile.arm.joints == 5
    assert {i.kind for i in profile.instruments.values()} == {"contact", "remote"}
    assert set(profile.activities) >= {"navigate", "trackstart", "track_overhead"}
    assert len(profile.sha256) == 64


def test_k9_placement_takes_what_the_paper_prints() -> None:
    """Seed 003: `ipplaceinstrument` 504 s, spread 120 s."""
    time = load_profile("k9").instrument("mi").time_s
    assert (time.mean, time.sd) == (504.0, 120.0)


def broken(tmp_path: Path, old: str, new: str) -> Path:
    source = Path(load_profile.__code__.co_filename).parent / "profiles" / "k9.toml"
    text = source.read_text()
    assert old in text
    path = tmp_path / "rover.toml"
    path.write_text(text.replace(old, new, 1))
    return path


@pytest.mark.parametrize(
    ("old", "new", "message"),
    [
        ("reach_m = 0.79", "reach_m = -1", "arm.reach_m is -1.0; it must be positive"),
        ("reach_m = 0.79", "", 'member "reach_m" is missing'),
        ("reach_m = 0.79", 'reach_m = "far"', "a number is needed, found 'far'"),
        ("joints = 5", "joints = 5\nelbows = 2", 'unknown member "elbows"'),
        ("initial_j = 1350000.0", "initial_j = 9e9", "outside 0 to power.battery_j"),
        ('kind = "contact"', 'kind = "psychic"', 'instruments.mi.kind is "psychic"; contact or remote'),
        ("p_success = 0.9", "p_success = 1.5", "instruments.mi.p_success is 1.5"),
        ('format = "profile/1"', 'format = "profile/9"', '"format" must be "profile/1"'),
        ("min_reach_m = 0.25", "min_reach_m = 0.9", "not less than arm.reach_m 0.79"),
        ("[body]", "[body", "not TOML"),
        ("links_m = [0.40, 0.39]", "links_m = [0.40]", "2 values are needed"),
    ],
)
def test_a_broken_profile_is_refused_by_name_value_and_limit(
    tmp_path: Path, old: str, new: str, message: str
) -> None:
    with pytest.raises(ProfileError) as caught:
        load_profile(broken(tmp_path, old, new))
    assert message in str(caught.value)


def test_an_unknown_profile_lists_the_known_ones() -> None:
    with pytest.raises(ProfileError, match='unknown rover profile "curiosity"; known: k9, mer'):
        load_profile("curiosity")
    with pytest.raises(ProfileError, match="No such file"):
        load_profile(Path("nowhere.toml"))


def test_an_unknown_instrument_lists_the_known_ones() -> None:
    with pytest.raises(ProfileError, match='rover "k9" has no instrument "drill"; it carries mi, scicam'):
        load_profile("k9").instrument("drill")
