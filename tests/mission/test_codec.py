"""Days as documents: written and read back, older versions brought up, everything else refused by name."""

from __future__ import annotations

import json
import math
import pickle
from collections.abc import Callable
from typing import Any

import jsonschema
import pytest
from hypothesis import given
from hypothesis import strategies as st

from mission import (
    After,
    Constraint,
    Day,
    FormatError,
    KeepOut,
    Limits,
    MissionError,
    MustDo,
    Pose,
    Request,
    Sky,
    SunElevation,
    Target,
    Tracked,
    Window,
)
from mission.codec import Codec
from mission.day import DAYS

numbers = st.floats(-1e6, 1e6)
amounts = st.floats(0, 1e9)


@st.composite
def windows(draw: st.DrawFn) -> Window:
    a, b = sorted((draw(amounts), draw(amounts)))
    return Window(a, b)


@st.composite
def days(draw: st.DrawFn) -> Day:
    targets = tuple(
        Target(f"T{k}", draw(st.text(max_size=8)), (draw(numbers), draw(numbers), draw(numbers)))
        for k in range(draw(st.integers(1, 4)))
    )
    requests: list[Request] = []
    for k in range(draw(st.integers(0, 5))):
        kinds: list[st.SearchStrategy[Constraint]] = [
            st.just(Tracked()),
            st.just(MustDo()),
            windows(),
            st.just(SunElevation(0.3)),
        ]
        if requests:
            kinds.append(st.sampled_from([r.id for r in requests]).map(After))
        requests.append(
            Request(
                f"R{k}",
                draw(st.sampled_from(targets)).id,
                draw(st.sampled_from(("mi", "drill"))),
                draw(amounts),
                tuple(draw(st.lists(st.one_of(kinds), max_size=3))),
                draw(st.none() | amounts),
                draw(st.none() | st.builds(Pose, numbers, numbers, st.floats(-7, 7))),
            )
        )
    corners = ((0.0, 0.0), (1.0, 0.0), (0.0, 1.0))
    return Day(
        draw(st.text(max_size=10)),
        Pose(draw(numbers), draw(numbers)),
        Limits(draw(amounts), draw(amounts)),
        targets,
        tuple(requests),
        tuple(KeepOut(f"K{k}", corners) for k in range(draw(st.integers(0, 2)))),
        sky=Sky(start_lmst_h=draw(st.floats(0, 23.9))),
        refs={"mission": "msn"},
    )


@given(days())
def test_a_day_written_and_read_is_the_same_day_and_fits_its_schema(day: Day) -> None:
    assert DAYS.read(DAYS.write(day)) == day
    jsonschema.validate(DAYS.document(day), DAYS.schema())


def example() -> dict[str, Any]:
    return DAYS.document(
        Day(
            "sol 1",
            Pose(0.0, 0.0),
            Limits(1000.0, 5.0),
            (Target("T", "Elba", (1.0, 2.0, 3.0)),),
            (Request("R", "T", "mi", 5.0, (Tracked(), Window(1.0, 2.0))),),
        )
    )


@pytest.mark.parametrize(
    ("spoil", "message"),
    [
        (lambda d: d["requests"][0].update(value=-1), "requests[R].value is -1; it must be at least 0"),
        (lambda d: d["requests"][0].update(valu=1), "requests[R].valu is not a known member"),
        (lambda d: d["requests"][0].update(value="3"), 'requests[R].value must be a number, found "3"'),
        (lambda d: d["requests"][0].pop("value"), "requests[R].value is missing"),
        (
            lambda d: d["requests"][0]["constraints"][1].update(opens_s=9),
            "requests[R].constraints[1] is not possible: a window opens at 9 s after it closes at 2 s",
        ),
        (
            lambda d: d["requests"][0]["constraints"][1].update(opens_s=None),
            "requests[R].constraints[1].opens_s must be a number, found null",
        ),
        (
            lambda d: d["requests"][0]["constraints"][1].pop("kind"),
            'requests[R].constraints[1] has no "kind"',
        ),
        (lambda d: d["requests"][0]["constraints"][1].pop("opens_s"), "constraints[1].opens_s is missing"),
        (lambda d: d["requests"][0].update(target_id="Q"), "observation request R: unknown target Q"),
        (lambda d: d["targets"].append(d["targets"][0]), "target T stands in the day twice"),
        (lambda d: d["targets"][0].update(point_site=[1, 2]), "targets[T].point_site[2] is missing"),
        (lambda d: d["targets"][0].update(point_site=[1, 2, math.inf]), "targets[T].point_site[2]"),
        (lambda d: d.update(limits=None), "limits must be an object, found null"),
        (lambda d: d.update(sky={"latitude_deg": 91}), "latitude_deg is 91; it must lie in -90 to 90"),
        (
            lambda d: d.update(format="day/2"),
            'has the format "day/2", newer than this program; it reads day/1',
        ),
        (lambda d: d.pop("format"), 'has the format null; it must be "day/1"'),
    ],
)
def test_what_is_wrong_is_named_with_its_value_and_limit(
    spoil: Callable[[dict[str, Any]], object], message: str
) -> None:
    document = example()
    spoil(document)
    with pytest.raises(FormatError) as err:
        DAYS.from_document(document)
    assert message in str(err.value)


@pytest.mark.parametrize(
    "text", ["", "[", "[]", "3", "NaN", '{"format": "day/1", "name": NaN}', "{" * 100_000]
)
def test_no_text_ends_in_another_error(text: str) -> None:
    with pytest.raises(FormatError):
        DAYS.read(text)


def test_an_unknown_kind_of_constraint_is_told_with_the_known_ones() -> None:
    document = example()
    document["requests"][0]["constraints"][1] = {"kind": "moon"}
    with pytest.raises(FormatError, match="after, must_do, sun_elevation, tracked, window"):
        DAYS.from_document(document)


def test_an_older_version_is_brought_up_step_by_step() -> None:
    codec = Codec(
        Day,
        "day/1",
        "day",
        upgrades={
            "day/0": ("day/0.5", lambda d: {**d, "limits": {"time_s": d["seconds"]}}),
            "day/0.5": (
                "day/1",
                lambda d: {
                    "name": d["name"],
                    "start": {"east_m": 0, "north_m": 0},
                    "limits": {**d["limits"], "energy_j": 1},
                },
            ),
        },
    )
    day = codec.from_document({"format": "day/0", "name": "old", "seconds": 10})
    assert (day.name, day.limits) == ("old", Limits(10.0, 1.0))


def test_a_room_has_its_own_kind_of_error() -> None:
    class PlannerError(Exception): ...

    codec = Codec(Day, "day/1", "day", error=PlannerError)
    with pytest.raises(PlannerError, match="is not JSON"):
        codec.read(json.dumps(example())[:-1])


def test_values_check_what_joins_their_members() -> None:
    with pytest.raises(MissionError, match="comes after the unknown request R9"):
        Day(
            "d",
            Pose(0, 0),
            Limits(1, 1),
            (Target("T", "", (0, 0, 0)),),
            (Request("R", "T", "mi", 1.0, (After("R9"),)),),
        )


def test_a_codec_that_was_sent_to_a_process_shares_what_is_compiled_there() -> None:
    sent = pickle.loads(pickle.dumps(DAYS))
    assert sent is not DAYS
    assert sent._adapter is DAYS._adapter
    assert sent.schema() == DAYS.schema()
