/** The 3D view: three.js behind one class. It draws when something changed and never otherwise. */

import {
  AmbientLight,
  ArrowHelper,
  BoxGeometry,
  BufferGeometry,
  CanvasTexture,
  Color,
  CylinderGeometry,
  DirectionalLight,
  DoubleSide,
  Fog,
  Group,
  LinearFilter,
  LineBasicMaterial,
  LineLoop,
  LineSegments,
  type Material,
  Matrix4,
  Mesh,
  MeshBasicMaterial,
  MeshLambertMaterial,
  type Object3D,
  PerspectiveCamera,
  Plane,
  Raycaster,
  Scene,
  SphereGeometry,
  Sprite,
  SpriteMaterial,
  SRGBColorSpace,
  type Texture,
  TextureLoader,
  Vector2,
  Vector3,
  WebGLRenderer,
} from "three";
import { OrbitControls } from "three/addons/controls/OrbitControls.js";
import type { KeepOut, Pose, Target } from "../api/types";
import type { Grid } from "../lib/terrain-image";
import type { Point, Ribbon } from "../map/geometry";
import { trackingCone } from "../map/geometry";
import { groundGeometry, stripGeometry, sunDirection, surface, toScene, wallGeometry } from "./ground";

const CAMERA_HEIGHT_M = 1.5;
const ARM_REACH_M = 0.79;
const COLORS = { main: 0x58d0f5, branch: [0xff9d3c, 0xffc46b, 0xff7a59, 0xf7b0c2], select: 0xffe14d, keepOut: 0xff5d52, track: 0x8ff0a8 };

export interface Layer {
  grid: Grid;
  extent: { west: number; south: number; east: number; north: number };
  ortho: string | null;
}

export interface SceneTarget {
  target: Target;
  selected: boolean;
  color: number;
  products: number;
  stand: Pose | null;
  tracked: boolean;
}

export class SiteScene {
  private readonly renderer: WebGLRenderer;
  private readonly scene = new Scene();
  readonly camera = new PerspectiveCamera(45, 1, 0.05, 1200);
  private readonly controls: OrbitControls;
  private readonly sun = new DirectionalLight(0xfff1dd, 1.5);
  private readonly ground = new Group();
  private readonly targets = new Group();
  private readonly plan = new Group();
  private readonly keepOuts = new Group();
  private readonly track = new Group();
  private readonly measure = new Group();
  private readonly rover = makeRover();
  private up: (east: number, north: number) => number = () => 0;
  private frame = 0;
  private disposed = false;
  /** Frames drawn since the scene was made; a page at rest does not count up. */
  drawn = 0;

  constructor(
    private readonly canvas: HTMLCanvasElement,
    private readonly low: boolean,
    private readonly onDrawn: (count: number) => void,
  ) {
    this.renderer = new WebGLRenderer({ canvas, antialias: !low, powerPreference: "high-performance", preserveDrawingBuffer: low });
    this.renderer.setPixelRatio(low ? 0.5 : Math.min(2, devicePixelRatio));
    this.scene.background = new Color(0xc9ab8d);
    this.scene.fog = new Fog(0xc9ab8d, 90, 260);
    this.scene.add(new AmbientLight(0xffe7cf, 1.7), this.sun);
    this.scene.add(this.ground, this.targets, this.plan, this.keepOuts, this.track, this.measure, this.rover);
    this.camera.position.set(-9, 12, 17);
    this.controls = new OrbitControls(this.camera, canvas);
    this.controls.maxPolarAngle = Math.PI * 0.495;
    this.controls.minDistance = 0.6;
    this.controls.maxDistance = 160;
    this.controls.zoomToCursor = true;
    this.controls.addEventListener("change", () => this.invalidate());
    this.setSun(10);
  }

  /** Ask for one frame. */
  invalidate(): void {
    if (this.frame !== 0 || this.disposed) return;
    this.frame = requestAnimationFrame(() => {
      this.frame = 0;
      if (this.disposed) return;
      this.keepAbove();
      this.renderer.render(this.scene, this.camera);
      this.drawn += 1;
      this.onDrawn(this.drawn);
    });
  }

