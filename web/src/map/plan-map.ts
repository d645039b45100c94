/** The plan map: OpenLayers in site metres. The Svelte component tells it what to show; it tells back what was done. */

import Feature from "ol/Feature";
import LineString from "ol/geom/LineString";
import MultiLineString from "ol/geom/MultiLineString";
import PointGeometry from "ol/geom/Point";
import Polygon from "ol/geom/Polygon";
import { defaults as defaultInteractions } from "ol/interaction/defaults";
import Draw from "ol/interaction/Draw";
import Modify from "ol/interaction/Modify";
import Snap from "ol/interaction/Snap";
import ImageLayer from "ol/layer/Image";
import VectorLayer from "ol/layer/Vector";
import OlMap from "ol/Map";
import { unByKey } from "ol/Observable";
import Projection from "ol/proj/Projection";
import ImageStatic from "ol/source/ImageStatic";
import VectorSource from "ol/source/Vector";
import CircleStyle from "ol/style/Circle";
import Fill from "ol/style/Fill";
import RegularShape from "ol/style/RegularShape";
import Stroke from "ol/style/Stroke";
import Style from "ol/style/Style";
import Text from "ol/style/Text";
import View from "ol/View";
import type { KeepOut, ObservationRequest, PathNetwork, Pose, Target, Terrain } from "../api/types";
import { type Grid, slopes } from "../lib/terrain-image";
import { ellipse, offsetPath, outline, placeLabels, type Point, type Ribbon, trackingCone } from "./geometry";

export type Mode = "select" | "target" | "keep-out" | "measure";

export interface MapEvents {
  picked(east: number, north: number): void;
  selected(kind: "target" | "keep-out" | "branch" | null, id: string, step: string | null): void;
  drawn(corners: Point[]): void;
  reshaped(id: string, corners: Point[]): void;
  measured(points: Point[]): void;
  hovered(east: number | null, north: number | null): void;
}

const FONT = '600 11px system-ui, "DejaVu Sans", sans-serif';
const HALO = new Stroke({ color: "rgba(8,10,12,0.85)", width: 3.5 });
const COLORS = {
  main: "#58d0f5",
  branch: ["#ff9d3c", "#ffc46b", "#ff7a59", "#f7b0c2"],
  select: "#ffe14d",
  keepOut: "#ff5d52",
  network: "rgba(255,255,255,0.42)",
  track: "#8ff0a8",
};
const CONE_HALF_ANGLE = 0.35;
const CROWD = 80;

export function lineColor(depth: number): string {
  return depth === 0 ? COLORS.main : (COLORS.branch[(depth - 1) % COLORS.branch.length] ?? COLORS.main);
}

export interface TargetLook {
  target: Target;
  requests: ObservationRequest[];
  /** Chance that the plan carries out something on it; null without a plan. */
  reach: number | null;
  products: number;
  selected: boolean;
  problem: boolean;
  tracker: string | null;
}

export class PlanMap {
  readonly map: OlMap;
  private readonly projection = new Projection({ code: "SITE", units: "m" });
  private readonly images: ImageLayer<ImageStatic>[] = [];
  private readonly slope = new ImageLayer({ opacity: 0.55, visible: false });
  private readonly contourLayer = this.vector(2);
  private readonly networkLayer = this.vector(3);
  private readonly coneLayer = this.vector(4);
  private readonly keepOutLayer = this.vector(5);
  private readonly planLayer = this.vector(6);
  private readonly afterLayer = this.vector(7);
  private readonly trackLayer = this.vector(8);
  private readonly targetLayer = this.vector(9);
  private readonly labelLayer = this.vector(12);
  private looks: readonly TargetLook[] = [];
  private readonly roverLayer = this.vector(10);
  private readonly scratch = this.vector(11);
  private draw: Draw | null = null;
  private readonly modify: Modify;
  private mode: Mode = "select";
  private bounds: [number, number, number, number] = [-16, -16, 16, 16];

