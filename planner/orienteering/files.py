"""Readers of the four benchmark formats, and the solution file.

Each reader scales lengths to integers: OPLib files have integer lengths by definition; OPTW lengths are
truncated to tenths (Solomon) or hundredths (Cordeau) by convention; the classic files have real lengths,
which are rounded up to millionths (a route that the integers accept is feasible in real numbers).
"""

from __future__ import annotations

import json
import math
from dataclasses import dataclass
from pathlib import Path
from typing import Any

import numpy as np

from planner.errors import RoutingError
from planner.orienteering.problem import Experiment, IntArray, RoutingProblem, RoutingSolution

CLASSIC_SCALE = 1_000_000
"""Units of length in one of a classic file."""


@dataclass(frozen=True, slots=True)
class RoutingFile:
    """A problem as read, with what a solution file needs.

    `lead` and `tail` are the node ids that the format puts before and after the ids of the experiments.
    """

    problem: RoutingProblem
    kind: str
    lead: tuple[int, ...] = ()
    tail: tuple[int, ...] = ()

    def route_ids(self, route: tuple[int, ...]) -> list[int | str]:
        """Return a route in the file's own node or task ids."""
        return [*self.lead, *(self.problem.experiments[i].id for i in route), *self.tail]


def read_routing_file(path: Path) -> RoutingFile:
    """Return the problem in a file of any of the four formats; the content decides which.

    Raises
    ------
    RoutingError
        If the file is none of them, or broken; the message names the file and what is wrong.
    """
    try:
        text = path.read_text(encoding="utf-8")
    except OSError as err:
        raise RoutingError(f"{path}: {err.strerror or err}") from err
    except UnicodeDecodeError as err:
        raise RoutingError(f"{path} is not a text file") from err
    try:
        if text.lstrip().startswith("{"):
            return _read_rover(json.loads(text), path.stem)
        if "NODE_SCORE_SECTION" in text:
            return _read_oplib(text, path.stem)
        lines = [line.split() for line in text.splitlines() if line.strip()]
        if lines and len(lines[0]) == 2:
            return _read_classic(lines, path.stem)
        if len(lines) > 2 and len(lines[0]) == 4 and len(lines[1]) == 2:
            return _read_optw(lines, path.stem)
    except RoutingError as err:
        raise RoutingError(f"{path}: {err}") from err
    except (KeyError, ValueError, IndexError, TypeError, OverflowError) as err:
        what = f"lacks {err}" if isinstance(err, KeyError) else str(err)
        raise RoutingError(f"{path} is broken: {what}") from err
    raise RoutingError(
        f"{path} is none of the formats rover-orienteering-1, OPLib, classic (Tmax P; x y score) and OPTW"
    )


def solution_document(file: RoutingFile, solution: RoutingSolution) -> dict[str, object]:
    """Return the members of a solution file."""
    return {
        "value": solution.value,
        "upper": solution.upper,
        "proven": solution.proven,
        "route": file.route_ids(solution.route) if solution.value is not None else [],
        "engine": solution.engine,
        "wall_s": round(solution.wall_s, 6),
        "seed": solution.seed,
        "iterations": solution.iterations,
        "notes": list(solution.notes),
    }


# --------------------------------------------------------------------------- formats


def _whole(value: Any, what: str) -> int:
    if (
        isinstance(value, bool)
        or not isinstance(value, int | float)
        or not math.isfinite(value)
        or value != int(value)
    ):
        raise RoutingError(f"{what} is {value!r}; a whole number is needed")
    return int(value)


