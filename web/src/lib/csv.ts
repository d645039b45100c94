/** Rows pasted from a spreadsheet: comma, semicolon or tab separated, quoted where needed. */

import { words } from "./format";

export function parseRows(text: string): string[][] {
  const head = text.split("\n", 1)[0] ?? "";
  const separator = ["\t", ";", ","].find((mark) => head.includes(mark)) ?? ",";
  const rows: string[][] = [];
  let row: string[] = [];
  let cell = "";
  let quoted = false;
  for (let k = 0; k < text.length; k += 1) {
    const char = text[k];
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
      rows.push(row);
      row = [];
      cell = "";
    } else if (char !== "\r") cell += char;
  }
  row.push(cell.trim());
  rows.push(row);
  return rows.filter((cells) => cells.some((value) => value !== ""));
}

export interface PastedTarget {
  line: number;
  name: string;
  east_m: number;
  north_m: number;
  instrument: string | null;
  value: number | null;
  problem: string | null;
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

/**
 * Read targets: columns name, east, north and, where wanted, instrument and value; a heading is optional. An
 * instrument has to be one of `known`.
 */
export function parseTargets(text: string, known: readonly string[]): PastedTarget[] {
  const rows = parseRows(text);
  const first = (rows[0] ?? []).map((cell) => cell.toLowerCase());
  const headed = first.some((cell) => (ALIASES[cell] ?? cell) === "east");
  const columns = headed
    ? first.map((cell) => ALIASES[cell] ?? cell)
    : ["name", "east", "north", "instrument", "value"];
  return rows.slice(headed ? 1 : 0).map((cells, index) => {
    const get = (column: string): string => cells[columns.indexOf(column)] ?? "";
    const east = Number.parseFloat(get("east"));
    const north = Number.parseFloat(get("north"));
    const value = get("value") === "" ? null : Number(get("value"));
    const instrument = get("instrument").toLowerCase().replaceAll(" ", "_");
    let problem: string | null = null;
    if (get("name") === "") problem = "no name";
    else if (!Number.isFinite(east)) problem = `east is “${get("east")}”, not a number of metres`;
    else if (!Number.isFinite(north)) problem = `north is “${get("north")}”, not a number of metres`;
    else if (value !== null && !(value >= 0)) problem = `value is “${get("value")}”, not a number of at least 0`;
    else if (instrument !== "" && !known.includes(instrument)) problem = `the rover has no “${get("instrument")}”; it has ${known.map(words).join(", ")}`;
    return {
      line: index + (headed ? 2 : 1),
      name: get("name"),
      east_m: east,
      north_m: north,
      instrument: instrument === "" ? null : instrument,
      value,
      problem,
    };
  });
}
