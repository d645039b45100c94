/** How things look on the plan map. */

import LineString from "ol/geom/LineString";
import PointGeometry from "ol/geom/Point";
import CircleStyle from "ol/style/Circle";
import Fill from "ol/style/Fill";
import RegularShape from "ol/style/RegularShape";
import Stroke from "ol/style/Stroke";
import Style from "ol/style/Style";
import Text from "ol/style/Text";
import type { ObservationRequest, Target } from "../api/types";
import { offsetPath, type Point, type Ribbon } from "./geometry";

export const FONT = '600 11px system-ui, "DejaVu Sans", sans-serif';
export const HALO = new Stroke({ color: "rgba(8,10,12,0.85)", width: 3.5 });
export const COLORS = {
  main: "#58d0f5",
  branch: ["#ff9d3c", "#ffc46b", "#ff7a59", "#f7b0c2"],
  select: "#ffe14d",
  other: "#d9a6ff",
  keepOut: "#ff5d52",
  track: "#8ff0a8",
  reached: "#7ee2a0",
  refused: "#ff6258",
};

export function lineColor(depth: number): string {
  return depth === 0 ? COLORS.main : (COLORS.branch[(depth - 1) % COLORS.branch.length] ?? COLORS.main);
}

/** Stripes of a keep-out, black and white beside the red: told from any ground in grey and by every eye. */
const HATCH_PX = 14;
let hatch: CanvasPattern | null = null;

function hatching(): CanvasPattern | string {
  if (hatch !== null) return hatch;
  const tile = document.createElement("canvas");
  const scale = Math.max(1, Math.round(devicePixelRatio));
  tile.width = tile.height = HATCH_PX * scale;
  const g = tile.getContext("2d");
  if (g === null) return "rgba(255,93,82,0.36)";
  g.scale(scale, scale);
  g.fillStyle = "rgba(255,93,82,0.2)";
  g.fillRect(0, 0, HATCH_PX, HATCH_PX);
  for (const [color, width] of [["rgba(0,0,0,0.75)", 4.2], ["rgba(255,255,255,0.9)", 1.6]] as const) {
    g.strokeStyle = color;
    g.lineWidth = width;
    g.beginPath();
    for (const shift of [-HATCH_PX, 0, HATCH_PX]) {
      g.moveTo(shift, HATCH_PX);
      g.lineTo(shift + HATCH_PX, 0);
    }
    g.stroke();
  }
  hatch = g.createPattern(tile, "repeat");
  return hatch ?? "rgba(255,93,82,0.36)";
}

/** A keep-out; one that is lifted is an outline. */
export function keepOutStyle(name: string, chosen: boolean, lifted: boolean): Style[] {
  const casing = new Stroke({ color: "rgba(10,12,14,0.85)", width: chosen ? 6 : 4.6 });
  return [
    new Style({ fill: new Fill({ color: lifted ? "rgba(255,93,82,0.05)" : hatching() }), stroke: lifted ? undefined : casing }),
    new Style({
      stroke: new Stroke({
        color: chosen ? COLORS.select : lifted ? `${COLORS.keepOut}80` : "#fff1ef",
        width: chosen ? 2.6 : 2,
        lineDash: chosen || !lifted ? [] : [7, 4],
      }),
      text: words(name, "#ffd9d5"),
    }),
  ];
}

export interface TargetLook {
  target: Target;
  requests: ObservationRequest[];
  /** Whether all of them are made from afar. */
  remote: boolean;
  /** Chance that the plan carries out something on it; null without a plan. */
  reach: number | null;
  products: number;
  selected: boolean;
  /** Initials of others who have it, or a request on it, selected; empty for nobody. */
  others: string;
  problem: boolean;
  tracker: string | null;
}

/** Words on the ground, readable on any of it. */
export function words(text: string, color = "#ffffff", offset: Point = [0, 0]): Text {
  return new Text({ text, font: FONT, offsetX: offset[0], offsetY: offset[1], fill: new Fill({ color }), stroke: HALO });
}

