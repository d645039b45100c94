/** What is measured between two points, in words. */

import type { Point } from "../map/geometry";
import { length, number } from "./format";

/** Distance on the level, rise, straight distance, angle and bearing; what is not known yet is left out. */
export function measureText(points: readonly Point[], up: readonly (number | null)[]): string {
  const [a, b] = points;
  if (a === undefined || b === undefined) return "";
  const [dx, dy] = [b[0] - a[0], b[1] - a[1]];
  const level = Math.hypot(dx, dy);
  const bearing = ((((Math.atan2(dx, dy) * 180) / Math.PI) % 360) + 360) % 360;
  const parts = [length(level)];
  const [from, to] = up;
  if (from !== null && to !== null && from !== undefined && to !== undefined) {
    const rise = to - from;
    parts.push(`${rise < 0 ? "down" : "up"} ${length(Math.abs(rise))}`);
    parts.push(`${length(Math.hypot(level, rise))} straight`);
    parts.push(`${number((Math.atan2(rise, level) * 180) / Math.PI, 1)}°`);
  }
  parts.push(`bearing ${number(bearing, 0)}°`);
  return parts.join(" · ");
}
