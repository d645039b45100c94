"""XTCE that yamcs-pymdb wrote, and XTCE that somebody made to do harm."""

from __future__ import annotations

import builtins
from pathlib import Path
from typing import Any

import pytest
import yamcs.pymdb as mdb

from executive.crl.dictionary import ValueType
from neighbours.flight.errors import FlightError, ForeignDictionaryError
from neighbours.flight.flight_map import FlightMap
from neighbours.flight.foreign import Flag, Group
from neighbours.flight.import_dictionary import import_dictionary
from neighbours.flight.xtce_dictionary import read_xtce
from rover_iface.profile import load_profile


def database() -> mdb.System:
    """Return a rover's mission database with each type that XTCE has for an argument."""
    root = mdb.System("Rover")
    power = mdb.Subsystem(name="power", system=root)
    mdb.FloatParameter(
        system=power, name="battery", units="J", minimum=0, maximum=5e6, encoding=mdb.float32_t
    )
    mdb.EnumeratedParameter(system=root, name="mode", choices=[(0, "IDLE"), (1, "GO")], encoding=mdb.uint8_t)
    head = mdb.Command(
        system=root,
        name="Head",
        abstract=True,
        arguments=[
            mdb.IntegerArgument(name="apid", encoding=mdb.uint16_t),
            mdb.IntegerArgument(name="count", encoding=mdb.uint16_t),
        ],
    )
    arguments = [
        mdb.EnumeratedArgument(name="gain", choices=[(0, "LOW"), (1, "HIGH")], encoding=mdb.uint8_t),
        mdb.IntegerArgument(name="exposure", minimum=1, maximum=500, units="ms", encoding=mdb.uint16_t),
        mdb.FloatArgument(name="angle", minimum=-1.5, maximum=2.5, units="rad", encoding=mdb.float32_t),
        mdb.BooleanArgument(name="save", encoding=mdb.bool_t),
        mdb.StringArgument(name="label", encoding=mdb.StringEncoding()),
        mdb.ArrayArgument(name="to", length=3, data_type=mdb.FloatDataType(encoding=mdb.float32_t)),
        mdb.AggregateArgument(
            name="roi",
            members=[
                mdb.FloatMember(name="width", encoding=mdb.float32_t),
                mdb.IntegerMember(name="height", encoding=mdb.uint8_t),
            ],
        ),
    ]
    mdb.Command(
        system=power, name="MEASURE", base=head, assignments={"apid": 3}, short_description="measure",
        arguments=arguments, entries=[],
    )  # fmt: skip
    blob = mdb.BinaryArgument(name="table", encoding=mdb.BinaryEncoding(bits=64))
    mdb.Command(system=root, name="LOAD", arguments=[blob], entries=[])
    return root


def written(folder: Path, text: str | None = None) -> Path:
    path = folder / "rover.xml"
    path.write_text(database().dumps() if text is None else text)
    return path


def test_every_type_of_xtce_becomes_parameters_or_is_named(tmp_path: Path) -> None:
    foreign = read_xtce(written(tmp_path))
    assert [c.name for c in foreign.commands] == ["LOAD", "power.MEASURE"]
    made = import_dictionary(foreign, FlightMap(), load_profile("k9").language, "scout")
    assert made.left_out == ("command LOAD: its argument table is a binary",)
    measure = made.dictionary.commands.actions["power.MEASURE"]
    names = [p.name for p in measure.parameters]
    assert " ".join(names) == "count gain exposure angle save label to.0 to.1 to.2 roi.width roi.height"
    assert measure.doc == "measure"
    spec = {p.name: p for p in measure.parameters}
    assert spec["gain"].choices == ("LOW", "HIGH")
    assert (spec["exposure"].minimum, spec["exposure"].maximum, spec["exposure"].unit) == (1.0, 500.0, "ms")
    assert (spec["angle"].minimum, spec["angle"].maximum) == (-1.5, 2.5)
    assert spec["save"].type is ValueType.BOOLEAN
    battery = made.dictionary.telemetry.keys["power.battery"]
    assert (battery.unit, battery.maximum) == ("J", 5e6)
    assert made.dictionary.telemetry.keys["mode"].choices == ("IDLE", "GO")
    told = {remark.text: remark.where for remark in made.remarks}
    assert "power.MEASURE exposure" in told["whole numbers, which are numbers here"]


def test_contradictions_of_xtce_are_all_named(tmp_path: Path) -> None:
    text = (
        database()
        .dumps()
        .replace('minInclusive="1" maxInclusive="500"', 'minInclusive="900" maxInclusive="500"')
        .replace('argumentTypeRef="MEASURE__angle"', 'argumentTypeRef="MEASURE__angel"')
        .replace('argumentName="apid"', 'argumentName="apd"')
        .replace('<Enumeration value="1" label="HIGH"/>', '<Enumeration value="1" label="LOW"/>')
    )
    with pytest.raises(ForeignDictionaryError) as caught:
        read_xtce(written(tmp_path, text))
    assert set(caught.value.findings) == {
        "power.MEASURE.exposure has the least value 900, above its largest 500",
        'power.MEASURE.angle has the type "MEASURE__angel", which is not defined',
        'command "power.MEASURE" assigns the argument "apd", which it does not have',
        'enumeration "MEASURE__gain" has the label "LOW" twice',
    }


