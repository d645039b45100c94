/** What is laid over the ground in map and scene, and the rasters for it, read once a mission. */

import * as calls from "../api/calls";
import { coverageRaster, type Raster, slopeRaster } from "../lib/overlay";
import type { Grid } from "../lib/terrain-image";
import { app, remember, remembered } from "./app.svelte";
import type { MissionState } from "./mission.svelte";

export type Overlay = "none" | "slope" | "coverage";
const POSTS = 90_000;

export class Overlays {
  shown = $state<Overlay>(remembered("overlay", "none"));
  slope = $state.raw<Raster | null>(null);
  coverage = $state.raw<Raster | null>(null);
  /** Heights for slope and contours. */
  grid = $state.raw<Grid | null>(null);
  readonly raster = $derived(this.shown === "slope" ? this.slope : this.shown === "coverage" ? this.coverage : null);

  private reading = new Set<string>();

  constructor(private readonly m: MissionState) {}

  get limit(): number {
    return this.m.rover?.max_slope_rad ?? 0.4363;
  }

  show(overlay: Overlay): void {
    this.shown = overlay;
    remember("overlay", overlay);
  }

  /** Read what is to be shown and is not there yet. */
  need(what: "grid" | "slope" | "coverage"): void {
    if (this.m.terrain === null || this.reading.has(what)) return;
    this.reading.add(what);
    void app.attempt(what === "coverage" ? "Reading the coverage" : "Reading the heights", async () => {
      if (what === "coverage") this.coverage = coverageRaster(await calls.coverage(this.m.id, "inner", POSTS));
      else {
        this.grid ??= await calls.heights(this.m.id, "inner", POSTS);
        if (what === "slope") this.slope = slopeRaster(this.grid, this.limit);
      }
      return true;
    }).then((done) => {
      // What could not be read may be asked for again.
      if (done === null) this.reading.delete(what);
    });
  }
}
