/** Keep-outs on the map and changing them: corners and edges, a selected one as a whole, by pointer or by crosshair. */

import Feature from "ol/Feature";
import Polygon from "ol/geom/Polygon";
import Modify from "ol/interaction/Modify";
import PointerInteraction from "ol/interaction/Pointer";
import Snap from "ol/interaction/Snap";
import type VectorLayer from "ol/layer/Vector";
import type OlMap from "ol/Map";
import type MapBrowserEvent from "ol/MapBrowserEvent";
import type VectorSource from "ol/source/Vector";
import Stroke from "ol/style/Stroke";
import Style from "ol/style/Style";
import type { Point } from "./geometry";
import { moved, type Part, partAt, snapped, withCorner, withCornerLess, withCornerMore } from "./polygon-edit";
import { closed, keepOutStyle } from "./styles";

const REACH_PX = 8;
const SNAP_PX = 10;

export interface KeepOutLook {
  id: string;
  name: string;
  ring: Point[];
  /** What is saved, where a what-if has moved it. */
  saved: Point[] | null;
  /** Not there in the what-if. */
  lifted: boolean;
}

export interface KeepOutEvents {
  /** While it is being changed. */
  reshaping(id: string, corners: Point[]): void;
  reshaped(id: string, corners: Point[]): void;
}

interface Held {
  feature: Feature<Polygon>;
  part: Part;
  before: Point[];
  from: Point;
}

export class KeepOutEdit {
  readonly snap: Snap;
  private readonly modify: Modify;
  private held: Held | null = null;
  private dragging = false;
  /** What is drawn, as it came; empty once a person has moved some of it. */
  private drawn = "";
  private waiting: [readonly KeepOutLook[], string | null] | null = null;

  constructor(
    private readonly map: OlMap,
    private readonly layer: VectorLayer<VectorSource>,
    private readonly events: KeepOutEvents,
  ) {
    this.modify = new Modify({
      source: this.source,
      condition: (event) => (event.originalEvent as PointerEvent).button === 0,
      filter: (feature) => feature.get("kind") === "keep-out",
      pixelTolerance: REACH_PX,
    });
    this.modify.on("modifystart", () => (this.dragging = true));
    this.modify.on("modifyend", () => this.ended());
    map.addInteraction(new WholeDrag(this));
    map.addInteraction(this.modify);
    this.snap = new Snap({ source: this.source, pixelTolerance: SNAP_PX });
  }

  private get source(): VectorSource {
    return this.layer.getSource() as VectorSource;
  }

  private get reach(): number {
    return REACH_PX * (this.map.getView().getResolution() ?? 0.05);
  }

  private get features(): Feature<Polygon>[] {
    return this.source.getFeatures().filter((feature) => feature.get("kind") === "keep-out") as Feature<Polygon>[];
  }

  setActive(active: boolean): void {
    this.modify.setActive(active);
    if (!active) this.putBack();
  }

  get active(): boolean {
    return this.modify.getActive();
  }

  /**
   * Show keep-outs; what is being changed at the moment is not taken out of the hand, and what is the same as before is
   * not drawn anew: that would take away the handle under a pointer that is about to press.
   */
  show(looks: readonly KeepOutLook[], selected: string | null): void {
    if (this.dragging) {
      this.waiting = [looks, selected];
      return;
    }
    this.waiting = null;
    const drawn = JSON.stringify([looks, selected]);
    if (drawn === this.drawn) return;
    this.drawn = drawn;
    this.source.clear();
    for (const look of looks) {
      if (look.saved !== null) {
        const ghost = new Feature(new Polygon([closed(look.saved)]));
        ghost.setStyle(new Style({ stroke: new Stroke({ color: "rgba(255,255,255,0.8)", width: 1.4, lineDash: [3, 4] }) }));
        this.source.addFeature(ghost);
      }
      const feature = new Feature(new Polygon([closed(look.ring)]));
      feature.setProperties({ kind: "keep-out", ref: look.id });
      const chosen = look.id === selected;
      feature.set("chosen", chosen);
      feature.setStyle(keepOutStyle(look.lifted ? `${look.name}, lifted` : look.name, chosen, look.lifted));
      feature.getGeometry()?.on("change", () => {
        feature.set("dirty", true, true);
        this.drawn = "";
        if (this.dragging) this.events.reshaping(look.id, ringOf(feature));
      });
      this.source.addFeature(feature);
    }
  }

  /** Tell what was changed and is let go. */
  private ended(): void {
    this.dragging = false;
    this.held = null;
    this.waiting = null;
    for (const feature of this.features) {
      if (feature.get("dirty") !== true) continue;
      feature.unset("dirty", true);
      this.events.reshaped(String(feature.get("ref")), ringOf(feature));
    }
  }

