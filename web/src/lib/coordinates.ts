/** Coordinates as people read and type them: site metres, degrees, or the projection of the mission's place. */

import type { Place } from "../api/types";
import { number } from "./format";

export type Coordinates = "site" | "lonlat" | "projected";

/** Whether a place counts in degrees. WKT says so; a name does not, and no projection has its site so near its zero. */
export function inDegrees(place: Place): boolean {
  if (/^\s*PROJ/i.test(place.crs)) return false;
  return /^\s*GEO/i.test(place.crs) || (Math.abs(place.x) <= 360 && Math.abs(place.y) <= 90);
}

/** What a mission's coordinates can be shown in; nothing to choose without a place. */
export function choices(place: Place | null): Coordinates[] {
  if (place === null) return [];
  return inDegrees(place) ? ["site", "lonlat"] : ["site", "lonlat", "projected"];
}

/** The name the server knows the reference by; null for site metres, and where the choice does not fit the mission. */
export function crsOf(chosen: Coordinates, place: Place | null): string | null {
  if (place === null || chosen === "site" || !choices(place).includes(chosen)) return null;
  return chosen === "lonlat" ? "lonlat" : place.crs;
}

/** `x, y`: longitude before latitude to a millimetre or so, metres to a millimetre; it is read back by `pointFrom`. */
export function pointText(point: readonly number[], crs: string | null): string {
  return point.map((value) => value.toFixed(crs === "lonlat" ? 8 : 3)).join(", ");
}

/** So many numbers of a text `x, y`, `x y` or `x; y`, also with the minus of print; null when there are not just as many. */
export function numbersFrom(text: string, count: number): number[] | null {
  const parts = text.trim().replaceAll("−", "-").split(/\s*[,;]\s*|\s+/);
  const found = parts.map((part) => (part === "" ? Number.NaN : Number(part)));
  return found.length === count && found.every(Number.isFinite) ? found : null;
}

/** The two numbers of a text. */
export function pointFrom(text: string): [number, number] | null {
  const [x, y] = numbersFrom(text, 2) ?? [];
  return x === undefined || y === undefined ? null : [x, y];
}

/** Corners, one a line; the error names the first line that is none. */
export function cornersFrom(text: string): [number, number][] | string {
  const lines = text.split("\n").filter((line) => line.trim() !== "");
  const corners = lines.map(pointFrom);
  const wrong = corners.indexOf(null);
  if (wrong >= 0) return `Line ${wrong + 1} is not a pair of numbers: ${lines[wrong]?.trim() ?? ""}`;
  if (corners.length < 3) return `An outline has at least 3 corners; these are ${corners.length}`;
  return corners.filter((corner) => corner !== null);
}

/** Coordinates under the pointer, to a centimetre: in site metres, or in the reference that is chosen. */
export function readOut(point: readonly number[], crs: string | null): string {
  const [x = 0, y = 0] = point;
  if (crs === null) return `E ${number(x, 2)}\u2002N ${number(y, 2)} m`;
  return crs === "lonlat" ? `lon ${number(x, 7)}\u2002lat ${number(y, 7)}` : `x ${number(x, 2)}\u2002y ${number(y, 2)} m`;
}

const CELL_M = 100;
const STEP_M = 50;

/**
 * Site metres in another reference without asking for each point. In cells of 100 m the server tells the middle and two
 * points beside it, between them it goes straight: that is off by less than a millimetre at a latitude of 45°, and by
 * 5 mm at 80°, since the longitude of a metre changes by tan(latitude)/radius a metre.
 */
export class Locator {
  private readonly cells = new Map<string, readonly [number, number][] | null>();

  constructor(
    private readonly ask: (east: number, north: number) => Promise<{ x: number; y: number }>,
    /** Told when a cell is there that was asked for. */
    private readonly told: () => void,
  ) {}

  /** The point in the reference; null while the server is asked, and where it has no answer. */
  at(east: number, north: number): [number, number] | null {
    const middle = [CELL_M * Math.round(east / CELL_M), CELL_M * Math.round(north / CELL_M)] as const;
    const key = middle.join();
    const cell = this.cells.get(key);
    if (cell === undefined) {
      this.cells.set(key, null);
      void this.read(key, ...middle);
      return null;
    }
    const [at, right, up] = cell ?? [];
    if (at === undefined || right === undefined || up === undefined) return null;
    const [u, v] = [(east - middle[0]) / STEP_M, (north - middle[1]) / STEP_M];
    return [at[0] + u * (right[0] - at[0]) + v * (up[0] - at[0]), at[1] + u * (right[1] - at[1]) + v * (up[1] - at[1])];
  }

  private async read(key: string, east: number, north: number): Promise<void> {
    try {
      const found = await Promise.all([this.ask(east, north), this.ask(east + STEP_M, north), this.ask(east, north + STEP_M)]);
      this.cells.set(key, found.map(({ x, y }): [number, number] => [x, y]));
    } catch {
      // A place without an answer shows no coordinates; the pointer asks once for each cell.
    }
    this.told();
  }
}