  constructor(
    private readonly element: HTMLElement,
    private readonly events: MapEvents,
  ) {
    this.map = new OlMap({
      target: element,
      controls: [],
      interactions: defaultInteractions({ doubleClickZoom: false, altShiftDragRotate: false, pinchRotate: false }),
      layers: [
        this.slope,
        this.contourLayer,
        this.networkLayer,
        this.coneLayer,
        this.keepOutLayer,
        this.planLayer,
        this.afterLayer,
        this.trackLayer,
        this.targetLayer,
        this.roverLayer,
        this.scratch,
        this.labelLayer,
      ],
      view: new View({ projection: this.projection, center: [0, 0], resolution: 0.05, minResolution: 0.002 }),
    });
    this.slope.setZIndex(1);
    this.map.on("singleclick", (event) => this.clicked(event.pixel, event.coordinate as Point));
    this.map.on("pointermove", (event) => {
      const [east, north] = event.coordinate as Point;
      this.events.hovered(east, north);
      if (this.mode === "select") {
        const hit = this.map.hasFeatureAtPixel(event.pixel, { hitTolerance: 4, layerFilter: (l) => this.clickable(l) });
        this.element.style.cursor = hit ? "pointer" : "";
      }
    });
    element.addEventListener("pointerleave", () => this.events.hovered(null, null));
    this.map.on("moveend", () => {
      this.publishView();
      this.placeLabels();
    });
    this.modify = new Modify({
      source: this.keepOutLayer.getSource() as VectorSource,
      condition: (event) => (event.originalEvent as PointerEvent).button === 0 && this.mode === "select",
      pixelTolerance: 8,
    });
    this.modify.on("modifyend", (event) => {
      for (const feature of event.features.getArray()) {
        const id = String(feature.get("ref") ?? "");
        const ring = (feature.getGeometry() as Polygon).getCoordinates()[0] as Point[];
        if (feature.get("dirty")) this.events.reshaped(id, ring.slice(0, -1));
        feature.unset("dirty");
      }
    });
    this.map.addInteraction(this.modify);
    this.map.addInteraction(new Snap({ source: this.keepOutLayer.getSource() as VectorSource, pixelTolerance: 8 }));
  }

  private vector(z: number): VectorLayer<VectorSource> {
    return new VectorLayer({
      source: new VectorSource(),
      zIndex: z,
      updateWhileAnimating: true,
      updateWhileInteracting: true,
    });
  }

  private clickable(layer: unknown): boolean {
    return layer === this.targetLayer || layer === this.keepOutLayer || layer === this.planLayer;
  }

  /** Centre and metres per pixel stand on the element, for tests and for whoever scripts the page. */
  private publishView(): void {
    const view = this.map.getView();
    const [x = 0, y = 0] = view.getCenter() ?? [];
    this.element.dataset.center = `${x.toFixed(5)},${y.toFixed(5)}`;
    this.element.dataset.resolution = (view.getResolution() ?? 0).toFixed(7);
  }

  private clicked(pixel: number[], at: Point): void {
    if (this.mode === "target") {
      this.events.picked(at[0], at[1]);
      return;
    }
    if (this.mode !== "select") return;
    let found: Feature | null = null;
    this.map.forEachFeatureAtPixel(
      pixel,
      (feature) => {
        found = feature as Feature;
        return true;
      },
      { hitTolerance: 5, layerFilter: (layer) => this.clickable(layer) },
    );
    const feature = found as Feature | null;
    if (feature === null) this.events.selected(null, "", null);
    else this.events.selected(feature.get("kind"), String(feature.get("ref")), feature.get("step") ?? null);
  }

  setTerrain(terrain: Terrain, orthoUrl: (layer: string) => string): void {
    for (const layer of this.images.splice(0)) this.map.removeLayer(layer);
    const coarseFirst = [...terrain.layers].sort((a, b) => b.spacing_m - a.spacing_m);
    coarseFirst.forEach((layer, k) => {
      if (!layer.has_ortho) return;
      const b = layer.bounds_m;
      const image = new ImageLayer({
        zIndex: k === 0 ? 0 : 0.5,
        source: new ImageStatic({
          url: orthoUrl(layer.name),
          projection: this.projection,
          imageExtent: [b.east_min_m, b.north_min_m, b.east_max_m, b.north_max_m],
          interpolate: true,
        }),
      });
      this.images.push(image);
      this.map.addLayer(image);
    });
    const finest = coarseFirst[coarseFirst.length - 1]?.bounds_m ?? terrain.bounds_m;
    this.bounds = [finest.east_min_m, finest.north_min_m, finest.east_max_m, finest.north_max_m];
    this.fit();
    this.element.dataset.terrain = terrain.id;
  }

