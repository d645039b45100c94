"""Goal selection side by side: this product, PyVRP, OR-Tools routing and CP-SAT on the same files in one run.

    python -m benchmarks.orienteering --every --keep --limits 0.1 1 --seeds 1 2 3
    python -m benchmarks.orienteering --report

By itself 21 files of all kinds are run; `--every` runs all of them. With `--keep` rows are kept in
`results/orienteering.jsonl` and what is there is not run again, so a run can be broken off and taken up;
`--report` makes the tables and the plot of what is there. Limits are seconds of processor time of the
process, for all solvers alike, because on a busy machine only that is a comparison; with `--clock wall` wall
seconds.

Solvers are interleaved file by file; each has its limit from the matrix in memory to the
checked route; imports and compiled kernels are warm. The product's own checker values every route, whatever
the solver claims. PyVRP has its better setting (prizes times budget + 1, unit distance cost 1), CP-SAT
`linearization_level` 2 and two workers, above 200 nodes 15 neighbours; OR-Tools routing has disjunction
penalties scaled likewise, parallel cheapest insertion and guided local search. A value above a proven
optimum, or a proof below the best known value, ends the run with an error.
"""

from __future__ import annotations

import contextlib
import csv
import json
import statistics
import threading
import time
from collections.abc import Callable, Iterator, Sequence
from dataclasses import replace
from pathlib import Path
from typing import Any

from benchmarks.common.figure import Figure, command
from benchmarks.common.instances import FOLDER
from planner.errors import RoutingError
from planner.orienteering import RoutingProblem, read_routing_file, route_value, solve, warm_up
from planner.orienteering.cp_sat import solve_cp_sat

FILES = FOLDER.parent / "benchmarks" / "orienteering"
QUICK = {"only": "rover05w", "limits": (0.1,)}
BUDGET_S = 900.0
SUBSET = {
    "rover05w-s1",
    "rover10w-s1",
    "rover10o-s1",
    "rover20w-s1",
    "rover20o-s1",
    "rover30w-s2",
    "rover30o-s1",
    "rover50w-s1",
    "rover50o-s1",
    "c101",
    "r101",
    "r104",
    "r105",
    "rc101",
    "pr01",
    "berlin52-gen3-50",
    "kroA100-gen3-50",
    "pr136-gen3-50",
    "gr202-gen3-50",
    "lin318-gen1-50",
    "att532-gen3-50",
}
ROWS = Path(__file__).parent / "results" / "orienteering.jsonl"

Answer = tuple[tuple[int, ...], bool, int | None]
Solver = Callable[[RoutingProblem, float, int], Answer]


def on_cpu() -> bool:
    """Return whether limits are seconds of processor time."""
    return time.perf_counter is time.process_time


def ours(problem: RoutingProblem, limit_s: float, seed: int) -> Answer:
    """Return route, proof and bound of this product."""
    found = solve(problem, time_limit_s=limit_s, seed=seed)
    return found.route, found.proven, found.upper


@contextlib.contextmanager
def _stop_on_cpu(limit_s: float) -> Iterator[None]:
    """Stop any CP-SAT search begun inside once the process has used so much more CPU time."""
    if not on_cpu():
        yield
        return
    from ortools.sat.python import cp_model

    deadline = time.process_time() + limit_s
    running: list[cp_model.CpSolver] = []
    finished = threading.Event()
    solve_model = cp_model.CpSolver.solve

    def watched(solver: cp_model.CpSolver, *args: Any, **kwargs: Any) -> Any:
        running.append(solver)
        return solve_model(solver, *args, **kwargs)

    def watch() -> None:
        while not finished.wait(0.005):
            if time.process_time() >= deadline and running:
                running[0].stop_search()

    cp_model.CpSolver.solve = watched
    watcher = threading.Thread(target=watch, daemon=True)
    watcher.start()
    try:
        yield
    finally:
        finished.set()
        watcher.join()
        cp_model.CpSolver.solve = solve_model


def cp_sat(problem: RoutingProblem, limit_s: float, seed: int) -> Answer:
    """Return what CP-SAT finds with two workers."""
    near = 15 if len(problem.experiments) > 200 else None
    with _stop_on_cpu(limit_s):
        wall = 1000.0 * limit_s if on_cpu() else limit_s
        found = solve_cp_sat(problem, time_limit_s=wall, seed=seed, threads=2, neighbours=near)
    return found.route, found.proven, found.upper


