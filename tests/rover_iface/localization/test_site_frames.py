"""Site frames: the mission's files come in and go out unchanged, and frames chain."""

from __future__ import annotations

import math
from datetime import UTC, datetime, timedelta
from xml.etree import ElementTree

import numpy as np
import pytest
from hypothesis import given
from hypothesis import strategies as st

from rover_iface.errors import LocalizationError
from rover_iface.localization.site_frames import (
    LANDING,
    ROVER,
    Alias,
    FrameFile,
    FrameId,
    FrameSolution,
    SiteFrames,
    carry,
    parse_frame_file,
    print_frame_file,
    read_frame_file,
    site,
)
from tests.shared import shared

START = datetime(2004, 1, 5, tzinfo=UTC)
UPRIGHT = (1.0, 0.0, 0.0, 0.0)
number = st.floats(-1e4, 1e4)
counters = st.lists(st.integers(0, 5000), min_size=1, max_size=5).map(tuple)
aliases = st.builds(Alias, counters, counters)
names = st.text("abcdefgh<>&\"' ", min_size=1, max_size=9)


def turned(angle: float) -> tuple[float, float, float, float]:
    return math.cos(angle / 2), 0.0, 0.0, math.sin(angle / 2)


def found(frame, reference, offset, *, by="telemetry", quaternion=UPRIGHT, minutes=0):
    return FrameSolution(by, frame, reference, offset, quaternion, START + timedelta(minutes=minutes))


solutions = st.builds(
    FrameSolution,
    names,
    st.builds(FrameId, names, counters),
    st.builds(FrameId, names, counters),
    st.tuples(number, number, number),
    st.floats(-3, 3).map(turned),
    st.integers(0, 10**8).map(lambda s: START + timedelta(seconds=s)),
)
files = st.builds(
    FrameFile,
    names,
    names,
    st.just(()) | counters,
    st.lists(names).map(tuple),
    st.lists(solutions | aliases, max_size=6).map(tuple),
)


@given(files)
def test_a_file_printed_and_parsed_is_the_same(file):
    assert parse_frame_file(print_frame_file(file).encode()) == file


def content(element):
    """The element as nested tuples: tag, attributes (numbers as numbers), children."""

    def value(text):
        try:
            return float(text)
        except ValueError:
            return text

    attributes = {name: value(text) for name, text in element.attrib.items()}
    return element.tag, attributes, [content(child) for child in element]


@pytest.mark.parametrize("name", ["mer2_master.svf", "mer2_site_137_master.rvf"])
def test_a_mission_file_goes_out_element_for_element_as_it_came_in(name):
    path = shared(f"data/terrain/mer_spirit/{name}")
    file = read_frame_file(path)
    printed = print_frame_file(file)
    assert content(ElementTree.fromstring(printed)) == content(ElementTree.parse(path).getroot())
    assert parse_frame_file(printed.encode()) == file


def test_the_138_sites_of_spirit_chain_to_the_published_place():
    file = read_frame_file(shared("data/terrain/mer_spirit/mer2_master.svf"))
    frames = SiteFrames.of([file])
    assert len(frames.frames) == 138
    place = frames.landing_from(site(138)).translation
    assert place == pytest.approx([-2034.054, 3104.650, -80.972], abs=1e-3)
    assert sum(math.hypot(*s.offset_m[:2]) for s in file.solutions) == pytest.approx(5480.7, abs=0.05)


def test_the_last_pose_in_a_site_is_where_the_next_site_was_declared():
    folder = "data/terrain/mer_spirit/"
    frames = SiteFrames.of(
        [
            read_frame_file(shared(folder + "mer2_master.svf")),
            read_frame_file(shared(folder + "mer2_site_137_master.rvf")),
        ]
    )
    last = max(frame.counter for frame in frames.frames if frame.name == ROVER)
    at = frames.transform(site(138), FrameId(ROVER, last)).translation
    assert np.abs(at).max() < 0.001
    assert frames.renamed((137, 249, 1343, 3133, 4364)) == site(138)
    pose = frames.pose(FrameId(ROVER, last), site(137))
    assert (pose.x, pose.y, pose.z) == pytest.approx((2.68538, -18.2009, 0.733258))
    assert pose.tilt < math.radians(25)