  resize(width: number, height: number): void {
    if (width === 0 || height === 0) return;
    this.renderer.setSize(width, height, false);
    this.camera.aspect = width / height;
    this.camera.updateProjectionMatrix();
    this.invalidate();
  }

  private keepAbove(): void {
    const floor = this.up(this.camera.position.x, -this.camera.position.z) + 0.3;
    if (this.camera.position.y < floor) this.camera.position.y = floor;
  }

  /** Show the ground, finest layer first. */
  setGround(layers: readonly Layer[]): void {
    clear(this.ground);
    this.up = surface(layers.map((layer) => layer.grid));
    layers.forEach((layer, k) => {
      const finer = layers[k - 1];
      const geometry = groundGeometry(layer.grid, layer.extent, finer?.extent ?? null);
      const material = new MeshLambertMaterial({ color: layer.ortho === null ? 0xb08a68 : 0xffffff });
      if (layer.ortho !== null) {
        new TextureLoader().load(layer.ortho, (texture: Texture) => {
          texture.colorSpace = SRGBColorSpace;
          texture.anisotropy = this.low ? 1 : Math.min(8, this.renderer.capabilities.getMaxAnisotropy());
          material.map = texture;
          material.needsUpdate = true;
          this.invalidate();
        });
      }
      const mesh = new Mesh(geometry, material);
      if (k > 0) mesh.position.y = -0.02;
      this.ground.add(mesh);
    });
    this.controls.target.copy(toScene(0, 0, this.up(0, 0)));
    this.controls.update();
    this.invalidate();
  }

  /** Light the ground as at a local mean solar time, hours. */
  setSun(lmst: number): void {
    const direction = sunDirection(lmst);
    this.sun.position.copy(direction.multiplyScalar(100));
    this.invalidate();
  }

  setTargets(list: readonly SceneTarget[], eye: Pose | null): void {
    clear(this.targets);
    for (const item of list) {
      const { target } = item;
      const p = target.position;
      const place = toScene(p.east_m, p.north_m, p.up_m);
      const normal = toScene(target.normal[0] ?? 0, target.normal[1] ?? 0, target.normal[2] ?? 1).normalize();
      const dot = new Sprite(new SpriteMaterial({ map: discTexture(item.selected ? COLORS.select : item.color), sizeAttenuation: false, depthTest: false }));
      dot.scale.setScalar(item.selected ? 0.026 : 0.019);
      dot.position.copy(place);
      dot.renderOrder = 10;
      this.targets.add(dot);
      const arrow = new ArrowHelper(normal, place, item.selected ? 0.7 : 0.4, item.selected ? COLORS.select : 0xffffff, 0.12, 0.07);
      this.targets.add(arrow);
      if (list.length <= 60 || item.selected) {
        const label = new Sprite(new SpriteMaterial({ map: labelTexture(target.name + (item.products > 0 ? `  ▣ ${item.products}` : ""), item.selected), sizeAttenuation: false, depthTest: false }));
        label.center.set(-0.04, 0.5);
        label.scale.set(0.2, 0.025, 1);
        label.position.copy(place);
        label.renderOrder = 11;
        this.targets.add(label);
      }
      if (!item.selected) continue;
      this.targets.add(ellipsoid(place, target.covariance_m2));
      if (item.stand !== null) {
        const ghost = makeRover(0.35);
        this.pose(ghost, item.stand);
        this.targets.add(ghost);
        const reach = circle(ARM_REACH_M + 0.5);
        reach.position.copy(ghost.position).y += 0.06;
        this.targets.add(reach);
      }
      if (eye !== null && item.tracked) {
        const cone = trackingCone([p.east_m, p.north_m], [eye.east_m, eye.north_m], 0.35);
        const points = [...cone, cone[0] as Point].flatMap((a, k, all) => {
          const b = all[k + 1];
          return b === undefined ? [] : [a, b].map(([e, n]) => toScene(e, n, this.up(e, n) + 0.08));
        });
        this.targets.add(new LineSegments(new BufferGeometry().setFromPoints(points), new LineBasicMaterial({ color: 0x8fd8ff, transparent: true, opacity: 0.8 })));
      }
    }
    this.invalidate();
  }