def pyvrp(problem: RoutingProblem, limit_s: float, seed: int) -> Answer:
    """Return what PyVRP finds; it knows neither precedence nor a second budget."""
    from pyvrp import Model
    from pyvrp.stop import MaxRuntime

    p, a = problem, problem.arrays
    model = Model()
    places = [model.add_location(0, k) for k in range(p.sites)]
    begin_at = model.add_depot(places[p.start_site])
    end = p.start_site if p.end_site is None else p.end_site
    end_at = begin_at if end == p.start_site else model.add_depot(places[end])
    price = p.time_budget + 1
    for i, e in enumerate(p.experiments):
        latest = int(a.latest_end[i] - a.duration[i])
        if latest >= e.earliest_start:
            model.add_client(
                places[e.site],
                service_duration=e.duration,
                tw_early=e.earliest_start,
                tw_late=latest,
                prize=e.prize * price,
                required=False,
                name=str(i),
            )
    model.add_vehicle_type(
        1,
        start_depot=begin_at,
        end_depot=end_at,
        tw_late=p.time_budget,
        max_distance=p.time_budget,
        shift_duration=p.time_budget,
    )
    for i in range(p.sites):
        for j in range(p.sites):
            road = int(p.travel_time[i, j]) if i != j else 0
            model.add_edge(places[i], places[j], road, road)
    # Its clock starts here: building the model road by road in Python does not count.
    found = model.solve(MaxRuntime(limit_s), seed=seed, display=False, collect_stats=False)
    names = [int(c.name) for c in model.clients]
    route: list[int] = []
    for tour in found.best.routes() if found.is_feasible() else ():
        route += [names[stop.idx] for stop in tour if stop.is_client()]
    return tuple(route), False, None


def routing(problem: RoutingProblem, limit_s: float, _seed: int) -> Answer:
    """Return what OR-Tools routing finds with guided local search."""
    from ortools.constraint_solver import pywrapcp, routing_enums_pb2

    begin = time.perf_counter()
    p, a = problem, problem.arrays
    count = len(p.experiments)
    site = [*a.site.tolist(), p.start_site, p.start_site if p.end_site is None else p.end_site]
    first, last = count, count + 1
    manager = pywrapcp.RoutingIndexManager(count + 2, 1, [first], [last])
    model = pywrapcp.RoutingModel(manager)
    service = [*a.duration.tolist(), 0, 0]
    fuel = [*a.energy.tolist(), 0, 0]

    def road(i: int, j: int, matrix: Any) -> int:
        return (
            0 if site[i] == site[j] or (j == last and p.end_site is None) else int(matrix[site[i], site[j]])
        )

    drive = [[road(i, j, p.travel_time) for j in range(count + 2)] for i in range(count + 2)]
    burn = [[road(i, j, p.travel_energy) + fuel[i] for j in range(count + 2)] for i in range(count + 2)]
    time_at = model.RegisterTransitCallback(
        lambda i, j: drive[manager.IndexToNode(i)][manager.IndexToNode(j)] + service[manager.IndexToNode(i)]
    )
    cost_at = model.RegisterTransitCallback(
        lambda i, j: drive[manager.IndexToNode(i)][manager.IndexToNode(j)]
    )
    model.SetArcCostEvaluatorOfAllVehicles(cost_at)
    model.AddDimension(time_at, p.time_budget, p.time_budget, True, "time")
    clock = model.GetDimensionOrDie("time")
    if p.energy_budget is not None:
        burn_at = model.RegisterTransitCallback(
            lambda i, j: burn[manager.IndexToNode(i)][manager.IndexToNode(j)]
        )
        model.AddDimension(burn_at, 0, p.energy_budget, True, "energy")
    for i, e in enumerate(p.experiments):
        node = manager.NodeToIndex(i)
        latest = int(a.latest_end[i] - a.duration[i])
        model.AddDisjunction([node], e.prize * (p.time_budget + 1))
        if latest < e.earliest_start:
            model.solver().Add(model.ActiveVar(node) == 0)
        else:
            clock.CumulVar(node).SetRange(e.earliest_start, latest)
    for b, c in p.precedence:
        one, two = manager.NodeToIndex(b), manager.NodeToIndex(c)
        model.solver().Add(model.ActiveVar(two) <= model.ActiveVar(one))
        model.solver().Add(
            clock.CumulVar(two) * model.ActiveVar(two) >= clock.CumulVar(one) * model.ActiveVar(two)
        )
    settings = pywrapcp.DefaultRoutingSearchParameters()
    settings.first_solution_strategy = routing_enums_pb2.FirstSolutionStrategy.PARALLEL_CHEAPEST_INSERTION
    settings.local_search_metaheuristic = routing_enums_pb2.LocalSearchMetaheuristic.GUIDED_LOCAL_SEARCH
    if on_cpu():
        deadline = begin + limit_s
        model.AddSearchMonitor(model.solver().CustomLimit(lambda: time.process_time() >= deadline))
        settings.time_limit.FromMilliseconds(int(1_000_000 * limit_s))
    else:
        settings.time_limit.FromMilliseconds(max(1, int(1000 * (limit_s - (time.perf_counter() - begin)))))
    found = model.SolveWithParameters(settings)
    if found is None:
        return (), False, None
    route = []
    at = found.Value(model.NextVar(model.Start(0)))
    while not model.IsEnd(at):
        route.append(manager.IndexToNode(at))
        at = found.Value(model.NextVar(at))
    return tuple(route), False, None


