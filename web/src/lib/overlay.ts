/** Colours laid over the ground: slope against what the rover stands on, and what its mast has seen. */

import { type Grid, slopes } from "./terrain-image";

export type Colour = readonly [number, number, number, number];

export interface Raster {
  rows: number;
  columns: number;
  /** Site metres: centres of the outermost posts. */
  west: number;
  south: number;
  east: number;
  north: number;
  /** RGBA, row by row from the north. */
  pixels: Uint8ClampedArray<ArrayBuffer>;
}

export interface CoverageGrid extends Omit<Grid, "heights"> {
  /** 0 unknown, 1 hidden from the start, else 2 + standard deviation in centimetres. */
  codes: Uint8Array;
}

/** Slope is taken over about a rover's length, as the terrain's own figure is. */
export const SLOPE_BASELINE_M = 1;

/** Shares of the steepest slope the rover stands on, and their colours. */
export const SLOPE_STEPS: readonly { share: number; colour: Colour }[] = [
  { share: 0.4, colour: [60, 170, 110, 90] },
  { share: 0.7, colour: [235, 200, 70, 150] },
  { share: 1, colour: [245, 130, 50, 190] },
  { share: Number.POSITIVE_INFINITY, colour: [220, 40, 50, 220] },
];

export const COVERAGE_STEPS: readonly { sigma_cm: number; colour: Colour }[] = [
  { sigma_cm: 2, colour: [60, 190, 225, 95] },
  { sigma_cm: 8, colour: [80, 140, 235, 100] },
  { sigma_cm: 25, colour: [205, 175, 80, 100] },
  { sigma_cm: Number.POSITIVE_INFINITY, colour: [215, 120, 60, 110] },
];
export const HIDDEN: Colour = [12, 14, 18, 150];
export const UNKNOWN: Colour = [255, 60, 60, 120];

export const css = ([r, g, b]: Colour): string => `rgb(${r} ${g} ${b})`;

export function slopeColour(slope: number, limit: number): Colour {
  return (SLOPE_STEPS.find((step) => slope <= step.share * limit) ?? SLOPE_STEPS[3])?.colour ?? [0, 0, 0, 0];
}

export function coverageColour(code: number): Colour {
  if (code === 0) return UNKNOWN;
  if (code === 1) return HIDDEN;
  return (COVERAGE_STEPS.find((step) => code - 2 <= step.sigma_cm) ?? COVERAGE_STEPS[3])?.colour ?? [0, 0, 0, 0];
}

function painted(grid: Omit<Grid, "heights">, colour: (post: number) => Colour): Raster {
  const pixels = new Uint8ClampedArray(4 * grid.rows * grid.columns);
  for (let k = 0; k < grid.rows * grid.columns; k += 1) pixels.set(colour(k), 4 * k);
  const { rows, columns, west, south, east, north } = grid;
  return { rows, columns, west, south, east, north, pixels };
}

export function slopeRaster(grid: Grid, limit: number): Raster {
  const slope = slopes(grid, SLOPE_BASELINE_M);
  return painted(grid, (k) => {
    const value = slope[k] ?? Number.NaN;
    return Number.isFinite(value) ? slopeColour(value, limit) : [0, 0, 0, 0];
  });
}

export const coverageRaster = (grid: CoverageGrid): Raster => painted(grid, (k) => coverageColour(grid.codes[k] ?? 0));

/** Extent of a raster with the half posts at its rim. */
export function edges(raster: Raster): { west: number; south: number; east: number; north: number } {
  const dx = (raster.east - raster.west) / Math.max(1, raster.columns - 1) / 2;
  const dy = (raster.north - raster.south) / Math.max(1, raster.rows - 1) / 2;
  return { west: raster.west - dx, south: raster.south - dy, east: raster.east + dx, north: raster.north + dy };
}

/** A raster as a canvas, for OpenLayers and for textures. */
export function canvasOf(raster: Raster): HTMLCanvasElement {
  const canvas = document.createElement("canvas");
  canvas.width = raster.columns;
  canvas.height = raster.rows;
  canvas.getContext("2d")?.putImageData(new ImageData(raster.pixels, raster.columns, raster.rows), 0, 0);
  return canvas;
}
