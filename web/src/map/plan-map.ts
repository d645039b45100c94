/** The plan map: OpenLayers in site metres. The Svelte component tells it what to show; it tells back what was done. */

import Feature from "ol/Feature";
import LineString from "ol/geom/LineString";
import MultiLineString from "ol/geom/MultiLineString";
import PointGeometry from "ol/geom/Point";
import Polygon from "ol/geom/Polygon";
import { defaults as defaultInteractions } from "ol/interaction/defaults";
import Draw from "ol/interaction/Draw";
import ImageLayer from "ol/layer/Image";
import VectorLayer from "ol/layer/Vector";
import OlMap from "ol/Map";
import Projection from "ol/proj/Projection";
import ImageStatic from "ol/source/ImageStatic";
import VectorSource from "ol/source/Vector";
import CircleStyle from "ol/style/Circle";
import Fill from "ol/style/Fill";
import RegularShape from "ol/style/RegularShape";
import Stroke from "ol/style/Stroke";
import Style from "ol/style/Style";
import View from "ol/View";
import type { PathNetwork, Pose, RoverShape, Target, Terrain } from "../api/types";
import { canvasOf, edges, type Raster } from "../lib/overlay";
import type { RuleLook } from "../lib/drives";
import type { Spot } from "../lib/spread";
import { drivesOf, ellipse, lossColour, outline, placeLabels, type Point, reachSector, type Ribbon, trackingCone } from "./geometry";
import { KeepOutEdit, type KeepOutEvents, type KeepOutLook } from "./keep-out-edit";
import { inside } from "./polygon-edit";
import { StandDrag } from "./stand-drag";
import { closed, COLORS, labelText, lineColor, measure, ribbonStyle, type TargetLook, targetStyle, words } from "./styles";

export type Mode = "select" | "target" | "keep-out" | "measure" | "way";

export interface MapEvents extends KeepOutEvents {
  picked(east: number, north: number): void;
  selected(kind: "target" | "keep-out" | "branch" | null, id: string, step: string | null): void;
  drawn(corners: Point[]): void;
  measured(points: Point[]): void;
  wayDrawn(points: Point[]): void;
  hovered(east: number | null, north: number | null): void;
  /** Metres per pixel after the view has moved. */
  scaled(resolution: number): void;
  standTaken(request: string): void;
  standMoved(east: number, north: number, turns: boolean): void;
  standDropped(): void;
  standPutBack(): void;
}

/** Where the rover is to stand for the selected target. */
export interface StandLook {
  request: string;
  pose: Pose;
  target: Target;
  /** Whether the target is reached while the point is dragged; null when nobody has said. */
  verdict: boolean | null;
}

const CROWD = 80;
/** Longest side of the picture that is shown until the sharp one has come. */
const FIRST_PX = 512;

export class PlanMap {
  readonly map: OlMap;
  private readonly projection = new Projection({ code: "SITE", units: "m" });
  private readonly images: ImageLayer<ImageStatic>[] = [];
  private readonly overlay = new ImageLayer({ opacity: 0.75, visible: false });
  private readonly contourLayer = this.vector(2);
  private readonly networkLayer = this.vector(3, true);
  private readonly ruleLayer = this.vector(7);
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
  private readonly spreadLayer = this.vector(8);
  private readonly standLayer = this.vector(9);
  private readonly crossLayer = this.vector(13);
  private cross: Point | null = null;
  private draw: Draw | null = null;
  /** Corners set with the crosshair in the outline that is drawn. */
  private corners = 0;
  private readonly keepOuts: KeepOutEdit;
  /** The observation point's part that the crosshair holds. */
  private standHeld: "body" | "nose" | null = null;
  private stand: StandLook | null = null;
  private shape: RoverShape | null = null;
  private mode: Mode = "select";
  private bounds: [number, number, number, number] = [-16, -16, 16, 16];

