"""Profiles, command and telemetry dictionaries."""

from __future__ import annotations

from pathlib import Path

import numpy as np
import pytest
from typer.testing import CliRunner

from executive.crl.dictionary import ValueType
from mission.plugins import Registry
from rover_iface import profiles
from rover_iface.errors import ProfileError
from rover_iface.profile import load as profile_load
from rover_iface.profile import load_profile, profile_names, standard_dictionary
from rover_iface.telemetry import TrackState, key
from rover_iface.vision.handoffs import HANDOFFS

COMMANDS, TELEMETRY = standard_dictionary().commands, standard_dictionary().telemetry
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
    assert {i.use for i in profile.instruments.values()} == {"contact", "remote"}
    assert set(profile.activities) >= {"navigate", "trackstart", "track_overhead"}
    assert len(profile.sha256) == 64


def test_k9_placement_takes_what_the_paper_prints() -> None:
    """Seed 003: `ipplaceinstrument` 504 s, spread 120 s."""
    time = load_profile("k9").instrument("mi").time_s
    assert (time.mean, time.sd) == (504.0, 120.0)


# Kim et al. 2009, Table IV: updates of the tracker, of visual odometry, of hazard avoidance, turn in degrees,
# metres driven, minutes it took. Turns went in steps of ten degrees with 10 cm back and forth.
CHECKOUT_3 = [
    (2, 0, 0, 0.0, 0.0, 2.0),
    (7, 0, 0, 70.0, 1.4, 10.0),
    (10, 0, 0, 0.0, 3.0, 11.0),
    (0, 0, 1, 0.0, 0.0, 5.0),
    (4, 6, 0, 0.0, 2.1, 15.0),
    (4, 0, 4, 0.0, 1.4, 23.0),
]


def test_the_mer_profile_takes_as_long_as_the_flight_checkout_of_table_iv() -> None:
    profile = load_profile("mer")
    names = ("track_update", "visodom_update", "navigator_step")
    costs = [profile.activity(name).time_s() for name in names]
    assert 30 <= costs[0].mean <= 60
    assert 90 <= costs[1].mean <= 120
    assert costs[2].mean == 300
    rng = np.random.default_rng(0)
    totals = np.zeros(2000)
    for *counts, turn_deg, metres, _ in CHECKOUT_3:
        for cost, count in zip(costs, counts, strict=True):
            totals += rng.normal(cost.mean, cost.sd, (2000, int(count))).sum(axis=1)
        turns = turn_deg / 10.0
        totals += turns * profile.activity("turn").fixed_s
        totals += np.radians(turn_deg) / profile.mobility.turn_rate_rad_s
        totals += metres / profile.mobility.speed_m_s
    assert sum(row[-1] for row in CHECKOUT_3) == 66.0
    assert np.median(totals) / 60.0 == pytest.approx(66.0, rel=0.1)


def broken(tmp_path: Path, old: str, new: str) -> Path:
    source = profiles.FOLDER / "k9.toml"
    text = source.read_text()
    assert old in text
    path = tmp_path / "rover.toml"
    path.write_text(text.replace(old, new, 1))
    return path


@pytest.mark.parametrize(
    ("old", "new", "message"),
    [
        ("reach_m = 0.79", "reach_m = -1", "arm.reach_m is -1; it must be more than 0"),
        ("reach_m = 0.79", "", "arm.reach_m is missing"),
        ("reach_m = 0.79", 'reach_m = "far"', 'arm.reach_m must be a number, found "far"'),
        ("joints = 5", "joints = 5\nelbows = 2", "arm.elbows is not a known member"),
        ("initial_j = 1350000.0", "initial_j = 9e9", "initial_j is 9000000000.0 J; it must be at most"),
        ('use = "contact"', 'use = "psychic"', "instruments.mi.use is \"psychic\"; it must be 'contact' or"),
        ("p_success = 0.9", "p_success = 1.5", "instruments.mi.p_success is 1.5; it must be at most 1"),
        ('format = "profile/2"', 'format = "profile/9"', 'format "profile/9", newer than this program'),
        (
            "min_reach_m = 0.25",
            "min_reach_m = 0.9",
            "min_reach_m is 0.9 m; it must be less",
        ),
        ("[body]", "[body", "not TOML"),
        ("links_m = [0.34, 0.31, 0.14]", "links_m = [0.40]", "arm.links_m"),
        ("links_m = [0.34, 0.31, 0.14]", "links_m = [0.34, 0.31, 0.1]", "links_m add up to 0.750 m"),
        ("stow_rad = [-1.4, ", "stow_rad = [-1.9, ", "stow_rad of joint 1 is -1.9, outside its limits -1.7"),
        ("stow_rad = [-1.4, ", "stow_rad = [", "stow_rad has 4 entries and joints is 5; both must be 5"),
        ("hotel_w = 38.0", "hotel_w = nan", "power.hotel_w is NaN; it must be"),
        (
            'alias = "science_camera"',
            'alias = "mi"',
            'instruments.scicam.alias is "mi", which the instrument mi has already',
        ),
    ],
)
def test_a_broken_profile_is_refused_by_name_value_and_limit(
    tmp_path: Path, old: str, new: str, message: str
) -> None:
    with pytest.raises(ProfileError) as caught:
        load_profile(broken(tmp_path, old, new))
    assert message in str(caught.value)


