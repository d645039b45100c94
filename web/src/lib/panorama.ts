/** The panorama as one strip: tiles side by side, columns are azimuths (clockwise from north), rows elevations. */

export interface Tile {
  index: number;
  left_azimuth_rad: number;
  eye_m: readonly number[];
  url: string;
}

export interface Strip {
  tile_width: number;
  tile_height: number;
  top_elevation_rad: number;
  rad_per_px: number;
  tiles: readonly Tile[];
}

const TURN = 2 * Math.PI;
const wrapped = (angle: number): number => ((angle % TURN) + TURN) % TURN;

/** Azimuth and elevation of a place of the strip, pixels from its upper left corner. */
export function directionAt(strip: Strip, x: number, y: number): { azimuth: number; elevation: number } {
  const left = strip.tiles[0]?.left_azimuth_rad ?? 0;
  return {
    azimuth: wrapped(left + x * strip.rad_per_px),
    elevation: strip.top_elevation_rad - y * strip.rad_per_px,
  };
}

/** Where a point of the site stands in the strip; null outside it. Each tile was taken from its own place. */
export function placeOf(strip: Strip, east: number, north: number, up: number): [number, number] | null {
  const width = strip.tile_width * strip.rad_per_px;
  const left = strip.tiles[0]?.left_azimuth_rad ?? 0;
  for (const [k, tile] of strip.tiles.entries()) {
    const [x, y, z] = [east - (tile.eye_m[0] ?? 0), north - (tile.eye_m[1] ?? 0), up - (tile.eye_m[2] ?? 0)];
    const inside = wrapped(Math.atan2(x, y) - left - k * width + width / 2) - width / 2;
    // A point on a seam may be missed by both tiles for the parallax between them: a little outside counts.
    if (inside < -0.002 || inside > width + 0.002) continue;
    const row = (strip.top_elevation_rad - Math.atan2(z, Math.hypot(x, y))) / strip.rad_per_px;
    if (row < 0 || row > strip.tile_height) return null;
    return [k * strip.tile_width + inside / strip.rad_per_px, row];
  }
  return null;
}

/** The tiles nearest to where one looks come first; rendering takes time. */
export function loadingOrder(strip: Strip, azimuth: number): number[] {
  const width = strip.tile_width * strip.rad_per_px;
  const off = (tile: Tile): number => {
    const away = wrapped(tile.left_azimuth_rad + width / 2 - azimuth);
    return Math.min(away, TURN - away);
  };
  return [...strip.tiles].sort((a, b) => off(a) - off(b)).map((tile) => tile.index);
}

export const azimuthOf = (heading: number): number => wrapped(Math.PI / 2 - heading);

export interface Mark {
  name: string;
  at: readonly [number, number];
  selected: boolean;
}

const LETTER_PX = 6.4;
const LABEL_PX = { left: 10, most: 150, height: 15 };

/** Which marks have room for their names at a scale, so that none lies over another; the selected one always has. */
export function named(marks: readonly Mark[], scale: number): boolean[] {
  const taken: { x0: number; x1: number; y: number }[] = [];
  const shown = marks.map(() => false);
  const order = marks.map((_, k) => k).sort((a, b) => Number(marks[b]?.selected) - Number(marks[a]?.selected));
  for (const k of order) {
    const mark = marks[k] as Mark;
    const x0 = mark.at[0] * scale + LABEL_PX.left;
    const y = mark.at[1] * scale;
    const x1 = x0 + Math.min(LABEL_PX.most, LETTER_PX * mark.name.length);
    if (taken.some((other) => x0 < other.x1 && x1 > other.x0 && Math.abs(y - other.y) < LABEL_PX.height)) continue;
    taken.push({ x0, x1, y });
    shown[k] = true;
  }
  return shown;
}