  // ---- the whole of the selected one, by pointer

  beginWhole(at: Point): boolean {
    const feature = this.features.find((known) => known.get("chosen") === true);
    if (!this.active || feature === undefined || partAt(at, ringOf(feature), this.reach)?.kind !== "inside") return false;
    this.take(feature, { kind: "inside" }, at);
    return true;
  }

  // ---- what the crosshair holds

  get holds(): boolean {
    return this.held !== null;
  }

  /** Take hold of a corner, of an edge (that makes a corner) or of a whole keep-out at a place; false if none is there. */
  grab(at: Point): boolean {
    if (!this.active) return false;
    const found = this.features
      .map((feature) => ({ feature, part: partAt(at, ringOf(feature), this.reach) }))
      .sort((a, b) => Number(b.feature.get("chosen")) - Number(a.feature.get("chosen")));
    const best = found.find(({ part }) => part !== null && part.kind !== "inside") ?? found.find(({ part }) => part !== null);
    if (best === undefined || best.part === null) return false;
    this.take(best.feature, best.part, at);
    return true;
  }

  /** Take hold of the selected keep-out as a whole; its middle, or null if none is selected. */
  grabChosen(): Point | null {
    const feature = this.features.find((known) => known.get("chosen") === true);
    if (!this.active || feature === undefined) return null;
    const ring = ringOf(feature);
    const middle: Point = [ring.reduce((sum, p) => sum + p[0], 0) / ring.length, ring.reduce((sum, p) => sum + p[1], 0) / ring.length];
    this.take(feature, { kind: "inside" }, middle);
    return middle;
  }

  private take(feature: Feature<Polygon>, part: Part, from: Point): void {
    const before = ringOf(feature);
    this.dragging = true;
    if (part.kind === "edge") {
      this.held = { feature, part: { kind: "corner", index: part.index + 1 }, before, from };
      write(feature, withCornerMore(before, part.index, from));
    } else this.held = { feature, part, before, from };
  }

  /** Move what is held to a place. */
  carry(at: Point): void {
    const { held } = this;
    if (held === null) return;
    if (held.part.kind === "inside") write(held.feature, moved(held.before, [at[0] - held.from[0], at[1] - held.from[1]]));
    else write(held.feature, withCorner(ringOf(held.feature), held.part.index, this.snapTo(at, held.feature)));
  }

  /** Let go: what was changed is told. */
  drop(): void {
    if (this.held !== null) this.ended();
  }

  /** Let go and leave everything as it was. */
  putBack(): void {
    const { held, waiting } = this;
    if (held === null) return;
    write(held.feature, held.before);
    held.feature.unset("dirty", true);
    this.held = null;
    this.dragging = false;
    if (waiting !== null) this.show(...waiting);
  }

  /** Remove the corner that is held; an outline keeps three. */
  removeCorner(): void {
    const { held } = this;
    if (held?.part.kind !== "corner") return;
    write(held.feature, withCornerLess(ringOf(held.feature), held.part.index));
    this.ended();
  }

  /** A place drawn to the corners and edges of the keep-outs, as the pointer is. */
  snapTo(at: Point, but: Feature<Polygon> | null = null): Point {
    const reach = SNAP_PX * (this.map.getView().getResolution() ?? 0.05);
    return snapped(at, this.features.filter((feature) => feature !== but).map(ringOf), reach);
  }
}

/** Drags the selected keep-out by its inside. Its own outline would catch the pointer: it is taken as it is, unsnapped. */
class WholeDrag extends PointerInteraction {
  constructor(private readonly edit: KeepOutEdit) {
    super({ stopDown: (handled) => handled });
  }

  override handleDownEvent(event: MapBrowserEvent): boolean {
    return (event.originalEvent as PointerEvent).button === 0 && this.edit.beginWhole(unsnapped(event));
  }

  override handleDragEvent(event: MapBrowserEvent): void {
    this.edit.carry(unsnapped(event));
  }

  override handleUpEvent(): boolean {
    this.edit.drop();
    return false;
  }
}

const unsnapped = (event: MapBrowserEvent): Point => event.map.getEventCoordinate(event.originalEvent as PointerEvent) as Point;

const ringOf = (feature: Feature<Polygon>): Point[] => (feature.getGeometry()?.getCoordinates()[0] ?? []).slice(0, -1) as Point[];

const write = (feature: Feature<Polygon>, ring: Point[]): void => feature.getGeometry()?.setCoordinates([closed(ring)]);