def test_an_unknown_profile_lists_the_known_ones() -> None:
    with pytest.raises(ProfileError, match='unknown rover profile "curiosity"; known are k9, mer'):
        load_profile("curiosity")
    with pytest.raises(ProfileError, match="No such file"):
        load_profile(Path("nowhere.toml"))


def test_an_unknown_instrument_lists_the_known_ones() -> None:
    with pytest.raises(
        ProfileError,
        match='rover "k9" has no instrument "drill"; it carries microscopic_imager, science_camera',
    ):
        load_profile("k9").instrument("drill")


@pytest.mark.parametrize(
    ("profile", "dictionary", "words"),
    [
        (("", ""), ('activity = "stow"', 'activity = "fold"'), 'from the activity "fold", which the profile'),
        (("", ""), ('needs = ["arm"]', 'needs = ["tail"]'), 'needs "tail"; a rover has mobility, mast, arm'),
        (
            ('use = "contact"', 'use = "contact"\naction = "drill"'),
            ("", ""),
            'instrument "mi" is used by the action "drill", which the dictionary lacks; it has navigate,',
        ),
        (
            ('use = "contact"', 'use = "contact"\naction = "stow"'),
            ("", ""),
            'used by the action "stow", which has no parameter "target"; it has none',
        ),
        (
            ("", ""),
            (
                'instrument = { type = "string", doc = "name of the contact',
                'instrument = { type = "string", choices = ["apxs"], doc = "name of the contact',
            ),
            'lets its instrument be "apxs", which the profile lacks; it carries mi, scicam',
        ),
    ],
)
def test_a_dictionary_that_contradicts_its_profile_is_one_clear_error(
    tmp_path: Path, profile: tuple[str, str], dictionary: tuple[str, str], words: str
) -> None:
    folder = profiles.FOLDER.parent
    text = (folder / "dictionaries" / "outcrop-rover.toml").read_text()
    assert dictionary[0] in text
    (tmp_path / "words.toml").write_text(text.replace(*dictionary, 1) if dictionary[0] else text)
    whole = (folder / "profiles" / "k9.toml").read_text().replace('"outcrop-rover"', '"words.toml"')
    assert profile[0] in whole
    (tmp_path / "rover.toml").write_text(whole.replace(*profile, 1) if profile[0] else whole)
    with pytest.raises(ProfileError) as caught:
        load_profile(tmp_path / "rover.toml")
    assert words in str(caught.value)
    assert "dictionary outcrop-rover 1" in str(caught.value)


def test_a_dictionary_that_changes_beside_its_profile_is_read_again(tmp_path: Path) -> None:
    words = (profiles.FOLDER.parent / "dictionaries" / "outcrop-rover.toml").read_text()
    text = (profiles.FOLDER / "k9.toml").read_text().replace('"outcrop-rover"', '"words.toml"')
    (tmp_path / "rover.toml").write_text(text)
    (tmp_path / "words.toml").write_text(words)
    before = load_profile(tmp_path / "rover.toml")
    assert load_profile(tmp_path / "rover.toml") is before
    (tmp_path / "words.toml").write_text(words.replace('name = "outcrop-rover"', 'name = "mine"', 1))
    assert load_profile(tmp_path / "rover.toml").language.name == "mine"