  setKeepOuts(list: readonly KeepOut[], selected: string | null): void {
    clear(this.keepOuts);
    for (const keepOut of list) {
      const ring = keepOut.polygon_m.map((p): Point => [p[0] ?? 0, p[1] ?? 0]);
      const color = keepOut.id === selected ? COLORS.select : COLORS.keepOut;
      const wall = new Mesh(
        wallGeometry(ring, 0.5, this.up),
        new MeshBasicMaterial({ color, transparent: true, opacity: 0.38, side: DoubleSide, depthWrite: false }),
      );
      this.keepOuts.add(wall);
    }
    this.invalidate();
  }

  setRibbons(ribbons: readonly Ribbon[], focus: string | null): void {
    clear(this.plan);
    for (const ribbon of ribbons) {
      const color = ribbon.depth === 0 ? COLORS.main : (COLORS.branch[(ribbon.depth - 1) % COLORS.branch.length] ?? COLORS.main);
      const dim = focus !== null && focus !== ribbon.line;
      const mesh = new Mesh(
        stripGeometry(ribbon.path, 0.08 + 0.3 * ribbon.p, 0.09 - 0.01 * Math.min(4, ribbon.depth), this.up),
        new MeshBasicMaterial({ color, transparent: true, opacity: dim ? 0.25 : 0.85, side: DoubleSide, depthWrite: false, polygonOffset: true, polygonOffsetFactor: -2 }),
      );
      mesh.renderOrder = 5 - ribbon.depth;
      this.plan.add(mesh);
    }
    this.invalidate();
  }

  setTrack(points: readonly Point[]): void {
    clear(this.track);
    if (points.length > 1) {
      this.track.add(
        new Mesh(stripGeometry(points, 0.07, 0.12, this.up), new MeshBasicMaterial({ color: COLORS.track, side: DoubleSide })),
      );
    }
    this.invalidate();
  }

  setMeasure(points: readonly Point[]): void {
    clear(this.measure);
    const [a, b] = points;
    if (a !== undefined && b !== undefined) {
      const ends = [a, b].map(([e, n]) => toScene(e, n, this.up(e, n) + 0.1));
      this.measure.add(new LineSegments(new BufferGeometry().setFromPoints(ends), new LineBasicMaterial({ color: 0xffffff, depthTest: false })));
    }
    this.invalidate();
  }

  setRover(pose: Pose | null): void {
    this.rover.visible = pose !== null;
    if (pose !== null) this.pose(this.rover, pose);
    this.invalidate();
  }

  /** Stand a body on the ground: height and tilt from four points under it. */
  private pose(body: Object3D, pose: Pose): void {
    const { east_m: e, north_m: n, heading_rad: h } = pose;
    const [c, s] = [Math.cos(h), Math.sin(h)];
    const foot = (forward: number, left: number): Vector3 => {
      const [x, y] = [e + forward * c - left * s, n + forward * s + left * c];
      return toScene(x, y, this.up(x, y));
    };
    const forward = foot(0.4, 0).sub(foot(-0.4, 0)).normalize();
    const left = foot(0, 0.35).sub(foot(0, -0.35)).normalize();
    const up = new Vector3().crossVectors(forward, left).normalize();
    if (up.y < 0) up.negate();
    const right = new Vector3().crossVectors(forward, up).normalize();
    body.matrixAutoUpdate = true;
    body.quaternion.setFromRotationMatrix(new Matrix4().makeBasis(forward, up, right));
    body.position.copy(toScene(e, n, this.up(e, n)));
  }

  /** Look from the rover's mast along its heading. */
  viewFromRover(pose: Pose): void {
    const eye = toScene(pose.east_m, pose.north_m, this.up(pose.east_m, pose.north_m) + CAMERA_HEIGHT_M);
    this.camera.position.copy(eye);
    this.controls.target.copy(eye).add(new Vector3(Math.cos(pose.heading_rad) * 3, -0.6, -Math.sin(pose.heading_rad) * 3));
    this.controls.update();
    this.invalidate();
  }

  overview(): void {
    this.camera.position.set(-9, 12 + this.up(0, 0), 17);
    this.controls.target.copy(toScene(0, 0, this.up(0, 0)));
    this.controls.update();
    this.invalidate();
  }

