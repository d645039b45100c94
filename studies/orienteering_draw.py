"""Goal selection on OPLib files drawn at random, beside PyVRP, OR-Tools routing and CP-SAT.

    python -m studies.orienteering_draw OPLIB TABLES [--files 24] [--draw N] [--limits 1 10] [--seeds 3]
        [--solvers Outcrop PyVRP ...] [--first K]

OPLIB is a copy of bcamath-ds/OPLib, TABLES the folder `complete-results` of
alberto-santini/orienteering-alns.
Files of 50 to 800 nodes are drawn, without those that were looked at while the engine was made
(`LOOKED_AT`) and those whose scores were changed after the tables were published (`CHANGED`). Limits are
seconds of processor time, for all solvers alike; the product's own checker values every route. The best known
value is the best of all methods in both tables. The number of the draw and the seeds come from the system
unless given, and are printed; a file's figure is the median over the seeds.
"""

from __future__ import annotations

import argparse
import random
import re
import statistics
import time
import xml.etree.ElementTree as ElementTree
import zipfile
from collections.abc import Iterator
from pathlib import Path

from planner.errors import RoutingError
from planner.orienteering import read_routing_file, route_value, warm_up

LOOKED_AT = {
    *(
        f"{name}-gen1"
        for name in (
            "ali535",
            "att532",
            "d657",
            "gil262",
            "lin318",
            "pr124",
            "pr144",
            "pr299",
            "rat783",
            "u159",
        )
    ),
    *(
        f"{name}-gen2"
        for name in (
            "att532",
            "berlin52",
            "d198",
            "eil76",
            "fl417",
            "kroA150",
            "kroB150",
            "kroB200",
            "lin318",
            "p654",
            "pa561",
            "pr107",
            "pr124",
            "pr136",
            "pr226",
            "rat783",
            "rd400",
            "st70",
            "u574",
            "u724",
        )
    ),
    *(
        f"{name}-gen3"
        for name in (
            "att532",
            "berlin52",
            "d493",
            "eil101",
            "eil51",
            "fl417",
            "gil262",
            "gr202",
            "gr666",
            "kroA100",
            "kroA150",
            "lin105",
            "lin318",
            "p654",
            "pr124",
            "pr136",
            "pr152",
            "pr226",
            "pr264",
            "pr299",
            "rd400",
            "st70",
            "ts225",
            "u574",
        )
    ),
    *(
        f"{name}-gen4"
        for name in (
            "ali535",
            "att532",
            "d657",
            "eil101",
            "kroA200",
            "kroC100",
            "lin318",
            "pcb442",
            "pr439",
        )
    ),
}
"""Tuned on, or looked at: also the files of draw 420293."""
CHANGED = {f"{name}-gen3" for name in ("a280", "rat195", "tsp225", "rat575", "rat783", "rat99")}
LEAST, MOST = 50, 800  # nodes


def sheets(path: Path) -> Iterator[tuple[str, list[list[str]]]]:
    """Yield name and rows of each table of a spreadsheet (OpenDocument)."""
    tree = ElementTree.fromstring(zipfile.ZipFile(path).read("content.xml"))
    table = "{urn:oasis:names:tc:opendocument:xmlns:table:1.0}"
    office = "{urn:oasis:names:tc:opendocument:xmlns:office:1.0}"
    for sheet in tree.iter(f"{table}table"):
        rows = []
        for row in sheet.iter(f"{table}table-row"):
            found: list[str] = []
            for cell in row.iter(f"{table}table-cell"):
                text = cell.get(f"{office}value") or "".join(cell.itertext())
                found += [text] * min(int(cell.get(f"{table}number-columns-repeated", 1)), 40)
            rows.append(found)
        yield str(sheet.get(f"{table}name")), rows


def _most(texts: list[str]) -> int:
    return max((round(float(t)) for t in texts if re.fullmatch(r"\d+(\.\d+)?", t)), default=0)


def best_known(tables: Path) -> dict[str, int]:
    """Return the best value of all methods for each file of the tables, by `name-generation`."""
    best: dict[str, int] = {}
    for name, rows in sheets(tables / "results-long-timeout.ods"):
        generation = name.split("-")[0]
        for row in rows:
            if len(row) > 14:
                best[f"{row[0]}-{generation}"] = _most([row[k] for k in (1, 2, 5, 8, 11, 14)])
    for _, rows in sheets(tables / "results-short-timeout.ods"):
        for row in rows:
            if len(row) > 9 and (key := row[0].rpartition("-")[0]) in best:
                best[key] = max(best[key], _most([row[k] for k in (1, 2, 9)]))
    return best