def test_a_profile_that_names_an_unknown_dictionary_lists_the_known_ones(tmp_path: Path) -> None:
    text = (profiles.FOLDER / "k9.toml").read_text().replace('"outcrop-rover"', '"klingon"')
    (tmp_path / "rover.toml").write_text(text)
    with pytest.raises(ProfileError, match='unknown dictionary "klingon"; known are outcrop-rover'):
        load_profile(tmp_path / "rover.toml")


def test_a_profile_of_version_1_still_opens_and_means_the_same(tmp_path: Path) -> None:
    """As the program wrote them before instruments, camera sets and leg models were the profile's."""
    now = load_profile("k9")
    text = (profiles.FOLDER / "k9.toml").read_text()
    for new, old in (
        ('"profile/2"', '"profile/1"'),
        ('dictionary = "outcrop-rover"\n', ""),
        ('set = "k9"\n', ""),
        ('use = "contact"\ncamera = "mi"\nalias = "microscopic_imager"', 'kind = "contact"'),
        ('use = "remote"\nalias = "science_camera"', 'kind = "remote"'),
    ):
        assert new in text
        text = text.replace(new, old)
    head, rest = text.split("[leg_model]")
    text = head + rest[rest.index("[instruments.mi]") :]
    (tmp_path / "old.toml").write_text(text)
    assert load_profile(tmp_path / "old.toml") == now


def test_hand_off_methods_of_the_dictionary_are_those_that_are_registered() -> None:
    method = COMMANDS.actions["handoff"].parameter("method")
    assert method is not None
    assert sorted(method.choices) == sorted(HANDOFFS.names())


def test_a_profile_whose_package_cannot_be_imported_says_so(
    monkeypatch: pytest.MonkeyPatch,
) -> None:
    broken = Registry("rover profile", "outcrop.profiles", {"ghost": "no_such_package:PROFILE"})
    monkeypatch.setattr(profile_load, "_NAMED", broken)
    with pytest.raises(ProfileError, match=r'rover profile "ghost" .*cannot be loaded: ModuleNotFoundError'):
        load_profile("ghost")


def test_a_rover_of_the_operators_own_folder_needs_no_python(
    tmp_path: Path, monkeypatch: pytest.MonkeyPatch
) -> None:
    shipped = profiles.FOLDER.parent
    words = (shipped / "dictionaries" / "outcrop-rover.toml").read_text()
    (tmp_path / "words.toml").write_text(words.replace('name = "outcrop-rover"', 'name = "mine"', 1))
    text = (profiles.FOLDER / "k9.toml").read_text()
    (tmp_path / "pebble.toml").write_text(text.replace('"outcrop-rover"', '"words.toml"'))
    (tmp_path / "broken.toml").write_text("format = ")
    with pytest.raises(ProfileError, match=r'unknown rover profile "pebble"; known are .*k9'):
        load_profile("pebble")
    monkeypatch.setenv(profile_load.OWN_FOLDER, str(tmp_path))
    assert set(profile_names()) >= {"k9", "mer", "pebble", "broken"}
    assert "words" not in profile_names()
    assert load_profile("pebble").language.name == "mine"
    assert load_profile("k9").language.name == "outcrop-rover"
    with pytest.raises(ProfileError, match=r"broken\.toml: not TOML"):
        load_profile("broken")
    with pytest.raises(ProfileError, match=r"known are .*pebble"):
        load_profile("granite")
    with pytest.raises(ProfileError, match="unknown rover profile"):
        load_profile(f"../{tmp_path.name}/pebble")
    monkeypatch.setenv(profile_load.OWN_FOLDER, str(tmp_path / "nowhere"))
    with pytest.raises(ProfileError, match=r"OUTCROP_PROFILES is .*nowhere, which is not a folder"):
        load_profile("k9")


def test_commands_take_a_folder_of_profiles(tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> None:
    from ground.cli.main import app, register_all

    monkeypatch.setenv(profile_load.OWN_FOLDER, "")
    register_all()
    (tmp_path / "pebble.toml").write_text((profiles.FOLDER / "k9.toml").read_text())
    (tmp_path / "broken.toml").write_text("format = ")
    told = CliRunner().invoke(app, ["--profiles", str(tmp_path), "rover", "list"])
    assert told.exit_code == 0
    assert "profile  pebble: NASA Ames K9" in told.output
    assert "profile  broken: cannot be used: " in told.output
    assert "--profiles" in CliRunner().invoke(app, ["--profiles", "nowhere", "rover", "list"]).output