  /** Turn to a target unless it is well in view and near. */
  lookAtIfHidden(target: Target): void {
    const { east_m, north_m, up_m } = target.position;
    const place = toScene(east_m, north_m, up_m);
    const seen = place.clone().project(this.camera);
    const inside = Math.abs(seen.x) < 0.85 && Math.abs(seen.y) < 0.85 && seen.z < 1;
    if (!inside || place.distanceTo(this.camera.position) > 40) this.lookAt(target);
  }

  private lookAt(target: Target): void {
    const place = toScene(target.position.east_m, target.position.north_m, target.position.up_m);
    const away = this.camera.position.clone().sub(this.controls.target);
    if (away.length() > 14) away.setLength(14);
    this.controls.target.copy(place);
    this.camera.position.copy(place).add(away);
    this.controls.update();
    this.invalidate();
  }

  private ray(x: number, y: number): Raycaster {
    const box = this.canvas.getBoundingClientRect();
    const caster = new Raycaster();
    caster.setFromCamera(new Vector2((2 * (x - box.left)) / box.width - 1, 1 - (2 * (y - box.top)) / box.height), this.camera);
    return caster;
  }

  /** First guess of the ground under a place on the screen, from the displayed surface. */
  guess(x: number, y: number): { east: number; north: number; up: number } | null {
    const hit = this.ray(x, y).intersectObjects(this.ground.children, false)[0];
    return hit === undefined ? null : { east: hit.point.x, north: -hit.point.z, up: hit.point.y };
  }

  /** Where the ray through a place on the screen meets the level `up`; null when it never does. */
  atLevel(x: number, y: number, up: number): { east: number; north: number } | null {
    const point = this.ray(x, y).ray.intersectPlane(new Plane(new Vector3(0, 1, 0), -up), new Vector3());
    return point === null ? null : { east: point.x, north: -point.z };
  }

  /** Where a point of the site appears on the screen, CSS pixels of the page. */
  project(east: number, north: number, up: number): [number, number] {
    const box = this.canvas.getBoundingClientRect();
    const p = toScene(east, north, up).project(this.camera);
    return [box.left + ((p.x + 1) / 2) * box.width, box.top + ((1 - p.y) / 2) * box.height];
  }

  dispose(): void {
    this.disposed = true;
    cancelAnimationFrame(this.frame);
    for (const group of [this.ground, this.targets, this.plan, this.keepOuts, this.track, this.measure]) clear(group);
    this.controls.dispose();
    this.renderer.dispose();
  }
}

function clear(group: Group): void {
  for (const child of [...group.children]) {
    group.remove(child);
    child.traverse((object) => {
      const mesh = object as Mesh;
      mesh.geometry?.dispose();
      const material = mesh.material as (Material & { map?: Texture | null }) | undefined;
      if (material !== undefined && !Array.isArray(material)) {
        if (!(object instanceof Sprite)) material.map?.dispose();
        material.dispose();
      }
    });
  }
}

function circle(radius: number): LineLoop {
  const points = Array.from({ length: 64 }, (_, k) => new Vector3(radius * Math.cos((k * Math.PI) / 32), 0, radius * Math.sin((k * Math.PI) / 32)));
  return new LineLoop(new BufferGeometry().setFromPoints(points), new LineBasicMaterial({ color: 0xffe14d, transparent: true, opacity: 0.8, depthTest: false }));
}

/** Three standard deviations of a position, to scale. */
function ellipsoid(place: Vector3, covariance: readonly (readonly number[])[]): Mesh {
  const m = (r: number, c: number): number => covariance[r]?.[c] ?? 0;
  // Cholesky factor of the covariance: it maps the unit sphere onto the ellipsoid of one standard deviation.
  const l00 = Math.sqrt(Math.max(1e-12, m(0, 0)));
  const l10 = m(1, 0) / l00;
  const l11 = Math.sqrt(Math.max(1e-12, m(1, 1) - l10 * l10));
  const l20 = m(2, 0) / l00;
  const l21 = (m(2, 1) - l20 * l10) / l11;
  const l22 = Math.sqrt(Math.max(1e-12, m(2, 2) - l20 * l20 - l21 * l21));
  const sphere = new SphereGeometry(3, 24, 16);
  const position = sphere.getAttribute("position");
  for (let k = 0; k < position.count; k += 1) {
    const [x, y, z] = [position.getX(k), position.getY(k), position.getZ(k)];
    const [e, n, u] = [l00 * x, l10 * x + l11 * y, l20 * x + l21 * y + l22 * z];
    position.setXYZ(k, e, u, -n);
  }
  const mesh = new Mesh(sphere, new MeshBasicMaterial({ color: 0xffe14d, transparent: true, opacity: 0.4, depthTest: false }));
  mesh.position.copy(place);
  return mesh;
}