def _read_rover(data: dict[str, Any], name: str) -> RoutingFile:
    if data.get("format") != "rover-orienteering-1":
        raise RoutingError(f"format is {data.get('format')!r}; 'rover-orienteering-1' is understood")

    def matrix(key: str) -> IntArray:
        rows = data[key]
        if not isinstance(rows, list) or any(not isinstance(r, list) or len(r) != len(rows) for r in rows):
            raise RoutingError(f"{key} is not a square table")
        return np.array([[_whole(v, key) for v in r] for r in rows], dtype=np.int64)

    tasks = data["tasks"]
    experiments = tuple(
        Experiment(
            id=t["id"],
            site=_whole(t["site"], f"site of task {t['id']}"),
            prize=_whole(t["prize"], f"prize of task {t['id']}"),
            duration=_whole(t["duration"], f"duration of task {t['id']}"),
            energy=_whole(t["energy"], f"energy of task {t['id']}"),
            earliest_start=_whole(t.get("earliest_start", 0), f"earliest_start of task {t['id']}"),
            latest_end=None
            if t.get("latest_end") is None
            else _whole(t["latest_end"], f"latest_end of task {t['id']}"),
            must_do=bool(t.get("must_do", False)),
        )
        for t in tasks
    )
    index = {e.id: i for i, e in enumerate(experiments)}
    pairs = []
    for a, b in data.get("precedence", []):
        if a not in index or b not in index:
            raise RoutingError(f"precedence [{a}, {b}] names a task that is not there")
        pairs.append((index[a], index[b]))
    end = data.get("end_site")
    problem = RoutingProblem(
        travel_time=matrix("travel_time"),
        travel_energy=matrix("travel_energy"),
        experiments=experiments,
        time_budget=_whole(data["time_budget"], "time_budget"),
        energy_budget=None
        if data.get("energy_budget") is None
        else _whole(data["energy_budget"], "energy_budget"),
        start_site=_whole(data.get("start_site", 0), "start_site"),
        end_site=None if end is None else _whole(end, "end_site"),
        precedence=tuple(pairs),
        name=str(data.get("name", name)),
    )
    return RoutingFile(problem, "rover")


def _op(
    roads: IntArray,
    prizes: list[int],
    budget: int,
    start: int,
    end: int,
    ids: list[int],
    name: str,
    windows: list[tuple[int, int]] | None = None,
    service: list[int] | None = None,
) -> RoutingProblem:
    """Return a problem with one experiment at each node but start and end."""
    experiments = tuple(
        Experiment(
            id=ids[i],
            site=i,
            prize=prizes[i],
            duration=0 if service is None else service[i],
            earliest_start=0 if windows is None else windows[i][0],
            latest_end=None if windows is None or service is None else windows[i][1] + service[i],
        )
        for i in range(len(prizes))
        if i not in (start, end)
    )
    return RoutingProblem(
        travel_time=roads,
        travel_energy=np.zeros_like(roads),
        experiments=experiments,
        time_budget=budget,
        start_site=start,
        end_site=end,
        base_prize=sum(prizes[i] for i in {start, end}),
        name=name,
    )


def _read_classic(lines: list[list[str]], name: str) -> RoutingFile:
    budget = math.floor(float(lines[0][0]) * CLASSIC_SCALE + 0.1)
    if any(len(line) != 3 for line in lines[1:]) or len(lines) < 3:
        raise RoutingError("a line after the first is not 'x y score', or there are fewer than two points")
    xy = np.array([[float(a), float(b)] for a, b, _ in lines[1:]])
    if not np.isfinite(xy).all():
        raise RoutingError("a coordinate is not finite")
    roads = np.ceil(_euclid(xy) * CLASSIC_SCALE - 1e-3).astype(np.int64)
    prizes = [_whole(float(s), "a score") for _, _, s in lines[1:]]
    ids = list(range(1, len(prizes) + 1))
    return RoutingFile(_op(roads, prizes, budget, 0, 1, ids, name), "classic", (1,), (2,))


def _read_optw(lines: list[list[str]], name: str) -> RoutingFile:
    scale = 100 if name.lower().startswith("pr") else 10
    rows = [[float(v) for v in line] for line in lines[2:]]
    xy = np.array([[r[1], r[2]] for r in rows])
    roads = np.floor(_euclid(xy) * scale + 1e-7).astype(np.int64)
    ids = [int(r[0]) for r in rows]
    windows = [(_whole(r[-2] * scale, "a window"), _whole(r[-1] * scale, "a window")) for r in rows]
    service = [_whole(round(r[3] * scale, 6), "a service time") for r in rows]
    prizes = [_whole(r[4], "a score") for r in rows]
    return RoutingFile(_op(roads, prizes, windows[0][1], 0, 0, ids, name, windows, service), "optw")


