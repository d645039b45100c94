"""What can be done with the value of each syntax: read it from text, write it as text, put it into JSON."""

from __future__ import annotations

from collections.abc import Callable, Mapping, Sequence
from dataclasses import dataclass
from enum import StrEnum
from functools import cache
from typing import Any

from executive.crl import fields as read
from executive.crl import json_values as js
from executive.crl import trees
from executive.crl.declaration import Syntax
from executive.crl.trees import Tree


@dataclass(frozen=True, slots=True)
class Codec:
    """`read` an item of the text, `tree` and `encode` a value, `decode` parsed JSON to pieces of text."""

    read: read.FieldReader
    tree: Callable[[Any], Tree]
    encode: Callable[[Any], object]
    decode: Callable[[str, object], Tree]


def _same(value: Any) -> Any:
    return value


def _all(one: Callable[[Any], Any]) -> Callable[[Sequence[Any]], list[Any]]:
    return lambda values: [one(value) for value in values]


def _array(one: Callable[[str, object], Tree]) -> Callable[[str, object], Tree]:
    return lambda name, value: [one(name, entry) for entry in js.array(name, value)]


_AMOUNTS = (_all(trees.amount_tree), _all(js.amount_json), js.generic_tree)

CODECS: Mapping[Syntax, Codec] = {
    Syntax.SYMBOL: Codec(read.read_symbol, _same, _same, js.symbol_tree),
    Syntax.STRING: Codec(read.read_string, trees.string_text, _same, js.string_tree),
    Syntax.EPOCH: Codec(read.read_epoch, trees.string_text, _same, js.string_tree),
    Syntax.NUMBER: Codec(read.read_number, trees.number_text, _same, js.generic_tree),
    Syntax.INTEGER: Codec(read.read_integer, trees.number_text, _same, js.generic_tree),
    Syntax.RETRIES: Codec(read.read_retries, trees.number_text, _same, js.generic_tree),
    Syntax.INSERTIONS: Codec(read.read_insertions, trees.number_text, _same, js.generic_tree),
    Syntax.DELAY: Codec(read.read_delay, trees.ms_text, js.seconds_json, js.generic_tree),
    Syntax.TRUTH: Codec(read.read_truth, trees.value_text, _same, js.generic_tree),
    Syntax.CONDITIONS: Codec(
        read.read_conditions,
        _all(trees.condition_tree),
        _all(js.condition_json),
        _array(js.json_condition_tree),
    ),
    Syntax.TEMPORALS: Codec(
        read.read_temporals, _all(trees.temporal_tree), _all(js.temporal_json), _array(js.json_temporal_tree)
    ),
    Syntax.INTERVAL: Codec(read.read_interval, trees.interval_tree, js.interval_json, js.json_interval_tree),
    Syntax.USES: Codec(read.read_uses, _all(trees.use_tree), _all(js.use_json), js.generic_tree),
    Syntax.REQUIRES: Codec(read.read_requires, *_AMOUNTS),
    Syntax.BUDGETS: Codec(read.read_budgets, *_AMOUNTS),
    Syntax.EXPECTATIONS: Codec(
        read.read_expectations, _all(trees.expectation_tree), _all(js.expectation_json), js.generic_tree
    ),
    Syntax.PARAMETERS: Codec(read.read_parameters, trees.parameters_tree, dict, js.json_parameters_tree),
    Syntax.UTILITY: Codec(read.read_utility, trees.utility_tree, js.utility_json, js.generic_tree),
    Syntax.RESOURCES: Codec(
        read.read_resources, _all(trees.resource_tree), _all(js.resource_json), _array(js.json_resource_tree)
    ),
}


@cache
def _choice(words: type[StrEnum]) -> Codec:
    return Codec(read.choice(words), lambda word: f":{word}", str, js.keyword_tree)


def codec(syntax: Syntax | type[StrEnum]) -> Codec:
    """Return what can be done with values of a syntax that holds no forms."""
    return CODECS[syntax] if isinstance(syntax, Syntax) else _choice(syntax)
