/** Rows pasted from a spreadsheet: comma, semicolon or tab separated, quoted where needed. */

import { words } from "./format";

interface Row {
  /** The line of the text that it begins on. */
  line: number;
  cells: string[];
}

export function parseRows(text: string): Row[] {
  const head = text.split("\n", 1)[0] ?? "";
  const separator = ["\t", ";", ","].find((mark) => head.includes(mark)) ?? ",";
  const rows: Row[] = [];
  let [line, begins] = [1, 1];
  let row: string[] = [];
  let cell = "";
  let quoted = false;
  for (let k = 0; k < text.length; k += 1) {
    const char = text[k];
    if (char === "\n") line += 1;
    if (quoted) {
      if (char === '"' && text[k + 1] === '"') {
        cell += '"';
        k += 1;
      } else if (char === '"') quoted = false;
      else cell += char;
    } else if (char === '"' && cell.trim() === "") {
      quoted = true;
      cell = "";
    } else if (char === separator) {
      row.push(cell.trim());
      cell = "";
    } else if (char === "\n") {
      row.push(cell.trim());
      rows.push({ line: begins, cells: row });
      begins = line;
      row = [];
      cell = "";
    } else if (char !== "\r") cell += char;
  }
  row.push(cell.trim());
  rows.push({ line: begins, cells: row });
  return rows.filter(({ cells }) => cells.some((value) => value !== ""));
}

/** A cell that cannot be used: where it is, what it says, and why not. */
export interface WrongCell {
  line: number;
  name: string;
  column: string;
  value: string;
  why: string;
}

export interface PastedTarget {
  line: number;
  name: string;
  east_m: number;
  north_m: number;
  instrument: string | null;
  value: number | null;
  /** What stands in its columns. */
  cells: Readonly<Record<string, string>>;
  wrong: WrongCell | null;
}

const ALIASES: Record<string, string> = {
  target: "name",
  id: "name",
  x: "east",
  e: "east",
  east_m: "east",
  y: "north",
  n: "north",
  north_m: "north",
  utility: "value",
};
const COLUMNS = ["name", "east", "north", "instrument", "value"];

/** The number in a cell; NaN where there is none. */
const numberIn = (cell: string): number => (cell === "" ? Number.NaN : Number(cell));

/**
 * Read targets: columns name, east, north and, where wanted, instrument and value; a heading is optional. An
 * instrument has to be one of `known`, a name none of `taken` and of no line before.
 */
export function parseTargets(text: string, known: readonly string[], taken: ReadonlySet<string> = new Set()): PastedTarget[] {
  const rows = parseRows(text);
  const first = (rows[0]?.cells ?? []).map((cell) => cell.toLowerCase());
  const headed = first.some((cell) => (ALIASES[cell] ?? cell) === "east");
  const columns = headed ? first.map((cell) => ALIASES[cell] ?? cell) : COLUMNS;
  const lines = new Map<string, number>();
  return rows.slice(headed ? 1 : 0).map(({ line, cells: found }) => {
    const cells: Record<string, string> = Object.fromEntries(columns.map((column, k) => [column, found[k] ?? ""]));
    const get = (column: string): string => cells[column] ?? "";
    const [name, east, north] = [get("name"), numberIn(get("east")), numberIn(get("north"))];
    const value = get("value") === "" ? null : Number(get("value"));
    const instrument = get("instrument").toLowerCase().replaceAll(" ", "_");
    const before = lines.get(name);
    lines.set(name, before ?? line);
    const checks: [string, boolean, () => string][] = [
      ["name", name === "", () => "no name"],
      ["name", taken.has(name), () => `there is a target “${name}” already`],
      ["name", before !== undefined, () => `line ${before} has the name already`],
      ["east", !Number.isFinite(east), () => `east is “${get("east")}”, not a number of metres`],
      ["north", !Number.isFinite(north), () => `north is “${get("north")}”, not a number of metres`],
      ["value", value !== null && !(value >= 0), () => `value is “${get("value")}”, not a number of at least 0`],
      ["instrument", instrument !== "" && !known.includes(instrument), () => `the rover has no “${get("instrument")}”; it has ${known.map(words).join(", ")}`],
    ];
    const [column, , why] = checks.find(([, bad]) => bad) ?? [];
    const wrong = column === undefined || why === undefined ? null : { line, name, column, value: get(column), why: why() };
    return { line, name, east_m: east, north_m: north, instrument: instrument === "" ? null : instrument, value, cells, wrong };
  });
}

const MEMBERS: Record<string, string> = { east_m: "east", north_m: "north" };

/** What the server refused of rows that were sent in their order, by its pointers: `/create/17/target/east_m`. */
export function wrongCells(rows: readonly PastedTarget[], errors: readonly { detail?: string; pointer?: string }[]): WrongCell[] {
  return errors.flatMap(({ detail, pointer }) => {
    const [, index, rest] = /^\/create\/(\d+)(?:\/(.*))?$/.exec(pointer ?? "") ?? [];
    const row = rows[Number(index)];
    if (row === undefined) return [];
    const member = rest?.split("/").at(-1) ?? "";
    const column = MEMBERS[member] ?? member;
    return [{ line: row.line, name: row.name, column, value: row.cells[column] ?? "", why: detail ?? "" }];
  });
}
