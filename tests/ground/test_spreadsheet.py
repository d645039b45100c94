"""A table that a spreadsheet opens holds no formula, whatever was written into it, and loses nothing."""

from __future__ import annotations

import csv
import io

import pytest
from hypothesis import example, given
from hypothesis import strategies as st

from ground.spreadsheet import inert, shown

TEXTS = st.text(st.sampled_from("=+-@\t\r\n;,|\"' a1.＝＠") | st.characters(codec="utf-8"), max_size=30)
FORMULA = tuple("=+-@\t\r＝＋－＠")


@given(TEXTS)
@example("=cmd|'/C calc'!A0")
@example("a;=1+1")
@example("'=x")
@example("''=x")
@example("=\t=;'+")
@example("-1.5")
def test_what_goes_out_comes_back(text: str) -> None:
    assert shown(inert(text)) == text


@given(TEXTS, st.sampled_from(";,\t|"))
@example("note;=HYPERLINK(1)", ";")
@example('quote"=1', ",")
def test_no_cell_is_a_formula_however_lines_are_split(text: str, separator: str) -> None:
    out = io.StringIO(newline="")
    csv.writer(out).writerow(["Rock", inert(text), "x"])
    for line in out.getvalue().split("\n"):
        for cell in line.replace('"', separator).split(separator):
            bare = cell.strip(" ")
            if bare.startswith(FORMULA) and bare.strip("\r"):
                assert not bare.strip("-+0123456789.eE;, \r"), (cell, line)


@pytest.mark.parametrize("number", ["-1.5", "1e-05", "-1.0 2.0; -3.0 4.5", ""])
def test_numbers_stay_numbers(number: str) -> None:
    assert inert(number) == number