  fit(points: Point[] = []): void {
    const extent: [number, number, number, number] =
      points.length > 1
        ? [
            Math.min(...points.map((p) => p[0])),
            Math.min(...points.map((p) => p[1])),
            Math.max(...points.map((p) => p[0])),
            Math.max(...points.map((p) => p[1])),
          ]
        : this.bounds;
    this.map.getView().fit(extent, { padding: [36, 36, 36, 36], minResolution: 0.005 });
    this.publishView();
  }

  center(east: number, north: number): void {
    const pixel = this.map.getPixelFromCoordinate([east, north]);
    const [width = 0, height = 0] = this.map.getSize() ?? [];
    const margin = 60;
    const [x = -1, y = -1] = pixel ?? [];
    if (x > margin && y > margin && x < width - margin && y < height - margin) return;
    this.map.getView().animate({ center: [east, north], duration: 180 });
  }

  zoom(factor: number): void {
    const view = this.map.getView();
    view.animate({ resolution: (view.getResolution() ?? 0.05) / factor, duration: 120 });
  }

  setOrthoVisible(visible: boolean): void {
    for (const layer of this.images) layer.setVisible(visible);
  }

  setSlope(grid: Grid | null): void {
    this.slope.setVisible(grid !== null);
    if (grid === null) return;
    const canvas = document.createElement("canvas");
    canvas.width = grid.columns;
    canvas.height = grid.rows;
    const context = canvas.getContext("2d");
    if (context === null) return;
    const image = context.createImageData(grid.columns, grid.rows);
    slopes(grid).forEach((slope, k) => {
      const degrees = (slope * 180) / Math.PI;
      const [r, g, b, a] =
        degrees < 8 ? [60, 170, 110, 90] : degrees < 15 ? [235, 200, 70, 150] : degrees < 22 ? [245, 130, 50, 190] : [220, 40, 50, 220];
      image.data.set([r as number, g as number, b as number, a as number], 4 * k);
    });
    context.putImageData(image, 0, 0);
    this.slope.setSource(
      new ImageStatic({
        url: canvas.toDataURL(),
        projection: this.projection,
        imageExtent: [grid.west, grid.south, grid.east, grid.north],
      }),
    );
  }

  setContours(lines: Map<number, number[]> | null, step: number): void {
    const source = this.contourLayer.getSource() as VectorSource;
    source.clear();
    if (lines === null) return;
    for (const [level, flat] of lines) {
      const parts: Point[][] = [];
      for (let k = 0; k + 3 < flat.length; k += 4) {
        parts.push([
          [flat[k] as number, flat[k + 1] as number],
          [flat[k + 2] as number, flat[k + 3] as number],
        ]);
      }
      const feature = new Feature(new MultiLineString(parts));
      const index = Math.round(level / step);
      const strong = index % 5 === 0;
      feature.setStyle(
        new Style({
          stroke: new Stroke({ color: `rgba(255,244,225,${strong ? 0.75 : 0.38})`, width: strong ? 1.3 : 0.8 }),
        }),
      );
      source.addFeature(feature);
    }
  }

  setKeepOuts(keepOuts: readonly KeepOut[], selected: string | null): void {
    const source = this.keepOutLayer.getSource() as VectorSource;
    source.clear();
    for (const keepOut of keepOuts) {
      const ring = keepOut.polygon_m.map((p): Point => [p[0] ?? 0, p[1] ?? 0]);
      const feature = new Feature(new Polygon([[...ring, ring[0] ?? [0, 0]]]));
      feature.setProperties({ kind: "keep-out", ref: keepOut.id });
      const chosen = keepOut.id === selected;
      feature.setStyle(
        new Style({
          fill: new Fill({ color: chosen ? "rgba(255,93,82,0.36)" : "rgba(255,93,82,0.22)" }),
          stroke: new Stroke({
            color: chosen ? COLORS.select : COLORS.keepOut,
            width: chosen ? 2.5 : 1.8,
            lineDash: chosen ? [] : [7, 4],
          }),
          text: new Text({ text: keepOut.name, font: FONT, fill: new Fill({ color: "#ffd9d5" }), stroke: HALO }),
        }),
      );
      feature.getGeometry()?.on("change", () => feature.set("dirty", true, true));
      source.addFeature(feature);
    }
  }