LAUGHS = (
    '<!DOCTYPE SpaceSystem [<!ENTITY a "ha">'
    + "".join(f'<!ENTITY {y} "{f"&{x};" * 10}">' for x, y in zip("abcdefgh", "bcdefghi", strict=True))
    + ']><SpaceSystem name="&i;"/>'
)


@pytest.mark.parametrize(
    ("text", "words"),
    [
        (LAUGHS, "XML bomb might be: DTDForbidden"),
        ('<!DOCTYPE a [<!ENTITY f SYSTEM "file:///etc/passwd">]><a>&f;</a>', "XML bomb might be"),
        ("<SpaceSystem name='x'", "is not XML"),
        ("<svg/>", "begins with <svg>; XTCE begins with <SpaceSystem>"),
    ],
)
def test_what_is_no_xtce_is_refused_by_name(tmp_path: Path, text: str, words: str) -> None:
    with pytest.raises(ForeignDictionaryError, match=words):
        read_xtce(written(tmp_path, text))


def test_a_circle_of_commands_and_types_ends(tmp_path: Path) -> None:
    text = """<SpaceSystem name="R"><CommandMetaData><ArgumentTypeSet>
      <ArrayArgumentType name="t" arrayTypeRef="t"><DimensionList><Dimension>
      <StartingIndex><FixedValue>0</FixedValue></StartingIndex><EndingIndex><FixedValue>1</FixedValue></EndingIndex>
      </Dimension></DimensionList></ArrayArgumentType></ArgumentTypeSet><MetaCommandSet>
      <MetaCommand name="A"><BaseMetaCommand metaCommandRef="A"/>
      <ArgumentList><Argument name="x" argumentTypeRef="t"/></ArgumentList></MetaCommand>
      </MetaCommandSet></CommandMetaData></SpaceSystem>"""
    with pytest.raises(ForeignDictionaryError, match="rests on more than 20 commands"):
        read_xtce(written(tmp_path, text))


def test_a_missing_extra_is_named(tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> None:
    real = builtins.__import__

    def refuse(name: str, *rest: Any, **more: Any) -> Any:
        if name.startswith("defusedxml"):
            raise ImportError(name)
        return real(name, *rest, **more)

    path = written(tmp_path)
    monkeypatch.setattr(builtins, "__import__", refuse)
    with pytest.raises(FlightError, match=r"pip install 'outcrop\[flight\]'"):
        read_xtce(path)


def test_a_range_that_is_no_number_is_told(tmp_path: Path) -> None:
    text = database().dumps().replace('maxInclusive="500"', 'maxInclusive="NaN"')
    with pytest.raises(ForeignDictionaryError, match=r'power\.MEASURE\.exposure maxInclusive is "NaN"'):
        read_xtce(written(tmp_path, text))


def nested(levels: int, members: int) -> str:
    """Return XTCE whose type `t0` holds `members` of `t1`, each of those as many of `t2`, and so on."""
    held = "".join(
        f'<AggregateParameterType name="t{n}"><MemberList>'
        + "".join(f'<Member name="m{k}" typeRef="t{n + 1}"/>' for k in range(members))
        + "</MemberList></AggregateParameterType>"
        for n in range(levels)
    )
    return (
        f'<SpaceSystem name="R"><TelemetryMetaData><ParameterTypeSet>{held}'
        f'<BooleanParameterType name="t{levels}"/></ParameterTypeSet><ParameterSet>'
        '<Parameter name="p" parameterTypeRef="t0"/></ParameterSet></TelemetryMetaData></SpaceSystem>'
    )


def test_types_of_types_are_made_once_and_not_once_for_each_way_to_them(tmp_path: Path) -> None:
    """19 levels of two members each are half a million ways to the last type."""
    (channel,) = read_xtce(written(tmp_path, nested(19, 2))).channels
    kind = channel.type
    for _ in range(19):
        assert isinstance(kind, Group)
        (_, first), (_, second) = kind.members
        assert first is second
        kind = first
    assert kind == Flag()


def test_an_aggregate_without_members_and_types_that_are_too_deep_are_named(tmp_path: Path) -> None:
    with pytest.raises(ForeignDictionaryError, match='aggregate "t0" has no members'):
        read_xtce(written(tmp_path, nested(1, 0)))
    with pytest.raises(ForeignDictionaryError, match='type "t21" lies more than 20 types deep'):
        read_xtce(written(tmp_path, nested(30, 2)))
