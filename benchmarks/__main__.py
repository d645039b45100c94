"""Run benchmarks one after the other, and write what they found into `docs/results/benchmarks.md`.

    scripts/bench [NAME ...] [--quick]

Each runs in a process of its own, within its budget. What fails or takes too long is told and the next one
begins; what was measured before stays, also after Ctrl-C. A benchmark's section of the page is written when
it ends. Exit status 1 if a limit is exceeded or a benchmark fails, 2 for a name that does not exist, 130
after Ctrl-C.
"""

from __future__ import annotations

import argparse
import contextlib
import datetime
import json
import os
import pkgutil
import platform
import re
import shlex
import signal
import subprocess
import sys
import tempfile
import time
from collections.abc import Iterator, Mapping, Sequence
from dataclasses import dataclass
from pathlib import Path

from benchmarks.common.clock import yardstick
from benchmarks.common.figure import HEAD, Figure
from studies.common.pages import table

ROOT = Path(__file__).resolve().parents[1]
PAGE = ROOT / "docs" / "results" / "benchmarks.md"
SECTION = re.compile(r"<!-- begin:([\w-]+) -->\n(.*?)\n<!-- end:\1 -->\n*", re.DOTALL)
LOOK_S, START_S, END_S = 0.5, 120.0, 40.0
"""Between two looks at a benchmark; for its imports; and for it to take down what it has started."""
LAST_LINES = 12
"""Of what a benchmark printed, shown when it fails."""
FAILED, UNKNOWN, STOPPED = 1, 2, 130


@dataclass(frozen=True, slots=True)
class Found:
    """What came of a benchmark: its figures, what went wrong if something did, and whether it was stopped."""

    figures: tuple[Figure, ...] = ()
    fault: str = ""
    stopped: bool = False

    @property
    def good(self) -> bool:
        """Whether it ended by itself and no limit is exceeded."""
        return not (self.fault or self.stopped or any(figure.exceeded for figure in self.figures))


def names_in(package: Sequence[str]) -> list[str]:
    """Return the names of the benchmarks in the folders of a package."""
    return [m.name for m in pkgutil.iter_modules(package) if not m.ispkg and not m.name.startswith("_")]


def run(package: str, name: str, place: str, quick: bool, folder: Path) -> Found:
    """Run one benchmark and show its figures as they come; `place` is its own among those to be run.

    It is interrupted when its budget is used up, or when this process is; both leave what was measured.
    """
    into, log = folder / f"{name}.jsonl", folder / f"{name}.log"
    into.touch()
    order = [sys.executable, "-m", f"{package}.{name}", "--into", str(into), *(["--quick"] if quick else [])]
    budget_s, began, told = START_S, time.monotonic(), False
    shown, line = 0, Line()
    with log.open("wb") as output:
        child = subprocess.Popen(order, stdout=output, stderr=output, start_new_session=True)
        stopped = late = False
        try:
            while child.poll() is None and not late:
                time.sleep(LOOK_S)
                told_s, figures = read(into)
                if told_s is not None and not told:
                    budget_s, began, told = told_s, time.monotonic(), True
                shown = line.news(name, figures, shown)
                left_s = budget_s - (time.monotonic() - began)
                line.show(f"{place} {name}: {len(figures)} figures, {left_s:.0f} of {budget_s:.0f} s left")
                late = left_s < 0
        except KeyboardInterrupt:
            stopped = True
        end(child)
    line.show("")
    _, figures = read(into)
    line.news(name, figures, shown)
    if stopped:
        return Found(figures, stopped=True)
    if late:
        return Found(figures, f"not done within {budget_s:g} s")
    if child.returncode not in (0, 1) or (child.returncode and not any(f.exceeded for f in figures)):
        said = log.read_text(errors="replace").splitlines()[-LAST_LINES:]
        print(f"{name} failed:", *said, sep="\n  ", flush=True)
        return Found(figures, said[-1] if said else f"exit status {child.returncode}")
    return Found(figures)


def read(into: Path) -> tuple[float | None, tuple[Figure, ...]]:
    """Return the budget that a benchmark tells when it begins to measure, and its figures so far."""
    budget_s, figures = None, []
    for text in into.read_text(encoding="utf-8").splitlines(keepends=True):
        if not text.endswith("\n"):
            break  # it is being written
        told = json.loads(text)
        if "budget_s" in told:
            budget_s = told["budget_s"]
        else:
            figures.append(Figure(**told))
    return budget_s, tuple(figures)


def end(child: subprocess.Popen[bytes]) -> None:
    """Interrupt a benchmark with all that it has started; what does not end is killed."""
    for sent in (signal.SIGINT, signal.SIGKILL):
        if child.poll() is not None:
            break
        with contextlib.suppress(ProcessLookupError):
            os.killpg(child.pid, sent)
        with contextlib.suppress(subprocess.TimeoutExpired, KeyboardInterrupt):
            child.wait(END_S)


class Line:
    """The last line of a terminal, written over; nothing where there is no terminal."""

    def show(self, text: str) -> None:
        """Put a text in place of the last one."""
        if sys.stdout.isatty():
            print(f"\r\x1b[K{text}", end="", flush=True)

    def news(self, name: str, figures: Sequence[Figure], shown: int) -> int:
        """Print figures from number `shown` on; return how many have been printed."""
        for figure in figures[shown:]:
            self.show("")
            print(f"{name}: {'  '.join(cell for cell in figure.cells() if cell)}", flush=True)
        return len(figures)


