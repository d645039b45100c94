/** Triangles of the ground from grids of heights, and what is draped over them. Scene axes: x east, y up, z south. */

import { BufferAttribute, BufferGeometry, Float32BufferAttribute, Vector3 } from "three";
import { type Grid, heightAt, spacing } from "../lib/terrain-image";
import type { Point } from "../map/geometry";

export interface Extent {
  west: number;
  south: number;
  east: number;
  north: number;
}

/** Make the surface of a grid; cells without a height and cells wholly inside `hole` are left out. */
export function groundGeometry(grid: Grid, extent: Extent, hole: Extent | null): BufferGeometry {
  const { rows, columns, heights } = grid;
  const [dx, dy] = spacing(grid);
  const count = rows * columns;
  const position = new Float32Array(count * 3);
  const uv = new Float32Array(count * 2);
  for (let r = 0; r < rows; r += 1) {
    for (let c = 0; c < columns; c += 1) {
      const k = r * columns + c;
      const east = grid.west + c * dx;
      const north = grid.north - r * dy;
      const up = heights[k] ?? Number.NaN;
      position[3 * k] = east;
      position[3 * k + 1] = Number.isFinite(up) ? up : 0;
      position[3 * k + 2] = -north;
      uv[2 * k] = (east - extent.west) / (extent.east - extent.west);
      uv[2 * k + 1] = (north - extent.south) / (extent.north - extent.south);
    }
  }
  const index = new Uint32Array((rows - 1) * (columns - 1) * 6);
  let used = 0;
  for (let r = 0; r + 1 < rows; r += 1) {
    for (let c = 0; c + 1 < columns; c += 1) {
      const a = r * columns + c;
      const [b, d, e] = [a + 1, a + columns, a + columns + 1];
      if (hole !== null) {
        const west = grid.west + c * dx;
        const north = grid.north - r * dy;
        if (west > hole.west && west + dx < hole.east && north < hole.north && north - dy > hole.south) continue;
      }
      const sum = (heights[a] ?? Number.NaN) + (heights[b] ?? Number.NaN) + (heights[d] ?? Number.NaN) + (heights[e] ?? Number.NaN);
      if (!Number.isFinite(sum)) continue;
      index[used] = a;
      index[used + 1] = index[used + 4] = d;
      index[used + 2] = index[used + 3] = b;
      index[used + 5] = e;
      used += 6;
    }
  }
  const geometry = new BufferGeometry();
  geometry.setAttribute("position", new BufferAttribute(position, 3));
  geometry.setAttribute("uv", new BufferAttribute(uv, 2));
  geometry.setIndex(new BufferAttribute(index.subarray(0, used), 1));
  geometry.computeVertexNormals();
  return geometry;
}

/** Height of the ground from the finest grid that knows it; 0 where none does. */
export function surface(grids: readonly Grid[]): (east: number, north: number) => number {
  return (east, north) => {
    for (const grid of grids) {
      const up = heightAt(grid, east, north);
      if (up !== null) return up;
    }
    return 0;
  };
}

/** Cut a polyline into pieces of at most `step` metres. */
export function densify(path: readonly Point[], step: number): Point[] {
  const dense: Point[] = [];
  for (let k = 0; k + 1 < path.length; k += 1) {
    const [a, b] = [path[k] as Point, path[k + 1] as Point];
    const parts = Math.max(1, Math.ceil(Math.hypot(b[0] - a[0], b[1] - a[1]) / step));
    for (let i = 0; i < parts; i += 1) dense.push([a[0] + ((b[0] - a[0]) * i) / parts, a[1] + ((b[1] - a[1]) * i) / parts]);
  }
  const last = path[path.length - 1];
  if (last !== undefined) dense.push(last);
  return dense;
}

/** A strip of `width` metres over the ground along a path. */
export function stripGeometry(
  path: readonly Point[],
  width: number,
  lift: number,
  up: (east: number, north: number) => number,
): BufferGeometry {
  const dense = densify(path, 0.2);
  const position: number[] = [];
  const index: number[] = [];
  dense.forEach((point, k) => {
    const before = dense[Math.max(0, k - 1)] as Point;
    const after = dense[Math.min(dense.length - 1, k + 1)] as Point;
    const size = Math.hypot(after[0] - before[0], after[1] - before[1]) || 1;
    const [nx, ny] = [-(after[1] - before[1]) / size, (after[0] - before[0]) / size];
    for (const side of [0.5, -0.5]) {
      const east = point[0] + nx * width * side;
      const north = point[1] + ny * width * side;
      position.push(east, up(east, north) + lift, -north);
    }
    if (k > 0) index.push(2 * k - 2, 2 * k - 1, 2 * k, 2 * k, 2 * k - 1, 2 * k + 1);
  });
  const geometry = new BufferGeometry();
  geometry.setAttribute("position", new Float32BufferAttribute(position, 3));
  geometry.setIndex(index);
  return geometry;
}

/** A low wall round a polygon. */
export function wallGeometry(
  ring: readonly Point[],
  height: number,
  up: (east: number, north: number) => number,
): BufferGeometry {
  const first = ring[0];
  const dense = densify(first === undefined ? [] : [...ring, first], 0.25);
  const position: number[] = [];
  const index: number[] = [];
  dense.forEach(([east, north], k) => {
    const ground = up(east, north);
    position.push(east, ground - 0.1, -north, east, ground + height, -north);
    if (k > 0) index.push(2 * k - 2, 2 * k, 2 * k - 1, 2 * k, 2 * k + 1, 2 * k - 1);
  });
  const geometry = new BufferGeometry();
  geometry.setAttribute("position", new Float32BufferAttribute(position, 3));
  geometry.setIndex(index);
  return geometry;
}

export function toScene(east: number, north: number, up: number): Vector3 {
  return new Vector3(east, up, -north);
}

/** Direction to the sun (east, north, up) at a local mean solar time, between the places the server has told. */
export function sunDirection(places: readonly { lmst_h: number; direction: readonly number[] }[], lmst: number): [number, number, number] {
  const hour = ((lmst % 24) + 24) % 24;
  const k = places.findIndex((place) => place.lmst_h > hour);
  const [a, b] = [places[Math.max(0, k - 1)], places[k < 0 ? places.length - 1 : k]];
  if (a === undefined || b === undefined) return [0, 0, 1];
  const part = b.lmst_h === a.lmst_h ? 0 : (hour - a.lmst_h) / (b.lmst_h - a.lmst_h);
  const [x, y, z] = [0, 1, 2].map((axis) => (a.direction[axis] ?? 0) * (1 - part) + (b.direction[axis] ?? 0) * part) as [number, number, number];
  const size = Math.hypot(x, y, z) || 1;
  return [x / size, y / size, z / size];
}
