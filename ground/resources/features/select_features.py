"""Find the features that are asked for by box, time and filter."""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass, replace
from datetime import datetime
from typing import TYPE_CHECKING

from sqlalchemy.orm import Session

from ground.errors import InvalidInputError, NotFoundError, StateError
from ground.gdr.repository import Repository
from ground.geo.place import Place
from ground.records.actor import Action, Actor
from ground.records.get_resource import require_mission
from ground.resources.features.collections import collection_of
from ground.resources.features.references import Reference, flipped, out, wanted
from ground.resources.features.value import Collection, Feature, Selection
from ground.resources.missions.where import site_of
from neighbours.geodata.cql2 import Cql2Error, Expression, Subject, checked, holds, moved, read_cql2
from neighbours.geodata.cql2.geometries import box
from neighbours.geodata.cql2.times import instant

if TYPE_CHECKING:
    from shapely.geometry.base import BaseGeometry

MOST = 10_000
CQL2_TEXT = "cql2-text"


@dataclass(frozen=True, slots=True)
class Question:
    """What is asked of a collection, as it stands in the request."""

    limit: int = 10
    after: str | None = None
    bbox: str | None = None
    bbox_crs: str | None = None
    datetime: str | None = None
    crs: str | None = None
    filter: str | None = None
    filter_lang: str | None = None
    filter_crs: str | None = None


def place_of(session: Session, mission_id: str) -> Place:
    """Return where a mission lies.

    Raises
    ------
    NotFoundError, StateError
        If there is no such mission, or nobody has said where it lies.
    """
    require_mission(session, mission_id)
    place = site_of(session, mission_id)
    if place is None:
        raise StateError(
            f"mission {mission_id} has no place on a body, and features are in coordinates of one; give it "
            f"one (place), or take its site metres from /missions/{mission_id}/geometry"
        )
    return place


def select_features(
    repo: Repository, actor: Actor, mission_id: str, collection_id: str, asked: Question
) -> Selection:
    """Return a page of the features of a collection that lie in the box and time and fit the filter.

    Raises
    ------
    NotFoundError, StateError
        If there is no such mission or collection, or the mission has no place.
    InvalidInputError
        If a parameter cannot be used; it is named.
    """
    actor.require(Action.READ, mission_id)
    with repo.database.read() as session:
        place = place_of(session, mission_id)
        collection, read = collection_of(collection_id)
        to = wanted(place, asked.crs, "crs")
        tests = _Tests.of(place, collection, asked)
        found = sorted(read(repo, session, mission_id, None), key=lambda feature: feature.id)
    found = tests.passed(place, found)
    behind = [f for f in found if asked.after is None or f.id > asked.after]
    page = behind[: min(asked.limit, MOST)]
    shown = [
        replace(feature, geometry=shape)
        for feature, shape in zip(page, out(place, [f.geometry for f in page], to), strict=True)
    ]
    after = page[-1].id if len(behind) > len(page) else None
    return Selection(shown, len(found), after, to.uri)


def get_feature(
    repo: Repository, actor: Actor, mission_id: str, collection_id: str, feature_id: str, crs: str | None
) -> Selection:
    """Return one feature.

    Raises
    ------
    NotFoundError, StateError, InvalidInputError
        If there is none, the mission has no place, or there is no such reference.
    """
    actor.require(Action.READ, mission_id)
    with repo.database.read() as session:
        place = place_of(session, mission_id)
        _, read = collection_of(collection_id)
        to = wanted(place, crs, "crs")
        feature = next(iter(read(repo, session, mission_id, feature_id)), None)
    if feature is None:
        raise NotFoundError(f"there is no feature {feature_id} in {collection_id}")
    (shape,) = out(place, [feature.geometry], to)
    return Selection([replace(feature, geometry=shape)], 1, None, to.uri)


@dataclass(frozen=True, slots=True)
class _Tests:
    """What a feature has to pass; geometries are x before y in the reference beside them."""

    area: tuple[BaseGeometry, Reference] | None
    time: tuple[datetime | None, datetime | None] | None
    filter: tuple[Expression, Reference] | None

    @staticmethod
    def of(place: Place, collection: Collection, asked: Question) -> _Tests:
        return _Tests(
            _area(place, asked),
            None if asked.datetime is None else _times(asked.datetime),
            _filter(place, collection, asked),
        )

    def passed(self, place: Place, features: Sequence[Feature]) -> list[Feature]:
        found = list(features)
        if self.time is not None:
            start, end = self.time
            found = [
                f
                for f in found
                if (start is None or f.created >= start) and (end is None or f.created <= end)
            ]
        if self.area is not None:
            area, reference = self.area
            shapes = out(place, [f.geometry for f in found], reference, in_order=False)
            # what lies nowhere lies in every box: OGC 17-069r4, 7.15.3
            found = [
                f for f, shape in zip(found, shapes, strict=True) if shape is None or shape.intersects(area)
            ]
        if self.filter is not None:
            condition, reference = self.filter
            shapes = out(place, [f.geometry for f in found], reference, in_order=False)
            found = [
                f
                for f, shape in zip(found, shapes, strict=True)
                if holds(condition, Subject({**f.properties, "created_utc": f.created}, shape))
            ]
        return found


def _area(place: Place, asked: Question) -> tuple[BaseGeometry, Reference] | None:
    reference = wanted(place, asked.bbox_crs, "bbox-crs")
    if asked.bbox is None:
        return None
    try:
        numbers = [float(part) for part in asked.bbox.split(",")]
        if reference.north_first and len(numbers) in {4, 6}:
            half = len(numbers) // 2
            numbers[0], numbers[1] = numbers[1], numbers[0]
            numbers[half], numbers[half + 1] = numbers[half + 1], numbers[half]
        return box(numbers), reference
    except ValueError as err:
        raise InvalidInputError(f"bbox is {asked.bbox[:80]!r}: {err}", pointer="bbox") from err


def _times(text: str) -> tuple[datetime | None, datetime | None]:
    ends = text.split("/")
    try:
        if len(ends) > 2 or (len(ends) == 2 and all(end in {"", ".."} for end in ends)):
            raise Cql2Error("a time is one moment, or two with / between, one of which may be ..")
        found = [None if end in {"", ".."} and len(ends) == 2 else instant(end).at for end in ends]
        if len(found) == 2 and found[0] is not None and found[1] is not None and found[1] < found[0]:
            raise Cql2Error("it ends before it begins")
    except Cql2Error as err:
        raise InvalidInputError(f"datetime is {text[:80]!r}: {err}", pointer="datetime") from err
    return found[0], found[-1]


def _filter(place: Place, collection: Collection, asked: Question) -> tuple[Expression, Reference] | None:
    if asked.filter_lang not in (None, CQL2_TEXT):
        raise InvalidInputError(
            f"filter-lang is {asked.filter_lang!r}; there is {CQL2_TEXT}", pointer="filter-lang"
        )
    reference = wanted(place, asked.filter_crs, "filter-crs")
    if asked.filter is None:
        return None
    try:
        condition = checked(read_cql2(asked.filter), collection.queryables)
    except Cql2Error as err:
        raise InvalidInputError(f"filter: {err}", pointer="filter") from err
    return (moved(condition, flipped) if reference.north_first else condition), reference