SOLVERS: dict[str, Solver] = {"Outcrop": ours, "PyVRP": pyvrp, "CP-SAT": cp_sat, "OR-Tools routing": routing}


def fits(solver: str, problem: RoutingProblem) -> bool:
    """Return whether a solver can express a problem at all."""
    if solver != "PyVRP":
        return True
    return problem.energy_budget is None and not problem.precedence and problem.end_site is not None


def _stored() -> list[dict[str, Any]]:
    if not ROWS.exists():
        return []
    return [json.loads(line) for line in ROWS.read_text(encoding="utf-8").splitlines()]


def run_file(
    file: str, problem: RoutingProblem, known: dict[str, str], limit_s: float, seed: int, keep: bool
) -> list[dict[str, Any]]:
    """Return one row a solver that can say the problem; with `keep` those that are not stored yet."""
    rows = []
    best = float(known["best_known"])
    have = {(r["file"], r["solver"], r["limit_s"], r["seed"]) for r in (_stored() if keep else ())}
    for name, solver in SOLVERS.items():
        if not fits(name, problem) or (file, name, limit_s, seed) in have:
            continue
        wall, cpu = time.perf_counter(), time.process_time()
        route, proven, upper = solver(problem, limit_s, seed)
        wall, cpu = time.perf_counter() - wall, time.process_time() - cpu
        try:
            value = route_value(problem, route)
        except RoutingError:
            value = None
        if value is not None and known["proven_optimal"] == "1" and value > best:
            raise SystemExit(f"{name} on {file}: {value} is above the proven optimum {best:g}")
        if proven and value != best and (value is None or value < best):
            raise SystemExit(f"{name} on {file}: claims a proof at {value}, known is {best:g}")
        gap = 100.0 if value is None else max(0.0, 100.0 * (best - value) / best) if best else 0.0
        rows.append(
            {
                "file": file,
                "solver": name,
                "limit_s": limit_s,
                "seed": seed,
                "best_known": best,
                "value": value,
                "gap": gap,
                "proven": proven,
                "upper": upper,
                "wall_s": wall,
                "cpu_s": cpu,
                "clock": "cpu" if on_cpu() else "wall",
            }
        )
        if keep:
            with ROWS.open("a", encoding="utf-8") as out:
                out.write(json.dumps(rows[-1]) + "\n")
        print(
            f"{file:36s} {limit_s:5g} s {name:17s} {value!s:>6} gap {gap:6.2f} "
            f"{'proof' if proven else '':5s} "
            f"{wall:6.2f} s wall {cpu:6.2f} s cpu",
            flush=True,
        )
    return rows


def family(file: str) -> str:
    """Return the group a file is reported in."""
    folder, name = file.split("/", 1)
    if folder == "rover":
        return f"rover, {int(name[5:7])} sites"
    return {
        "oplib": "OPLib surveys",
        "optw": "time windows, 48-100 nodes",
        "classic": "classic, 21-66 nodes",
    }[folder]


