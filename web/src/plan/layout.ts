/** Where the parts of a plan stand on the page: rows for lines, places along the row by time or by order. */

import { type Line, rowsOf, type Step } from "../lib/plan-tree";

export interface Bar {
  step: Step;
  row: number;
  /** Along the row: seconds when laid out by time, places when by order. */
  start: number;
  end: number;
}

export interface Fork {
  line: Line;
  fromRow: number;
  toRow: number;
  at: number;
  to: number;
}

export interface Layout {
  rows: Line[];
  bars: Bar[];
  forks: Fork[];
  extent: number;
}

const drawn = (step: Step): boolean => step.op !== "branch" && step.op !== "stop";

/** Whether the plan says when its steps begin. */
export function hasTimes(lines: readonly Line[]): boolean {
  return lines.some((line) => line.steps.some((step) => step.time !== null));
}

/** Lay out by median time; a step lasts until the next one begins, the last of a line `tail` seconds. */
export function byTime(lines: readonly Line[], tail: (step: Step) => number): Layout {
  const byId = new Map(lines.map((line) => [line.id, line]));
  const rows = rowsOf([...lines]).flatMap((id) => byId.get(id) ?? []);
  const rowOf = new Map(rows.map((line, k) => [line.id, k]));
  const bars: Bar[] = [];
  const forks: Fork[] = [];
  const begins = new Map<string, number>();
  let extent = 0;
  // Lines come in pre-order, so the branch step of a line is known before the line.
  for (const line of lines) {
    const row = rowOf.get(line.id) ?? 0;
    let last = line.from === null ? 0 : (begins.get(line.from) ?? 0);
    const shown = (step: Step): boolean => drawn(step) && !step.idle;
    line.steps.forEach((step, k) => {
      const start = Math.max(last, step.time?.mid ?? last);
      const next = line.steps.slice(k + 1).find((later) => later.time !== null);
      const end = Math.max(start, next?.time?.mid ?? start + (drawn(step) ? tail(step) : 0));
      begins.set(step.key, start);
      if (shown(step)) {
        bars.push({ step, row, start, end });
        extent = Math.max(extent, end, step.time?.high ?? 0);
        last = step.time === null ? end : start;
      }
    });
    if (line.from !== null) {
      const first = line.steps.find(shown);
      const at = begins.get(line.from) ?? 0;
      forks.push({
        line,
        fromRow: rowOf.get(line.parent ?? "") ?? 0,
        toRow: row,
        at,
        to: first === undefined ? at : (begins.get(first.key) ?? at),
      });
    }
  }
  return { rows, bars, forks, extent };
}

/** Lay out by order: one place a step, an option begins one place behind its branch. */
export function byOrder(lines: readonly Line[]): Layout {
  const byId = new Map(lines.map((line) => [line.id, line]));
  const rows = rowsOf([...lines]).flatMap((id) => byId.get(id) ?? []);
  const rowOf = new Map(rows.map((line, k) => [line.id, k]));
  const bars: Bar[] = [];
  const forks: Fork[] = [];
  const placeOf = new Map<string, number>();
  let extent = 0;
  for (const line of lines) {
    const row = rowOf.get(line.id) ?? 0;
    const from = line.from === null ? 0 : (placeOf.get(line.from) ?? 0);
    let place = line.from === null ? 0 : from + 0.55;
    for (const step of line.steps) {
      placeOf.set(step.key, place);
      if (!drawn(step)) continue;
      bars.push({ step, row, start: place, end: place + 1 });
      place += 1;
      extent = Math.max(extent, place);
    }
    if (line.from !== null) {
      forks.push({ line, fromRow: rowOf.get(line.parent ?? "") ?? 0, toRow: row, at: from, to: from + 0.55 });
    }
  }
  return { rows, bars, forks, extent };
}

/** Range of the bars that can be seen, so that drawing costs what is shown and not what there is. */
export function visible<T extends { start: number; end: number; row: number }>(
  bars: readonly T[],
  from: number,
  to: number,
  firstRow: number,
  lastRow: number,
): T[] {
  return bars.filter((bar) => bar.row >= firstRow && bar.row <= lastRow && bar.end >= from && bar.start <= to);
}