  constructor(
    private readonly element: HTMLElement,
    private readonly events: MapEvents,
  ) {
    this.map = new OlMap({
      target: element,
      controls: [],
      interactions: defaultInteractions({ doubleClickZoom: false, keyboard: false, altShiftDragRotate: false, pinchRotate: false }),
      layers: [
        this.overlay,
        this.contourLayer,
        this.networkLayer,
        this.ruleLayer,
        this.coneLayer,
        this.keepOutLayer,
        this.planLayer,
        this.afterLayer,
        this.spreadLayer,
        this.standLayer,
        this.trackLayer,
        this.targetLayer,
        this.roverLayer,
        this.scratch,
        this.labelLayer,
        this.crossLayer,
      ],
      view: new View({ projection: this.projection, center: [0, 0], resolution: 0.05, minResolution: 0.002 }),
    });
    this.overlay.setZIndex(1);
    // Not "singleclick", which is told a quarter of a second late, when another tool may be in the hand.
    this.map.on("click", (event) => this.clicked(event.pixel, event.coordinate as Point));
    this.map.on("pointermove", (event) => {
      const [east, north] = event.coordinate as Point;
      this.events.hovered(east, north);
      if (this.mode === "select") {
        const hit = this.map.hasFeatureAtPixel(event.pixel, { hitTolerance: 4, layerFilter: (l) => this.clickable(l) });
        const held = this.map.hasFeatureAtPixel(event.pixel, { hitTolerance: 2, layerFilter: (l) => l === this.standLayer });
        this.element.style.cursor = hit ? "pointer" : held ? "move" : "";
      }
    });
    element.addEventListener("pointerleave", () => this.events.hovered(null, null));
    this.map.on("moveend", () => {
      this.publishView();
      this.placeLabels();
    });
    this.keepOuts = new KeepOutEdit(this.map, this.keepOutLayer, events);
    this.map.addInteraction(
      new StandDrag(this.standLayer, () => this.mode === "select", {
        taken: (request) => this.events.standTaken(request),
        moved: (at, turns) => this.events.standMoved(at[0], at[1], turns),
        dropped: () => this.events.standDropped(),
      }),
    );
    this.map.addInteraction(this.keepOuts.snap);
  }