def summary(rows: list[dict[str, Any]]) -> str:
    """Return the table of all groups, limits and solvers as Markdown."""
    lines = [
        "| files | limit | solver | n | mean gap % | median | max | within 1 % | proven | median CPU s "
        "| p95 CPU s | PAR2 to proof, s |",
        "|---|---|---|---|---|---|---|---|---|---|---|---|",
    ]
    keys = sorted({(family(r["file"]), r["limit_s"]) for r in rows}, key=lambda k: (k[0][:5], len(k[0]), k))
    for group, limit in keys:
        for solver in SOLVERS:
            mine = [
                r
                for r in rows
                if family(r["file"]) == group and r["limit_s"] == limit and r["solver"] == solver
            ]
            if not mine:
                continue
            mine = _medians(mine)
            gaps = [r["gap"] for r in mine]
            cpus = sorted(r["cpu_s"] for r in mine)
            p95 = cpus[min(len(cpus) - 1, int(0.95 * len(cpus)))]
            lines.append(
                f"| {group} | {limit:g} s | {solver} | {len(mine)} | {statistics.mean(gaps):.2f} | "
                f"{statistics.median(gaps):.2f} | {max(gaps):.2f} | {sum(g <= 1 for g in gaps)} | "
                f"{sum(r['proven'] for r in mine)} | {statistics.median(cpus):.3f} | {p95:.3f} | "
                f"{statistics.mean(2 * r['limit_s'] if not r['proven'] else r['cpu_s'] for r in mine):.3f} |"
            )
    return "\n".join(lines)


def proofs(folder: Path) -> str:
    """Return the table of CPU times to proof over all rover files, no time limit, one thread."""
    from planner.orienteering.exact import ExactSolver

    times: dict[int, list[float]] = {}
    with (folder / "best_known.csv").open() as lines:
        best = {row["file"]: int(float(row["best_known"])) for row in csv.DictReader(lines)}
    for path in sorted((folder / "rover").glob("*.json")):
        problem = read_routing_file(path).problem
        runs = []
        for _ in range(3):
            began = time.process_time()
            found = ExactSolver(problem).solve()
            runs.append(time.process_time() - began)
            if not found.proven or found.value != best[f"rover/{path.name}"]:
                raise SystemExit(f"{path.name}: {found.value} is not the proven optimum")
        times.setdefault(int(path.name[5:7]), []).append(statistics.median(runs))
    lines_out = ["| sites | files | median CPU s | largest |", "|---|---|---|---|"]
    for sites, all_runs in sorted(times.items()):
        lines_out.append(
            f"| {sites} | {len(all_runs)} | {statistics.median(all_runs):.3f} | {max(all_runs):.3f} |"
        )
    return "\n".join(lines_out)


def _medians(rows: list[dict[str, Any]]) -> list[dict[str, Any]]:
    """Return one row a file: medians over seeds, proven when every seed was."""
    files: dict[str, list[dict[str, Any]]] = {}
    for row in rows:
        files.setdefault(row["file"], []).append(row)
    return [
        {
            **same[0],
            "gap": statistics.median(r["gap"] for r in same),
            "cpu_s": statistics.median(r["cpu_s"] for r in same),
            "proven": all(r["proven"] for r in same),
        }
        for same in files.values()
    ]


def replans(folder: Path) -> str:
    """Return the table of answers to a new start, time and energy from a table that is already there."""
    from planner.orienteering.exact import ExactSolver

    lines = [
        "| file | first answer, CPU s | 8 new starts, median CPU s | worst | all proven |",
        "|---|---|---|---|---|",
    ]
    for path in sorted((folder / "rover").glob("rover[1235]0?-s*.json")):
        problem = read_routing_file(path).problem
        solver = ExactSolver(problem)
        began = time.process_time()
        first = solver.solve()
        whole = time.process_time() - began
        cpu, proven = [], True
        for k in range(8):
            done = frozenset(first.route[: 1 + k % 3])
            at = problem.experiments[first.route[k % 3]].site
            branch = replace(
                problem,
                start_site=at,
                start_time=problem.time_budget * (2 + k) // 16,
                energy_used=(problem.energy_budget or 0) * (1 + k) // 16,
                done=done,
            )
            began = time.process_time()
            proven &= solver.solve(branch, time_limit_s=10.0).proven
            cpu.append(time.process_time() - began)
        lines.append(
            f"| {path.stem} | {whole:.3f} | {statistics.median(cpu):.3f} | {max(cpu):.3f} | "
            f"{'yes' if proven else 'no'} |"
        )
    return "\n".join(lines)