@given(st.floats(-3, 3), st.tuples(number, number, number), st.tuples(number, number, number))
def test_there_and_back_between_frames_is_nothing(angle, offset, target):
    frames = SiteFrames(
        ("telemetry",),
        (found(site(1), LANDING, (3.0, 4.0, 0.0), quaternion=turned(angle)), found(site(2), site(1), offset)),
    )
    back = frames.transform(site(1), site(2)).apply(frames.transform(site(2), site(1)).apply(target))
    assert back == pytest.approx(np.array(target), abs=1e-8)


def test_heading_of_a_rover_facing_east_is_east():
    east = found(FrameId(ROVER, (0, 1)), LANDING, (0.0, 0.0, 0.0), quaternion=turned(math.pi / 2))
    assert SiteFrames(("telemetry",), (east,)).pose(east.frame, LANDING).heading == pytest.approx(
        0.0, abs=1e-12
    )


def relocalised() -> tuple[SiteFrames, SiteFrames]:
    before = SiteFrames(
        ("telemetry",),
        (found(site(1), LANDING, (10.0, 0.0, 0.0)), found(site(2), site(1), (10.0, 0.0, 0.0))),
    )
    better = found(site(1), LANDING, (9.0, 1.0, 0.0), by="adjusted", minutes=5)
    return before, before.with_solution(better)


def test_targets_of_later_sites_are_carried_when_a_site_is_relocalised():
    before, after = relocalised()
    target_site = np.array([1.0, 2.0, 0.0])
    assert after.landing_from(site(2)).apply(target_site) == pytest.approx([20.0, 3.0, 0.0])
    moved = carry(before, after, site(2)).apply(before.landing_from(site(2)).apply(target_site))
    assert moved == pytest.approx(after.landing_from(site(2)).apply(target_site))
    assert before.landing_from(site(2)).apply(target_site) == pytest.approx([21.0, 2.0, 0.0])


def test_history_keeps_every_solution_and_says_which_is_in_use():
    _, after = relocalised()
    assert [s.solution_id for s in after.history(site(1))] == ["telemetry", "adjusted"]
    assert after.in_use(site(1)).solution_id == "adjusted"
    assert after.in_use(site(2)).solution_id == "telemetry"
    later = after.with_solution(
        found(site(1), LANDING, (8.0, 0.0, 0.0), by="trial", minutes=9), preferred=False
    )
    assert later.in_use(site(1)).solution_id == "adjusted"
    assert len(later.history(site(1))) == 3
    newer = later.with_solution(found(site(1), LANDING, (7.0, 0.0, 0.0), by="adjusted", minutes=1))
    assert newer.in_use(site(1)).offset_m == (9.0, 1.0, 0.0)  # of two by the same hand the later added counts


def test_a_circle_of_frames_and_an_unknown_frame_are_refused():
    circle = SiteFrames(
        ("telemetry",), (found(site(1), site(2), (0.0,) * 3), found(site(2), site(1), (0.0,) * 3))
    )
    with pytest.raises(LocalizationError, match="refers back"):
        circle.landing_from(site(1))
    with pytest.raises(LocalizationError, match="has no solution"):
        circle.landing_from(site(7))


GOOD = print_frame_file(
    FrameFile("MER2", "Master_SVF", (), ("telemetry",), (found(site(1), LANDING, (0.0,) * 3),))
)


@pytest.mark.parametrize(
    ("old", "new", "message"),
    [
        ("</rmc_file>", "", "not a frame file"),
        ("rmc_file", "other", "its root is <other>"),
        ('x="0.0"', 'x="far"', 'x="far"'),
        ('x="0.0"', 'x="nan"', "not finite"),
        ('s="1.0"', 's="0.5"', "length 0.5000"),
        ('name="SITE_FRAME"', "", "no attribute name"),
        ("2004-01-05T", "yesterday", "add_date"),
        ("<offset", "<offer", "no <offset>"),
        ('index1="1"', 'index2="1"', "without gap"),
        ("<priority>", "<!-- --><priorities/><priority>", "holds <priorities>"),
        ("<rmc_file", "<!DOCTYPE rmc_file><rmc_file", "document type"),
    ],
)
def test_a_malformed_file_is_refused_with_the_reason(old, new, message):
    with pytest.raises(LocalizationError, match=message):
        parse_frame_file(GOOD.replace(old, new).encode())