def drawn(oplib: Path, tables: Path, draw: int, count: int) -> dict[Path, int]:
    """Return so many files, smallest first, each with its best known value."""
    paths = {p.stem.rpartition("-")[0]: p for p in sorted(oplib.glob("instances/gen*/*.oplib"))}
    best = best_known(tables)
    pool = [
        (p.stem, name)
        for name, p in paths.items()
        if best.get(name) and LEAST <= _nodes(name) <= MOST and name not in CHANGED and name not in LOOKED_AT
    ]
    chosen = random.Random(draw).sample(sorted(pool), count)
    print(f"draw {draw}: {count} of {len(pool)} files")
    return {paths[name]: best[name] for _, name in sorted(chosen, key=lambda c: (_nodes(c[1]), c[1]))}


def _nodes(name: str) -> int:
    found = re.search(r"\d+", name)
    return int(found.group()) if found else 0


def main() -> None:
    """Print a line for each answer, then a table."""
    parser = argparse.ArgumentParser(description=__doc__.splitlines()[0])
    parser.add_argument("oplib", type=Path)
    parser.add_argument("tables", type=Path)
    parser.add_argument("--files", type=int, default=24)
    parser.add_argument("--first", type=int, default=None, help="run every other file, so many of them")
    parser.add_argument("--draw", type=int, default=random.SystemRandom().randrange(10**6))
    parser.add_argument("--limits", type=float, nargs="+", default=[1.0, 10.0])
    parser.add_argument("--seeds", type=int, default=3, help="how many")
    parser.add_argument("--seed", type=int, default=random.SystemRandom().randrange(10**6), help="the first")
    parser.add_argument("--solvers", nargs="+", default=["Outcrop", "PyVRP", "CP-SAT", "OR-Tools routing"])
    options = parser.parse_args()
    time.perf_counter = time.process_time  # PyVRP and our solvers read this clock
    from benchmarks.orienteering import SOLVERS

    files = drawn(options.oplib, options.tables, options.draw, options.files)
    chosen = list(files)[:: max(1, len(files) // options.first)] if options.first else list(files)
    seeds = [options.seed + k for k in range(options.seeds)]
    print(f"seeds {seeds}", *(p.stem for p in chosen), flush=True)
    warm_up()
    problems = {path: read_routing_file(path).problem for path in chosen}
    for solver in options.solvers:
        SOLVERS[solver](problems[chosen[0]], 0.2, 0)
    for limit in options.limits:
        gaps: dict[str, list[float]] = {name: [] for name in options.solvers}
        used: dict[str, list[float]] = {name: [] for name in options.solvers}
        proofs = dict.fromkeys(options.solvers, 0)
        for path in chosen:
            for name in options.solvers:
                of_seed, closed = [], []
                for seed in seeds:
                    began = time.process_time()
                    route, proven, _ = SOLVERS[name](problems[path], limit, seed)
                    used[name].append((time.process_time() - began) / limit)
                    try:
                        value = route_value(problems[path], route)
                    except RoutingError:
                        value = 0
                    of_seed.append(100.0 * (1.0 - value / files[path]))
                    closed.append(proven)
                gaps[name].append(statistics.median(of_seed))
                proofs[name] += all(closed)
                print(
                    f"{limit:4g} s {name:16s} {path.stem:18s} best {files[path]:6d} gap",
                    *(f"{gap:6.2f}" for gap in of_seed),
                    "used",
                    *(f"{u:5.2f}" for u in used[name][-len(seeds) :]),
                    "proven" if all(closed) else "",
                    flush=True,
                )
        print(
            "| limit | solver | files | mean gap % | largest | over 2 % | proven | median used | most used |"
        )
        for name in options.solvers:
            print(
                f"| {limit:g} s | {name} | {len(chosen)} | {statistics.mean(gaps[name]):.2f} | "
                f"{max(gaps[name]):.2f} | {sum(g > 2 for g in gaps[name])} | {proofs[name]} | "
                f"{statistics.median(used[name]):.2f} | {max(used[name]):.2f} |",
                flush=True,
            )


if __name__ == "__main__":
    main()