  setNetwork(network: PathNetwork | null, show: boolean, focus: string | null): void {
    const source = this.networkLayer.getSource() as VectorSource;
    source.clear();
    if (network === null || !show) return;
    const seen = new Set<string>();
    for (const segment of network.segments) {
      const key = [segment.start, segment.end].sort().join("|");
      if (seen.has(key)) continue;
      seen.add(key);
      const path = segment.points_m.map((p): Point => [p[0] ?? 0, p[1] ?? 0]);
      const losses = Object.entries(segment.p_lose);
      const loss =
        focus !== null ? (segment.p_lose[focus] ?? 0) : Math.max(0, ...losses.map(([, p]) => p));
      const feature = new Feature(new LineString(path));
      const heat = Math.min(1, loss / 0.3);
      feature.setStyle(
        new Style({
          stroke: new Stroke({
            color: loss > 0.005 ? `rgba(255,${Math.round(235 - 160 * heat)},${Math.round(200 - 150 * heat)},${0.4 + 0.4 * heat})` : COLORS.network,
            width: 1.2,
            lineDash: [4, 4],
          }),
        }),
      );
      source.addFeature(feature);
    }
    for (const node of network.nodes) {
      const feature = new Feature(new PointGeometry([node.pose.east_m, node.pose.north_m]));
      feature.setStyle(
        new Style({
          image: new RegularShape({
            points: 3,
            radius: 5.5,
            rotation: Math.PI / 2 - node.pose.heading_rad,
            fill: new Fill({ color: "rgba(255,255,255,0.85)" }),
            stroke: new Stroke({ color: "rgba(0,0,0,0.7)", width: 1 }),
          }),
        }),
      );
      source.addFeature(feature);
    }
  }

  setRibbons(ribbons: readonly Ribbon[], focusLine: string | null, focusStep: string | null): void {
    const source = this.planLayer.getSource() as VectorSource;
    source.clear();
    const features = [...ribbons]
      .sort((a, b) => b.depth - a.depth)
      .map((ribbon) => {
        const feature = new Feature(new LineString(ribbon.path));
        feature.setProperties({ kind: "branch", ref: ribbon.line, step: ribbon.step });
        const dimmed = focusLine !== null && focusLine !== ribbon.line;
        const chosen = focusStep === ribbon.step;
        feature.setStyle((_feature, resolution) => ribbonStyle(ribbon, resolution, dimmed, chosen));
        return feature;
      });
    source.addFeatures(features);
  }

  /** Precedence between requests: an arrow from what comes first. */
  setOrder(pairs: readonly [Point, Point][]): void {
    const source = this.afterLayer.getSource() as VectorSource;
    source.clear();
    for (const [from, to] of pairs) {
      const feature = new Feature(new LineString([from, to]));
      const angle = Math.atan2(to[1] - from[1], to[0] - from[0]);
      feature.setStyle([
        new Style({ stroke: new Stroke({ color: "rgba(214,178,255,0.9)", width: 1.4, lineDash: [2, 4] }) }),
        new Style({
          geometry: new PointGeometry([from[0] + (to[0] - from[0]) * 0.6, from[1] + (to[1] - from[1]) * 0.6]),
          image: new RegularShape({
            points: 3,
            radius: 5,
            rotation: Math.PI / 2 - angle,
            fill: new Fill({ color: "#d6b2ff" }),
          }),
        }),
      ]);
      source.addFeature(feature);
    }
  }

