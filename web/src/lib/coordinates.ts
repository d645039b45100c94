/** Coordinates as people read and type them: site metres, degrees, or the projection of the mission's place. */

import type { Place } from "../api/types";

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

/** The two numbers of a text `x, y`, `x y` or `x; y`, also with the minus of print; null when there are not just two. */
export function pointFrom(text: string): [number, number] | null {
  const parts = text.trim().replaceAll("−", "-").split(/\s*[,;]\s*|\s+/);
  const [x, y] = parts.map((part) => (part === "" ? Number.NaN : Number(part)));
  if (parts.length !== 2 || x === undefined || y === undefined) return null;
  return Number.isFinite(x) && Number.isFinite(y) ? [x, y] : null;
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