def _read_oplib(text: str, name: str) -> RoutingFile:
    head: dict[str, str] = {}
    sections: dict[str, list[list[str]]] = {}
    current: list[list[str]] | None = None
    for raw in text.splitlines():
        line = raw.strip()
        if not line:
            continue
        if line == "EOF":
            break
        word = line.split(":")[0].strip()
        if word.endswith("_SECTION"):
            current = sections.setdefault(word, [])
        elif ":" in line:
            key, value = line.split(":", 1)
            head[key.strip()] = value.strip()
            current = None
        elif current is not None:
            current.append(line.split())
    n = int(head["DIMENSION"])
    budget = _whole(float(head["COST_LIMIT"]), "COST_LIMIT")
    kind = head["EDGE_WEIGHT_TYPE"]
    scores = {int(i): _whole(float(s), "a score") for i, s in sections["NODE_SCORE_SECTION"]}
    if kind == "EXPLICIT":
        roads = _explicit(
            head["EDGE_WEIGHT_FORMAT"], [int(float(v)) for r in sections["EDGE_WEIGHT_SECTION"] for v in r], n
        )
        ids = list(range(1, n + 1))
    else:
        rows = sections["NODE_COORD_SECTION"]
        ids = [int(r[0]) for r in rows]
        xy = np.array([[float(r[1]), float(r[2])] for r in rows])
        if len(ids) != n or not np.isfinite(xy).all():
            raise RoutingError(f"DIMENSION is {n}, {len(ids)} nodes have coordinates")
        roads = _tsplib(kind, xy)
    if set(scores) != set(ids):
        raise RoutingError("NODE_SCORE_SECTION does not name every node once")
    depot = int(sections["DEPOT_SECTION"][0][0])
    start = ids.index(depot)
    return RoutingFile(
        _op(roads, [scores[i] for i in ids], budget, start, start, ids, name), "oplib", (depot,)
    )


def _euclid(xy: np.ndarray[Any, np.dtype[np.float64]]) -> np.ndarray[Any, np.dtype[np.float64]]:
    return np.hypot(xy[:, None, 0] - xy[None, :, 0], xy[:, None, 1] - xy[None, :, 1])


def _tsplib(kind: str, xy: np.ndarray[Any, np.dtype[np.float64]]) -> IntArray:
    """Return TSPLIB's integer lengths (Reinelt 1991, TSPLIB 95 documentation, section 2)."""
    if kind == "EUC_2D":
        return np.floor(_euclid(xy) + 0.5).astype(np.int64)
    if kind == "CEIL_2D":
        return np.ceil(_euclid(xy)).astype(np.int64)
    if kind == "ATT":
        return np.ceil(_euclid(xy) / math.sqrt(10.0) - 1e-12).astype(np.int64)
    if kind == "GEO":
        whole = np.trunc(xy)
        pi = 3.141592
        angle = pi * (whole + 5.0 * (xy - whole) / 3.0) / 180.0
        lat, lon = angle[:, 0], angle[:, 1]
        q1 = np.cos(lon[:, None] - lon[None, :])
        q2 = np.cos(lat[:, None] - lat[None, :])
        q3 = np.cos(lat[:, None] + lat[None, :])
        arc = np.arccos(np.clip(0.5 * ((1.0 + q1) * q2 - (1.0 - q1) * q3), -1.0, 1.0))
        out = (6378.388 * arc + 1.0).astype(np.int64)
        np.fill_diagonal(out, 0)
        return out
    raise RoutingError(f"EDGE_WEIGHT_TYPE is {kind}; EUC_2D, CEIL_2D, ATT, GEO and EXPLICIT are understood")


def _explicit(layout: str, values: list[int], n: int) -> IntArray:
    out = np.zeros((n, n), dtype=np.int64)
    if layout == "FULL_MATRIX":
        return np.array(values, dtype=np.int64).reshape(n, n)
    cells = {
        "UPPER_ROW": [(i, j) for i in range(n) for j in range(i + 1, n)],
        "LOWER_ROW": [(i, j) for i in range(n) for j in range(i)],
        "UPPER_DIAG_ROW": [(i, j) for i in range(n) for j in range(i, n)],
        "LOWER_DIAG_ROW": [(i, j) for i in range(n) for j in range(i + 1)],
    }.get(layout)
    if cells is None or len(cells) != len(values):
        raise RoutingError(f"EDGE_WEIGHT_FORMAT {layout} with {len(values)} numbers for {n} nodes")
    for (i, j), value in zip(cells, values, strict=True):
        out[i, j] = out[j, i] = value
    return out