  private vector(z: number, declutter = false): VectorLayer<VectorSource> {
    return new VectorLayer({
      source: new VectorSource(),
      declutter,
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
    this.events.scaled(view.getResolution() ?? 0);
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

  /** Show the ground: a small picture first, and the sharp one in its place when that has come. */
  setTerrain(terrain: Terrain, orthoUrl: (layer: string, pixels?: number) => string): void {
    for (const layer of this.images.splice(0)) this.map.removeLayer(layer);
    delete this.element.dataset.ground;
    const coarseFirst = [...terrain.layers].sort((a, b) => b.spacing_m - a.spacing_m);
    const finestLayer = coarseFirst.at(-1);
    const pictured = coarseFirst.filter((layer) => layer.has_ortho);
    let waiting = pictured.length;
    let sharp = 0;
    const drawn = (how: string, then = (): void => {}): void => {
      this.map.once("postrender", () => {
        this.element.dataset.ground = how;
        then();
      });
      this.map.render();
    };
    const first = pictured.map((layer) => this.picture(layer, orthoUrl(layer.name, layer === finestLayer ? FIRST_PX : FIRST_PX / 2), layer === coarseFirst[0] ? 0 : 0.5));
    const sharpen = (): void =>
      pictured.forEach((layer, k) => {
        const under = first[k] as ImageLayer<ImageStatic>;
        const image = this.picture(layer, orthoUrl(layer.name), (under.getZIndex() ?? 0) + 0.1);
        image.setVisible(under.getVisible());
        image.getSource()?.once("imageloadend", () => {
          sharp += 1;
          if (sharp === pictured.length) drawn("sharp");
        });
      });
    const shown = (): void => {
      waiting -= 1;
      if (waiting === 0) drawn("first", sharpen);
    };
    for (const image of first) {
      image.getSource()?.once("imageloadend", shown);
      image.getSource()?.once("imageloaderror", shown);
    }
    if (pictured.length === 0) drawn("sharp");
    const finest = coarseFirst[coarseFirst.length - 1]?.bounds_m ?? terrain.bounds_m;
    this.bounds = [finest.east_min_m, finest.north_min_m, finest.east_max_m, finest.north_max_m];
    this.fit();
    this.element.dataset.terrain = terrain.id;
  }

  private picture(layer: Terrain["layers"][number], url: string, z: number): ImageLayer<ImageStatic> {
    const b = layer.bounds_m;
    const image = new ImageLayer({
      zIndex: z,
      source: new ImageStatic({
        url,
        projection: this.projection,
        imageExtent: [b.east_min_m, b.north_min_m, b.east_max_m, b.north_max_m],
        interpolate: true,
      }),
    });
    this.images.push(image);
    this.map.addLayer(image);
    return image;
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

  setOverlay(raster: Raster | null): void {
    this.overlay.setVisible(raster !== null);
    if (raster === null) return;
    const b = edges(raster);
    this.overlay.setSource(
      new ImageStatic({
        url: canvasOf(raster).toDataURL(),
        projection: this.projection,
        imageExtent: [b.west, b.south, b.east, b.north],
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
          stroke: new Stroke({ color: `rgba(255,244,225,${strong ? 0.8 : 0.42})`, width: strong ? 1.4 : 0.8 }),
        }),
      );
      source.addFeature(feature);
      if (!strong) continue;
      // The level stands once or twice on each fifth line.
      for (const share of parts.length > 400 ? [0.2, 0.7] : [0.5]) {
        const part = parts[Math.floor(parts.length * share)];
        if (part === undefined) continue;
        const [[x0, y0], [x1, y1]] = part as [Point, Point];
        const slant = -Math.atan2(y1 - y0, x1 - x0);
        const label = new Feature(new PointGeometry([(x0 + x1) / 2, (y0 + y1) / 2]));
        const text = words(`${level.toFixed(step < 1 ? 1 : 0).replace("-", "−")} m`, "#fff4e1");
        text.setRotation(Math.abs(slant) > Math.PI / 2 ? slant + Math.PI : slant);
        label.setStyle(new Style({ text }));
        source.addFeature(label);
      }
    }
  }

  setKeepOuts(looks: readonly KeepOutLook[], selected: string | null): void {
    this.keepOuts.show(looks, selected);
  }

  setNetwork(network: PathNetwork | null, show: boolean, focus: string | null): void {
    const source = this.networkLayer.getSource() as VectorSource;
    source.clear();
    if (network === null || !show) return;
    const near = new Set(network.nodes.filter((node) => focus !== null && node.target_id === focus).map((node) => node.id));
    for (const { path, loss, start, end } of drivesOf(network, focus)) {
      const feature = new Feature(new LineString(path));
      // With a target in focus its own drives stand out; the others would hide the ground.
      const own = near.has(start) || near.has(end);
      const faint = focus !== null && !own;
      const line = new Style({
        stroke: new Stroke({ color: lossColour(loss, faint ? 0.3 : 1), width: own ? 2.2 : 1.2, lineDash: [4, 4] }),
      });
      feature.setStyle((_feature, resolution) => {
        const geometry = feature.getGeometry() as LineString;
        // Numbers only where the drive is long enough to carry one.
        if (loss <= 0.005 || !own || geometry.getLength() / resolution < 60) return line;
        const middle = new Style({
          geometry: new PointGeometry(geometry.getCoordinateAt(0.5)),
          text: words(loss < 0.01 ? "<1 %" : `${Math.round(100 * loss)} %`, "#ffe0c8"),
        });
        return [line, middle];
      });
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

  /** What people say of drives: paths that they drew, and drives that they forbade. */
  setRules(looks: readonly RuleLook[]): void {
    const source = this.ruleLayer.getSource() as VectorSource;
    source.clear();
    for (const { path, forbidden } of looks) {
      const feature = new Feature(new LineString(path));
      const line = new Style({ stroke: new Stroke({ color: forbidden ? COLORS.keepOut : "#ffffff", width: 2, lineDash: forbidden ? [2, 6] : undefined }) });
      const cross = new Style({
        geometry: new PointGeometry((feature.getGeometry() as LineString).getCoordinateAt(0.5)),
        image: new RegularShape({ points: 4, radius: 7, radius2: 0, angle: Math.PI / 4, stroke: new Stroke({ color: COLORS.keepOut, width: 2.5 }) }),
      });
      feature.setStyle(forbidden ? [line, cross] : [new Style({ stroke: new Stroke({ color: "rgba(6,10,14,0.7)", width: 4.5 }) }), line]);
      source.addFeature(feature);
    }
    this.element.dataset.rules = looks.map((look) => (look.forbidden ? "forbidden" : `${look.path.length}`)).join(",");
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

  setTargets(looks: readonly TargetLook[], eye: Pose | null, shape: RoverShape | null): void {
    const source = this.targetLayer.getSource() as VectorSource;
    const cones = this.coneLayer.getSource() as VectorSource;
    source.clear();
    cones.clear();
    this.looks = looks;
    this.element.dataset.others = looks.flatMap((look) => (look.others === "" ? [] : [`${look.target.name} ${look.others}`])).join(", ");
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
      if (eye !== null && shape !== null && look.requests.some((request) => request.tracked)) {
        const cone = new Feature(new Polygon([closed(trackingCone(place, [eye.east_m, eye.north_m], shape.cone_half_angle_rad))]));
        cone.setStyle(
          new Style({
            fill: new Fill({ color: "rgba(120,210,255,0.12)" }),
            stroke: new Stroke({ color: "rgba(120,210,255,0.55)", width: 1, lineDash: [3, 4] }),
          }),
        );
        cones.addFeature(cone);
      }
    }
  }

  /** The observation point of the selected target: its body moves it, the knob before its nose turns it. */
  setStand(look: StandLook | null, shape: RoverShape | null): void {
    const source = this.standLayer.getSource() as VectorSource;
    source.clear();
    this.stand = look;
    this.shape = shape;
    if (look === null || shape === null) return;
    const { pose, target, verdict } = look;
    const color = verdict === null ? COLORS.select : verdict ? COLORS.reached : COLORS.refused;
    const add = (feature: Feature, style: Style, part: string | null): void => {
      feature.setStyle(style);
      if (part !== null) feature.setProperties({ part, request: look.request });
      source.addFeature(feature);
    };
    const stroke = new Stroke({ color, width: 1.6 });
    add(
      new Feature(new Polygon([closed(reachSector(pose, shape))])),
      new Style({ stroke: new Stroke({ color, width: 1, lineDash: [3, 3] }), fill: new Fill({ color: `${color}1f` }) }),
      null,
    );
    const place: Point = [target.position.east_m, target.position.north_m];
    add(new Feature(new LineString([[pose.east_m, pose.north_m], place])), new Style({ stroke: new Stroke({ color, width: 1.2, lineDash: [3, 3] }) }), null);
    const body = outline(pose.east_m, pose.north_m, pose.heading_rad, shape.length_m, shape.width_m);
    add(new Feature(new Polygon([closed(body)])), new Style({ stroke, fill: new Fill({ color: `${color}4d` }) }), "body");
    add(
      new Feature(new PointGeometry(knobOf(pose, shape))),
      new Style({ image: new CircleStyle({ radius: 4.5, fill: new Fill({ color: "#10161a" }), stroke }) }),
      "nose",
    );
  }

  /** Where the rover may be at a moment: the larger and whiter, the likelier; a ring for what dead reckoning adds. */
  setSpread(spots: readonly Spot[], ring: { at: Point; radius: number } | null): void {
    const source = this.spreadLayer.getSource() as VectorSource;
    source.clear();
    const most = Math.max(1e-9, ...spots.map((spot) => spot.p));
    for (const spot of spots) {
      const feature = new Feature(new PointGeometry(spot.at));
      const strong = Math.sqrt(spot.p / most);
      feature.setStyle(
        new Style({
          image: new CircleStyle({
            radius: 3 + 5 * strong,
            fill: new Fill({ color: `#ffffff${hex(0.2 + 0.75 * strong)}` }),
            stroke: new Stroke({ color: lineColor(spot.depth), width: 2 }),
          }),
          text: spot.p >= 0.12 ? words(`${Math.round(100 * spot.p)} %`, "#ffffff", [0, -14]) : undefined,
        }),
      );
      source.addFeature(feature);
    }
    if (ring === null || ring.radius <= 0) return;
    const circle = ellipse(ring.at, [[ring.radius ** 2, 0], [0, ring.radius ** 2]], 2);
    const feature = new Feature(new Polygon([closed(circle)]));
    feature.setStyle(new Style({ stroke: new Stroke({ color: "#ffffff", width: 1.4, lineDash: [5, 4] }), fill: new Fill({ color: "rgba(255,255,255,0.08)" }) }));
    source.addFeature(feature);
  }

  // ---- the keyboard's pointer

  private get resolution(): number {
    return this.map.getView().getResolution() ?? 0.05;
  }

  /** Show or move the crosshair, pixels of the screen; it begins in the middle of the view. What is held goes along. */
  nudgeCross(right: number, up: number): void {
    const [x, y] = this.cross ?? ((this.map.getView().getCenter() ?? [0, 0]) as Point);
    this.cross = [x + right * this.resolution, y + up * this.resolution];
    if (this.keepOuts.holds) this.keepOuts.carry(this.cross);
    else if (this.standHeld !== null) this.events.standMoved(...this.cross, this.standHeld === "nose");
    this.center(...this.cross);
    this.showCross();
  }

  hideCross(): void {
    this.putBack();
    this.cross = null;
    this.showCross();
  }

  get hasCross(): boolean {
    return this.cross !== null;
  }

  get holds(): boolean {
    return this.keepOuts.holds || this.standHeld !== null;
  }

  /** Take hold of what lies under the crosshair, else of what is selected: a keep-out or where the rover is to stand. */
  grab(): boolean {
    if (this.mode !== "select" || this.holds) return false;
    const at = this.cross;
    const { stand, shape } = this;
    if (at !== null && this.keepOuts.grab(at)) {
      // A keep-out lies under the crosshair.
    } else if (stand !== null && shape !== null) {
      const { east_m, north_m, heading_rad } = stand.pose;
      const knob = knobOf(stand.pose, shape);
      const nose = at !== null && Math.hypot(at[0] - knob[0], at[1] - knob[1]) < 10 * this.resolution;
      const body = at !== null && inside(at, outline(east_m, north_m, heading_rad, shape.length_m, shape.width_m));
      if (nose || body || this.keepOuts.grabChosen() === null) {
        this.standHeld = nose ? "nose" : "body";
        this.cross = nose ? knob : [east_m, north_m];
        this.events.standTaken(stand.request);
      }
    } else this.cross = this.keepOuts.grabChosen() ?? at;
    this.showCross();
    return this.holds;
  }

  /** Drop what the crosshair holds. */
  letGo(): void {
    this.keepOuts.drop();
    if (this.standHeld !== null) this.events.standDropped();
    this.standHeld = null;
    this.showCross();
  }

  /** Leave it where it was. */
  putBack(): void {
    this.keepOuts.putBack();
    if (this.standHeld !== null) this.events.standPutBack();
    this.standHeld = null;
    this.showCross();
  }

  /** Do at the crosshair what a click would do there; `last` ends an outline. */
  pressCross(last: boolean): void {
    const at = this.cross;
    if (at === null) return;
    if (this.holds) {
      this.letGo();
      return;
    }
    if (this.draw !== null) {
      if (last) this.draw.finishDrawing();
      else this.addCorner(at);
      return;
    }
    const pixel = this.map.getPixelFromCoordinate(at);
    if (pixel !== null) this.clicked(pixel, at);
  }

  private addCorner(at: Point): void {
    const { draw } = this;
    if (draw === null) return;
    draw.appendCoordinates([this.mode === "keep-out" ? this.keepOuts.snapTo(at) : at]);
    this.corners += 1;
    // A measurement has two ends; the pointer's second click ends it by itself.
    if (this.mode === "measure" && this.corners === 2) draw.finishDrawing();
  }

  private showCross(): void {
    const source = this.crossLayer.getSource() as VectorSource;
    source.clear();
    // While an outline is drawn it stands where the corner would be.
    const at = this.cross !== null && this.mode === "keep-out" ? this.keepOuts.snapTo(this.cross) : this.cross;
    this.element.dataset.cross = at === null ? "" : at.map((v) => v.toFixed(4)).join(",");
    this.element.dataset.aim = this.cross === null ? "" : this.cross.map((v) => v.toFixed(4)).join(",");
    this.element.dataset.held = String(this.holds);
    if (at === null) {
      this.events.hovered(null, null);
      return;
    }
    this.events.hovered(at[0], at[1]);
    const feature = new Feature(new PointGeometry(at));
    const mark = (color: string, width: number): Style =>
      new Style({ image: new RegularShape({ points: 4, radius: 14, radius2: 0, stroke: new Stroke({ color, width }) }) });
    feature.setStyle([mark("rgba(6,10,14,0.85)", 4.5), mark("#ffffff", 1.8)]);
    source.addFeature(feature);
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
          text: words(labelText(look), look.selected ? COLORS.select : "#ffffff", placed),
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
    this.corners = 0;
    this.putBack();
    this.keepOuts.setActive(mode === "select");
    this.element.style.cursor = mode === "select" ? "" : "crosshair";
    if (mode !== "keep-out" && mode !== "measure" && mode !== "way") return;
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
    this.draw.on("drawend", () => (this.corners = 0));
    this.draw.on("drawstart", () => (this.scratch.getSource() as VectorSource).clear());
    this.draw.on("drawend", (event) => {
      const geometry = event.feature.getGeometry();
      if (geometry instanceof Polygon) {
        this.events.drawn((geometry.getCoordinates()[0] as Point[]).slice(0, -1));
        (this.scratch.getSource() as VectorSource).once("addfeature", () => (this.scratch.getSource() as VectorSource).clear());
      } else if (geometry instanceof LineString) {
        event.feature.setStyle(new Style({ stroke: new Stroke({ color: "#ffffff", width: 2 }) }));
        const points = geometry.getCoordinates() as Point[];
        if (mode === "way") this.events.wayDrawn(points);
        else this.events.measured(points);
      }
    });
    this.map.addInteraction(this.draw);
    // What was added last hears of the pointer first: snapping comes before drawing.
    this.map.removeInteraction(this.keepOuts.snap);
    this.map.addInteraction(this.keepOuts.snap);
  }

  /** Take the last corner of an outline back, or remove the corner that is held. */
  undoCorner(): void {
    if (this.keepOuts.holds) {
      this.keepOuts.removeCorner();
      this.showCross();
    } else if (this.draw !== null) {
      this.draw.removeLastPoint();
      this.corners = Math.max(0, this.corners - 1);
    }
  }

  resize(): void {
    this.map.updateSize();
  }

  dispose(): void {
    this.map.setTarget(undefined);
    this.map.dispose();
  }
}

/** The knob before the nose of the rover, by which it is turned. */
const knobOf = (pose: Pose, shape: RoverShape): Point => {
  const far = shape.length_m / 2 + 0.45;
  return [pose.east_m + far * Math.cos(pose.heading_rad), pose.north_m + far * Math.sin(pose.heading_rad)];
};

const hex = (opacity: number): string =>
  Math.round(255 * Math.max(0, Math.min(1, opacity)))
    .toString(16)
    .padStart(2, "0");
