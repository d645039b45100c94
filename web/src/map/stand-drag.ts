/** Dragging the place where the rover is to stand: by its body it moves, by its nose (or with Shift) it turns. */

import PointerInteraction from "ol/interaction/Pointer";
import type VectorLayer from "ol/layer/Vector";
import type MapBrowserEvent from "ol/MapBrowserEvent";
import type VectorSource from "ol/source/Vector";
import type { Point } from "./geometry";

export interface StandEvents {
  taken(request: string): void;
  moved(at: Point, turns: boolean): void;
  dropped(): void;
}

export class StandDrag extends PointerInteraction {
  private part: "body" | "nose" = "body";

  constructor(
    private readonly layer: VectorLayer<VectorSource>,
    private readonly allowed: () => boolean,
    private readonly events: StandEvents,
  ) {
    super({ stopDown: (handled) => handled });
  }

  override handleDownEvent(event: MapBrowserEvent): boolean {
    if (!this.allowed() || (event.originalEvent as PointerEvent).button !== 0) return false;
    let taken = false;
    event.map.forEachFeatureAtPixel(
      event.pixel,
      (feature) => {
        const part: unknown = feature.get("part");
        if (part !== "body" && part !== "nose") return false;
        this.part = part;
        this.events.taken(String(feature.get("request")));
        taken = true;
        return true;
      },
      { hitTolerance: 3, layerFilter: (layer) => layer === this.layer },
    );
    return taken;
  }

  override handleDragEvent(event: MapBrowserEvent): void {
    const turns = this.part === "nose" || (event.originalEvent as PointerEvent).shiftKey;
    this.events.moved(event.coordinate as Point, turns);
  }

  override handleUpEvent(): boolean {
    this.events.dropped();
    return false;
  }
}