  setTargets(looks: readonly TargetLook[], eye: Pose | null): void {
    const source = this.targetLayer.getSource() as VectorSource;
    const cones = this.coneLayer.getSource() as VectorSource;
    source.clear();
    cones.clear();
    this.looks = looks;
    this.placeLabels();
    for (const look of looks) {
      const { target } = look;
      const place: Point = [target.position.east_m, target.position.north_m];
      const feature = new Feature(new PointGeometry(place));
      feature.setProperties({ kind: "target", ref: target.id });
      feature.setStyle(targetStyle(look));
      source.addFeature(feature);
      if (!look.selected) continue;
      const spread = new Feature(new Polygon([closed(ellipse(place, target.covariance_m2))]));
      spread.setStyle(new Style({ stroke: new Stroke({ color: COLORS.select, width: 1.2 }), fill: new Fill({ color: "rgba(255,225,77,0.15)" }) }));
      cones.addFeature(spread);
      if (eye !== null && look.requests.some((request) => request.tracked)) {
        const cone = new Feature(new Polygon([closed(trackingCone(place, [eye.east_m, eye.north_m], CONE_HALF_ANGLE))]));
        cone.setStyle(
          new Style({
            fill: new Fill({ color: "rgba(120,210,255,0.12)" }),
            stroke: new Stroke({ color: "rgba(120,210,255,0.55)", width: 1, lineDash: [3, 4] }),
          }),
        );
        cones.addFeature(cone);
      }
      for (const request of look.requests) {
        const pose = request.observation_point?.pose;
        if (!pose) continue;
        const link = new Feature(new LineString([[pose.east_m, pose.north_m], place]));
        link.setStyle(new Style({ stroke: new Stroke({ color: COLORS.select, width: 1.2, lineDash: [3, 3] }) }));
        cones.addFeature(link);
        const stand = new Feature(new Polygon([closed(outline(pose.east_m, pose.north_m, pose.heading_rad, 1.05, 0.85))]));
        stand.setStyle(new Style({ stroke: new Stroke({ color: COLORS.select, width: 1.2 }), fill: new Fill({ color: "rgba(255,225,77,0.12)" }) }));
        cones.addFeature(stand);
      }
    }
  }

  /** Write the names where they do not lie on a mark or on each other; the more valuable target goes first. */
  private placeLabels(): void {
    const source = this.labelLayer.getSource() as VectorSource;
    source.clear();
    const resolution = this.map.getView().getResolution() ?? 1;
    const value = (look: TargetLook): number => look.requests.reduce((sum, request) => sum + request.value, 0);
    // Hundreds of names would hide the ground: the most valuable targets keep theirs.
    const ordered = [...this.looks]
      .sort((a, b) => Number(b.selected) - Number(a.selected) || value(b) - value(a))
      .slice(0, this.looks.length > CROWD ? CROWD / 2 : undefined);
    const at = (look: TargetLook): Point => [
      look.target.position.east_m / resolution,
      -look.target.position.north_m / resolution,
    ];
    const labels = placeLabels(
      ordered.map((look) => ({ at: at(look), width: measure(labelText(look)), height: 14 })),
      9,
    );
    labels.forEach((placed, k) => {
      const look = ordered[k];
      if (look === undefined || placed === null) return;
      const feature = new Feature(new PointGeometry([look.target.position.east_m, look.target.position.north_m]));
      feature.setStyle(
        new Style({
          text: new Text({
            text: labelText(look),
            font: FONT,
            offsetX: placed[0],
            offsetY: placed[1],
            fill: new Fill({ color: look.selected ? COLORS.select : "#ffffff" }),
            stroke: HALO,
          }),
        }),
      );
      source.addFeature(feature);
    });
  }

  setRover(pose: { east_m: number; north_m: number; heading_rad: number } | null, ghost: boolean): void {
    const source = this.roverLayer.getSource() as VectorSource;
    source.clear();
    if (pose === null) return;
    const feature = new Feature(new PointGeometry([pose.east_m, pose.north_m]));
    feature.setStyle((_feature, resolution) => {
      // Drawn to scale, but never smaller than can be seen.
      const scale = Math.max(1, (20 * resolution) / 1.05);
      const body = outline(pose.east_m, pose.north_m, pose.heading_rad, 1.05 * scale, 0.85 * scale);
      return new Style({
        geometry: new Polygon([closed(body)]),
        fill: new Fill({ color: ghost ? "rgba(255,255,255,0.25)" : "rgba(250,252,255,0.95)" }),
        stroke: new Stroke({ color: ghost ? "rgba(255,255,255,0.8)" : "#12202a", width: 1.6 }),
      });
    });
    source.addFeature(feature);
    this.element.dataset.rover = `${pose.east_m.toFixed(3)},${pose.north_m.toFixed(3)}`;
  }

  setTrack(points: readonly Point[]): void {
    const source = this.trackLayer.getSource() as VectorSource;
    source.clear();
    if (points.length < 2) return;
    const feature = new Feature(new LineString(points as Point[]));
    feature.setStyle([
      new Style({ stroke: new Stroke({ color: "rgba(6,14,8,0.8)", width: 4.5 }) }),
      new Style({ stroke: new Stroke({ color: COLORS.track, width: 2.2 }) }),
    ]);
    source.addFeature(feature);
  }

