/** What the pointer does on map and scene, and the edits that come of it. */

import * as calls from "../api/calls";
import type { Target } from "../api/types";
import { cornersOf } from "../lib/drives";
import type { Point } from "../map/geometry";
import { measureText } from "../lib/measure";
import type { Mode } from "../map/plan-map";
import { app } from "./app.svelte";
import type { MissionState } from "./mission.svelte";
import { Overlays } from "./overlays.svelte";
import { StandState } from "./stand.svelte";

export class Tools {
  mode = $state<Mode>("select");
  measured = $state.raw<Point[]>([]);
  /** Heights of what is measured, from the server; null while it is asked. */
  measuredUp = $state.raw<(number | null)[]>([]);
  readonly measuredText = $derived(measureText(this.measured, this.measuredUp));
  /** The drive whose path is drawn; the start is null. */
  way = $state.raw<{ from: string | null; to: string } | null>(null);
  private making = false;
  readonly stand: StandState;
  readonly overlays: Overlays;

  constructor(private readonly m: MissionState) {
    this.stand = new StandState(m);
    this.overlays = new Overlays(m);
  }

  setMode(mode: Mode): void {
    this.way = null;
    this.mode = this.mode === mode && mode !== "select" ? "select" : mode;
    this.measured = [];
    this.measuredUp = [];
    this.stand.cancel();
  }

  /** Make a target where somebody clicked; height, normal and covariance are the server's. */
  async pick(east: number, north: number, source = ""): Promise<Target | null> {
    return await this.created(() => calls.createTarget(this.m.id, this.m.nextTargetName(), round(east), round(north), source));
  }

  /** Make a target at coordinates that were typed, in the reference that is shown. */
  async place(point: readonly [number, number]): Promise<Target | null> {
    return await this.created(() => calls.createTargetAt(this.m.id, this.m.nextTargetName(), point, this.m.crs));
  }

  private async created(make: () => Promise<Target>): Promise<Target | null> {
    if (this.making) return null; // the second half of a double click
    this.making = true;
    const from = app.route;
    const created = await app.attempt("The new target", async () => {
      const target = await make();
      await this.m.reload("target");
      return target;
    });
    this.making = false;
    if (created === null) return null;
    this.mode = "select";
    app.goOn(from, { selection: { kind: "target", id: created.id }, tab: "selection" });
    return created;
  }

  async keepOutDrawn(corners: Point[]): Promise<void> {
    const from = app.route;
    const created = await app.attempt("The keep-out", async () => {
      const name = `K${this.m.keepOuts.length + 1}`;
      const keepOut = await calls.createKeepOut(this.m.id, name, corners.map(rounded));
      await this.m.reload("keep_out");
      return keepOut;
    });
    this.mode = "select";
    if (created !== null) app.goOn(from, { selection: { kind: "keep-out", id: created.id }, tab: "selection" });
  }

  /** Let somebody draw the path between two places on the map, from the start or the target named first. */
  drawWay(target: string, other: string | null): void {
    this.setMode("select");
    app.go({ view: "map" });
    this.way = { from: other, to: target };
    this.mode = "way";
  }

  async wayDrawn(points: Point[]): Promise<void> {
    const way = this.way;
    this.setMode("select");
    if (way === null) return;
    const [from, to] = [this.m.placeOf(way.from), this.m.placeOf(way.to)];
    if (from !== null && to !== null) await this.m.setDrive(way.from, way.to, cornersOf(points, from, to));
  }

  async keepOutReshaped(id: string, corners: Point[]): Promise<void> {
    const keepOut = this.m.keepOuts.find((known) => known.id === id);
    if (keepOut === undefined) return;
    await app.attempt("The keep-out", () => calls.changeKeepOut(keepOut, { polygon_m: corners.map(rounded) }));
    await app.attempt("The keep-outs", () => this.m.reload("keep_out"));
  }

  /** Measure between points; their heights are asked of the server. */
  async measure(points: Point[]): Promise<void> {
    this.measured = points;
    this.measuredUp = points.map(() => null);
    await app.attempt("Measuring", async () => {
      const found = await Promise.all(points.map(([east, north]) => calls.terrainPoint(this.m.id, east, north)));
      if (this.measured === points) this.measuredUp = found.map((point) => point.up_m);
    });
  }

  /** One end more; a third one begins anew. */
  async measureNext(point: Point): Promise<void> {
    await this.measure(this.measured.length === 1 ? [...this.measured, point] : [point]);
  }
}

const round = (value: number): number => Math.round(value * 1000) / 1000;
const rounded = (point: Point): number[] => [round(point[0]), round(point[1])];