/** A rover of about the K9's size: x forward, y up, z right. */
function makeRover(opacity = 1): Group {
  const group = new Group();
  const material = (color: number): MeshLambertMaterial =>
    new MeshLambertMaterial({ color, transparent: opacity < 1, opacity, depthWrite: opacity >= 1 });
  const box = (w: number, h: number, d: number, color: number, x: number, y: number, z: number): Mesh => {
    const mesh = new Mesh(new BoxGeometry(w, h, d), material(color));
    mesh.position.set(x, y, z);
    group.add(mesh);
    return mesh;
  };
  box(0.8, 0.18, 0.52, 0xe8e6e0, 0, 0.42, 0);
  box(0.78, 0.02, 0.84, 0x24324a, -0.04, 0.54, 0);
  for (const z of [-0.38, 0.38]) {
    box(0.95, 0.05, 0.05, 0x8c8f94, 0, 0.27, z * 0.9);
    for (const x of [-0.42, 0, 0.42]) {
      const wheel = new Mesh(new CylinderGeometry(0.12, 0.12, 0.13, 18), material(0x2c2e31));
      wheel.rotation.x = Math.PI / 2;
      wheel.position.set(x, 0.12, z);
      group.add(wheel);
    }
  }
  box(0.06, 0.9, 0.06, 0xc8c9cc, 0.28, 0.95, 0.12);
  box(0.12, 0.1, 0.34, 0x3a3d42, 0.3, 1.44, 0.12);
  box(0.3, 0.05, 0.05, 0xd9713c, 0.52, 0.42, -0.16);
  box(0.05, 0.05, 0.05, 0xd9713c, 0.66, 0.36, -0.16);
  return group;
}

const discs = new Map<number, CanvasTexture>();

function discTexture(color: number): CanvasTexture {
  const known = discs.get(color);
  if (known !== undefined) return known;
  const canvas = document.createElement("canvas");
  canvas.width = canvas.height = 64;
  const g = canvas.getContext("2d");
  if (g !== null) {
    g.beginPath();
    g.arc(32, 32, 24, 0, 2 * Math.PI);
    g.fillStyle = `#${color.toString(16).padStart(6, "0")}`;
    g.fill();
    g.lineWidth = 6;
    g.strokeStyle = "#10161a";
    g.stroke();
  }
  const texture = new CanvasTexture(canvas);
  texture.colorSpace = SRGBColorSpace;
  discs.set(color, texture);
  return texture;
}

const labels = new Map<string, CanvasTexture>();

function labelTexture(text: string, selected: boolean): CanvasTexture {
  const key = `${text}|${selected}`;
  const known = labels.get(key);
  if (known !== undefined) return known;
  if (labels.size > 600) {
    for (const texture of labels.values()) texture.dispose();
    labels.clear();
  }
  const canvas = document.createElement("canvas");
  canvas.width = 512;
  canvas.height = 64;
  const g = canvas.getContext("2d");
  if (g !== null) {
    g.font = '600 34px system-ui, "DejaVu Sans", sans-serif';
    g.textBaseline = "middle";
    g.lineWidth = 9;
    g.lineJoin = "round";
    g.strokeStyle = "rgba(8,10,12,0.85)";
    const shown = text.length > 26 ? `${text.slice(0, 25)}…` : text;
    g.strokeText(shown, 30, 32);
    g.fillStyle = selected ? "#ffe14d" : "#ffffff";
    g.fillText(shown, 30, 32);
  }
  const texture = new CanvasTexture(canvas);
  texture.colorSpace = SRGBColorSpace;
  texture.minFilter = LinearFilter;
  labels.set(key, texture);
  return texture;
}
