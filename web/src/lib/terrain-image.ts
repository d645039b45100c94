/** Pictures made from a grid of heights: slope shading and contour lines. Rows go from north to south. */

export interface Grid {
  rows: number;
  columns: number;
  /** Site metres: centres of the outermost posts. */
  west: number;
  south: number;
  east: number;
  north: number;
  heights: Float32Array;
}

export function spacing(grid: Grid): [number, number] {
  return [
    (grid.east - grid.west) / Math.max(1, grid.columns - 1),
    (grid.north - grid.south) / Math.max(1, grid.rows - 1),
  ];
}

/** Height by bilinear interpolation; null outside the grid or where nothing is known. */
export function heightAt(grid: Grid, east: number, north: number): number | null {
  const [dx, dy] = spacing(grid);
  const x = (east - grid.west) / dx;
  const y = (grid.north - north) / dy;
  if (x < 0 || y < 0 || x > grid.columns - 1 || y > grid.rows - 1) return null;
  const c = Math.min(grid.columns - 2, Math.floor(x));
  const r = Math.min(grid.rows - 2, Math.floor(y));
  const [u, v] = [x - c, y - r];
  // A post that does not count may well be unknown.
  const part = (row: number, column: number, weight: number): number =>
    weight === 0 ? 0 : weight * (grid.heights[row * grid.columns + column] ?? Number.NaN);
  const z =
    part(r, c, (1 - u) * (1 - v)) + part(r, c + 1, u * (1 - v)) + part(r + 1, c, (1 - u) * v) + part(r + 1, c + 1, u * v);
  return Number.isFinite(z) ? z : null;
}

/** Slope angle at every post, radians, by central differences over about `baseline` metres, at least two posts. */
export function slopes(grid: Grid, baseline = 0): Float32Array {
  const [dx, dy] = spacing(grid);
  const { rows, columns, heights } = grid;
  const result = new Float32Array(rows * columns);
  const reach = (step: number): number => Math.max(1, Math.round(baseline / 2 / Math.max(step, 1e-9)));
  const [across, along] = [reach(dx), reach(dy)];
  for (let r = 0; r < rows; r += 1) {
    const up = Math.max(0, r - along);
    const down = Math.min(rows - 1, r + along);
    for (let c = 0; c < columns; c += 1) {
      const left = Math.max(0, c - across);
      const right = Math.min(columns - 1, c + across);
      const gx =
        ((heights[r * columns + right] ?? 0) - (heights[r * columns + left] ?? 0)) / (dx * Math.max(1, right - left));
      const gy =
        ((heights[up * columns + c] ?? 0) - (heights[down * columns + c] ?? 0)) / (dy * Math.max(1, down - up));
      result[r * columns + c] = Math.atan(Math.hypot(gx, gy));
    }
  }
  return result;
}

/** Round step for contour lines that gives about `wanted` of them. */
export function contourStep(range: number, wanted = 14): number {
  const raw = range / wanted;
  const power = 10 ** Math.floor(Math.log10(Math.max(raw, 1e-6)));
  const factor = [1, 2, 2.5, 5, 10].find((f) => f * power >= raw) ?? 10;
  return factor * power;
}

/** Contour segments by marching squares: flat rows [east0, north0, east1, north1] for each level. */
export function contours(grid: Grid, step: number): Map<number, number[]> {
  const [dx, dy] = spacing(grid);
  const { rows, columns, heights } = grid;
  const lines = new Map<number, number[]>();
  for (let r = 0; r + 1 < rows; r += 1) {
    for (let c = 0; c + 1 < columns; c += 1) {
      const a = heights[r * columns + c] ?? Number.NaN;
      const b = heights[r * columns + c + 1] ?? Number.NaN;
      const d = heights[(r + 1) * columns + c] ?? Number.NaN;
      const e = heights[(r + 1) * columns + c + 1] ?? Number.NaN;
      const low = Math.min(a, b, d, e);
      const high = Math.max(a, b, d, e);
      if (!Number.isFinite(low) || !Number.isFinite(high)) continue;
      for (let k = Math.ceil(low / step); k * step < high; k += 1) {
        const level = k * step;
        const points: number[] = [];
        const cross = (h0: number, h1: number, x0: number, y0: number, x1: number, y1: number): void => {
          if (h0 <= level === h1 <= level) return;
          const part = (level - h0) / (h1 - h0);
          points.push(
            grid.west + (c + x0 + (x1 - x0) * part) * dx,
            grid.north - (r + y0 + (y1 - y0) * part) * dy,
          );
        };
        cross(a, b, 0, 0, 1, 0);
        cross(b, e, 1, 0, 1, 1);
        cross(d, e, 0, 1, 1, 1);
        cross(a, d, 0, 0, 0, 1);
        if (points.length < 4) continue;
        const all = lines.get(level) ?? [];
        all.push(...points.slice(0, 4));
        if (points.length === 8) all.push(...points.slice(4));
        lines.set(level, all);
      }
    }
  }
  return lines;
}