def plot(rows: list[dict[str, Any]], path: Path) -> None:
    """Draw the mean gap of each group at its largest limit of up to a second."""
    import matplotlib as mpl

    mpl.use("Agg")
    from matplotlib import pyplot as plt

    rows = [r for r in rows if r["limit_s"] <= 1]
    groups = sorted({family(r["file"]) for r in rows}, key=lambda k: (k[:5], len(k), k))
    fig, axes = plt.subplots(figsize=(9, 4.2), layout="constrained")
    for s, solver in enumerate(SOLVERS):
        for g, group in enumerate(groups):
            limit = max(r["limit_s"] for r in rows if family(r["file"]) == group)
            gaps = [
                r["gap"]
                for r in rows
                if family(r["file"]) == group and r["solver"] == solver and r["limit_s"] == limit
            ]
            if gaps:
                mean = statistics.mean(gaps)
                axes.bar(
                    g + 0.2 * (s - 1.5),
                    max(mean, 0.02),
                    0.19,
                    color=f"C{s}",
                    label=solver if g == 0 else None,
                )
                axes.annotate(
                    f"{mean:.1f}",
                    (g + 0.2 * (s - 1.5), max(mean, 0.02)),
                    ha="center",
                    va="bottom",
                    fontsize=7,
                )
    axes.set_yscale("log")
    axes.set_xticks(range(len(groups)), [g.replace(", ", "\n") for g in groups], fontsize=8)
    axes.set_ylabel("mean gap to the best known value, %")
    handles = [plt.Rectangle((0, 0), 1, 1, color=f"C{s}") for s in range(len(SOLVERS))]
    fig.legend(handles, list(SOLVERS), fontsize=8, ncols=4, loc="outside upper center")
    fig.savefig(path, dpi=130)


def figures(
    folders: tuple[str, ...] = ("rover", "optw", "oplib"),
    limits: tuple[float, ...] = (1.0,),
    seeds: tuple[int, ...] = (1,),
    every: bool = False,
    only: str = "",
    clock: str = "cpu",
    keep: bool = False,
    report: bool = False,
    out: Path = Path("docs"),
) -> Iterator[Figure]:
    """Yield the gaps of each solver to the best known values, and how many of its answers are proven."""
    if clock == "cpu":  # every limit that reads this clock, also that of PyVRP, which is imported later
        time.perf_counter = time.process_time
    if report:
        tables(_stored(), out)
        return
    with (FILES / "best_known.csv").open() as lines:
        best = {row["file"]: row for row in csv.DictReader(lines)}
    warm_up()
    for _, problem in _problems(best, ["optw"], "r101.txt")[:1]:
        for solver in SOLVERS.values():
            solver(problem, 0.2, 0)
    chosen = [
        (file, problem)
        for file, problem in _problems(best, folders, only)
        if every or Path(file).stem in SUBSET
    ]
    for limit in limits:
        rows = []
        for seed in seeds:
            for file, problem in chosen:
                rows += run_file(file, problem, best[file], limit, seed, keep)
        for name in SOLVERS:
            if not (mine := [r for r in rows if r["solver"] == name]):
                continue
            label = f"{name}, {limit:g} s, {len(mine)} answers"
            yield Figure(f"{label}: mean gap", statistics.mean(r["gap"] for r in mine), "%")
            yield Figure(f"{label}: within 1 %", 100 * statistics.mean(r["gap"] <= 1 for r in mine), "%")
            yield Figure(f"{label}: proven", 100 * statistics.mean(r["proven"] for r in mine), "%")


def tables(rows: list[dict[str, Any]], out: Path) -> None:
    """Print the tables of the stored rows, of proofs and of new starts, and draw the plot."""
    print(summary(rows), proofs(FILES), replans(FILES), sep="\n\n")
    (out / "img").mkdir(parents=True, exist_ok=True)
    plot(rows, out / "img" / "orienteering.png")


def _problems(
    best: dict[str, dict[str, str]], wanted: Sequence[str], only: str
) -> list[tuple[str, RoutingProblem]]:
    files = [f for f in best if f.split("/")[0] in wanted and only in f]
    return [(f, read_routing_file(FILES / f).problem) for f in files]


if __name__ == "__main__":
    command(figures, QUICK, BUDGET_S)