export function closed(ring: Point[]): Point[] {
  return [...ring, ring[0] ?? [0, 0]];
}

export function ribbonStyle(ribbon: Ribbon, resolution: number, dimmed: boolean, chosen: boolean): Style[] {
  const path = offsetPath(ribbon.path, ribbon.shift * resolution);
  const geometry = new LineString(path);
  const color = lineColor(ribbon.depth);
  const opacity = dimmed ? "40" : "d9";
  const styles = [
    new Style({
      geometry,
      zIndex: 10 - ribbon.depth,
      stroke: new Stroke({
        color: chosen ? COLORS.select : `rgba(8,12,16,${dimmed ? 0.25 : 0.75})`,
        width: ribbon.width + (chosen ? 5 : 2.4),
        lineCap: "butt",
      }),
    }),
    new Style({
      geometry,
      zIndex: 11 - ribbon.depth,
      stroke: new Stroke({ color: color + opacity, width: ribbon.width, lineCap: "butt" }),
    }),
  ];
  const middle = geometry.getCoordinateAt(0.55) as Point;
  const ahead = geometry.getCoordinateAt(0.6) as Point;
  styles.push(
    new Style({
      geometry: new PointGeometry(middle),
      zIndex: 12,
      image: new RegularShape({
        points: 3,
        radius: Math.max(4, ribbon.width * 0.42),
        rotation: Math.PI / 2 - Math.atan2(ahead[1] - middle[1], ahead[0] - middle[0]),
        fill: new Fill({ color: dimmed ? "rgba(10,16,20,0.3)" : "rgba(10,16,20,0.9)" }),
      }),
    }),
  );
  return styles;
}

export function targetStyle(look: TargetLook): Style[] {
  const { requests, remote } = look;
  const states = new Set(requests.map((request) => request.state));
  const fill = look.problem
    ? "#ff8a80"
    : states.has("satisfied")
      ? "#7ee2a0"
      : look.reach !== null && look.reach > 0.005
        ? "#ffffff"
        : requests.length === 0
          ? "#9aa4ab"
          : "#e9d9b8";
  const radius = (remote ? 5.5 : 6.5) + (look.selected ? 1.5 : 0);
  const ring = look.tracker === "tracked" ? "#6ff0a0" : look.tracker === null ? "#10161a" : "#ff6258";
  const base = {
    radius,
    fill: new Fill({ color: fill }),
    stroke: new Stroke({ color: ring, width: look.tracker === null ? 1.6 : 3 }),
  };
  // Contact measurements are discs, remote images are squares.
  const mark = remote ? new RegularShape({ ...base, points: 4, angle: Math.PI / 4, radius: radius + 1 }) : new CircleStyle(base);
  const styles: Style[] = [];
  if (look.selected) {
    styles.push(
      new Style({
        zIndex: 19,
        image: new CircleStyle({ radius: radius + 5, stroke: new Stroke({ color: COLORS.select, width: 2.4 }) }),
      }),
    );
  }
  if (look.others !== "") {
    const far = radius + 9;
    styles.push(
      new Style({
        zIndex: 19,
        image: new CircleStyle({ radius: far, stroke: new Stroke({ color: COLORS.other, width: 2, lineDash: [5, 3] }) }),
        text: words(look.others, COLORS.other, [0, far + 8]),
      }),
    );
  }
  styles.push(new Style({ zIndex: look.selected ? 20 : 18, image: mark }));
  return styles;
}

export function labelText(look: TargetLook): string {
  return clip(look.target.name, 22) + (look.products > 0 ? `  ▣ ${look.products}` : "");
}

const pen = document.createElement("canvas").getContext("2d");

export function measure(text: string): number {
  if (pen === null) return 7 * text.length;
  pen.font = FONT;
  return pen.measureText(text).width;
}

function clip(text: string, limit: number): string {
  return text.length <= limit ? text : `${text.slice(0, limit - 1)}…`;
}