def machine() -> str:
    """Return processor, number of cores and memory."""
    told = re.search(r"model name\s*: (.*)", Path("/proc/cpuinfo").read_text(encoding="utf-8"))
    memory = os.sysconf("SC_PAGE_SIZE") * os.sysconf("SC_PHYS_PAGES") / 1024**3
    model = told.group(1) if told else platform.machine()
    return f"{model}, {os.cpu_count()} cores, {memory:.0f} GiB of memory"


def commit() -> str:
    """Return the commit, and whether other files than those that benchmarks write have changed since."""
    written = [":!docs/results", ":!docs/img"]
    orders = (["rev-parse", "--short", "HEAD"], ["status", "--porcelain", "--", ".", *written])
    head, changed = (
        subprocess.run(["git", *order], cwd=ROOT, capture_output=True, text=True, check=False).stdout.strip()
        for order in orders
    )
    return f"{head or 'unknown'}{' with changes' if changed else ''}"


def section(found: Found, made: str) -> str:
    """Return the section of a benchmark: how it was made, its table, and what went wrong."""
    parts = [made]
    if found.figures:
        parts.append(table(HEAD, [figure.cells() for figure in found.figures]).strip())
    if found.fault:
        parts.append(f"It failed: `{found.fault.replace('`', '')}`")
    if found.stopped:
        parts.append("It was stopped before its end.")
    return "\n\n".join(parts)


def write(page: Path, sections: Mapping[str, str]) -> None:
    """Put sections into a page in place of those of the same name; others and the head stay as they are."""
    text = page.read_text(encoding="utf-8")
    head = text[: text.index("<!-- begin:")] if "<!-- begin:" in text else text
    merged = dict(SECTION.findall(text)) | {name: f"## {name}\n\n{body}" for name, body in sections.items()}
    parts = [f"<!-- begin:{name} -->\n{merged[name]}\n<!-- end:{name} -->\n" for name in sorted(merged)]
    page.write_text("\n".join([head.rstrip() + "\n", *parts]), encoding="utf-8")


def overview(results: Mapping[str, Found]) -> str:
    """Return one table of all figures, in columns of text, and a line for each fault."""
    rows = [[name, *figure.cells()] for name, found in results.items() for figure in found.figures]
    rows = [["benchmark", *HEAD], *rows]
    widths = [max(len(row[k]) for row in rows) for k in range(len(rows[0]))]
    lines = ["  ".join(c.ljust(w) for c, w in zip(row, widths, strict=True)).rstrip() for row in rows]
    lines += [f"{name} failed: {found.fault}" for name, found in results.items() if found.fault]
    exceeded = sum(figure.exceeded for found in results.values() for figure in found.figures)
    held = sum(figure.verdict == "ok" for found in results.values() for figure in found.figures)
    return "\n".join([*lines, f"{held} limits held, {exceeded} exceeded"])


def all_of(chosen: Sequence[str], package: str, quick: bool) -> Iterator[tuple[str, Found]]:
    """Run benchmarks one after the other, until one is stopped."""
    with tempfile.TemporaryDirectory(prefix="outcrop-bench-") as folder:
        for number, name in enumerate(chosen, start=1):
            print(f"[{number}/{len(chosen)}] {name}", flush=True)
            found = run(package, name, f"[{number}/{len(chosen)}]", quick, Path(folder))
            yield name, found
            if found.stopped:
                return


def main(arguments: Sequence[str], package: str = "benchmarks", page: Path = PAGE) -> int:
    """Run the benchmarks named, or all; return the exit status."""
    parser = argparse.ArgumentParser(
        prog="scripts/bench", description=__doc__, formatter_class=argparse.RawDescriptionHelpFormatter
    )
    parser.add_argument("names", nargs="*", metavar="NAME")
    parser.add_argument("--quick", action="store_true", help="small sizes: only to see that all works")
    given = parser.parse_args(arguments)
    there = names_in(__import__(package).__path__)
    if unknown := [name for name in given.names if name not in there]:
        print(f"no benchmark {', '.join(unknown)}; there are: {', '.join(there)}", file=sys.stderr)
        return UNKNOWN
    where, at = machine(), commit()
    results: dict[str, Found] = {}
    for name, found in all_of(given.names or there, package, given.quick):
        results[name] = found
        if not (found.figures or found.fault):
            continue
        today = datetime.datetime.now(datetime.UTC).date()
        made = (
            f"`{shlex.join(['scripts/bench', *arguments])}`, {today}, commit {at}; {where}; load "
            f"{os.getloadavg()[0]:.1f}, yardstick {yardstick():.3f} s of processor time."
        )
        write(page, {name: section(found, made)})
    print(overview(results))
    if any(found.stopped for found in results.values()):
        return STOPPED
    return 0 if all(found.good for found in results.values()) else FAILED


if __name__ == "__main__":
    for ending in (signal.SIGINT, signal.SIGTERM):  # a shell's background job ignores the former
        signal.signal(ending, signal.default_int_handler)
    try:
        status = main(sys.argv[1:])
    except KeyboardInterrupt:
        status = STOPPED
    raise SystemExit(status)