  setMode(mode: Mode): void {
    this.mode = mode;
    if (this.draw !== null) this.map.removeInteraction(this.draw);
    this.draw = null;
    (this.scratch.getSource() as VectorSource).clear();
    this.modify.setActive(mode === "select");
    this.element.style.cursor = mode === "select" ? "" : "crosshair";
    if (mode !== "keep-out" && mode !== "measure") return;
    const color = mode === "keep-out" ? COLORS.keepOut : "#ffffff";
    this.draw = new Draw({
      source: this.scratch.getSource() as VectorSource,
      type: mode === "keep-out" ? "Polygon" : "LineString",
      maxPoints: mode === "measure" ? 2 : undefined,
      style: new Style({
        stroke: new Stroke({ color, width: 2, lineDash: [6, 4] }),
        fill: new Fill({ color: "rgba(255,93,82,0.2)" }),
        image: new CircleStyle({ radius: 4, fill: new Fill({ color }) }),
      }),
    });
    this.draw.on("drawstart", () => (this.scratch.getSource() as VectorSource).clear());
    this.draw.on("drawend", (event) => {
      const geometry = event.feature.getGeometry();
      if (geometry instanceof Polygon) {
        this.events.drawn((geometry.getCoordinates()[0] as Point[]).slice(0, -1));
        const key = (this.scratch.getSource() as VectorSource).on("addfeature", () => {
          unByKey(key);
          (this.scratch.getSource() as VectorSource).clear();
        });
      } else if (geometry instanceof LineString) {
        event.feature.setStyle(new Style({ stroke: new Stroke({ color: "#ffffff", width: 2 }) }));
        this.events.measured(geometry.getCoordinates() as Point[]);
      }
    });
    this.map.addInteraction(this.draw);
  }

  undoCorner(): void {
    this.draw?.removeLastPoint();
  }

  resize(): void {
    this.map.updateSize();
  }

  dispose(): void {
    this.map.setTarget(undefined);
    this.map.dispose();
  }
}

function closed(ring: Point[]): Point[] {
  return [...ring, ring[0] ?? [0, 0]];
}

function ribbonStyle(ribbon: Ribbon, resolution: number, dimmed: boolean, chosen: boolean): Style[] {
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

function targetStyle(look: TargetLook): Style[] {
  const { requests } = look;
  const states = new Set(requests.map((request) => request.state));
  const contact = requests.some((request) => request.instrument === "microscopic_imager");
  const fill = look.problem
    ? "#ff8a80"
    : states.has("satisfied")
      ? "#7ee2a0"
      : look.reach !== null && look.reach > 0.005
        ? "#ffffff"
        : requests.length === 0
          ? "#9aa4ab"
          : "#e9d9b8";
  const radius = (contact ? 6.5 : 5.5) + (look.selected ? 1.5 : 0);
  const ring = look.tracker === "tracked" ? "#6ff0a0" : look.tracker === null ? "#10161a" : "#ff6258";
  const base = {
    radius,
    fill: new Fill({ color: fill }),
    stroke: new Stroke({ color: ring, width: look.tracker === null ? 1.6 : 3 }),
  };
  // Contact measurements are discs, remote images are squares.
  const mark = contact || requests.length === 0 ? new CircleStyle(base) : new RegularShape({ ...base, points: 4, angle: Math.PI / 4, radius: radius + 1 });
  const styles: Style[] = [];
  if (look.selected) {
    styles.push(
      new Style({
        zIndex: 19,
        image: new CircleStyle({ radius: radius + 5, stroke: new Stroke({ color: COLORS.select, width: 2.4 }) }),
      }),
    );
  }
  styles.push(new Style({ zIndex: look.selected ? 20 : 18, image: mark }));
  return styles;
}

function labelText(look: TargetLook): string {
  return clip(look.target.name, 22) + (look.products > 0 ? `  ▣ ${look.products}` : "");
}

const pen = document.createElement("canvas").getContext("2d");

function measure(text: string): number {
  if (pen === null) return 7 * text.length;
  pen.font = FONT;
  return pen.measureText(text).width;
}

function clip(text: string, limit: number): string {
  return text.length <= limit ? text : `${text.slice(0, limit - 1)}…`;
}
