/** The 3D view: three.js behind one class. It draws when something changed and never otherwise. */

import {
  AmbientLight,
  ArrowHelper,
  BufferGeometry,
  Color,
  DirectionalLight,
  DoubleSide,
  Fog,
  Group,
  ImageBitmapLoader,
  LineBasicMaterial,
  LineSegments,
  LinearFilter,
  LinearMipmapLinearFilter,
  Matrix4,
  Mesh,
  MeshBasicMaterial,
  MeshLambertMaterial,
  type Object3D,
  PerspectiveCamera,
  Plane,
  Raycaster,
  SRGBColorSpace,
  Scene,
  Sprite,
  Texture,
  Vector2,
  Vector3,
  WebGLRenderer,
} from "three";
import { OrbitControls } from "three/addons/controls/OrbitControls.js";
import type { Pose, RoverShape, Target } from "../api/types";
import type { CameraModel, Vector } from "../lib/camera";
import type { Grid } from "../lib/terrain-image";
import type { Point, Ribbon } from "../map/geometry";
import { Drape, NOTHING, type Painting } from "./drape";
import { type Extent, groundGeometry, stripGeometry, surface, toScene, wallGeometry } from "./ground";
import { Lens } from "./lens";
import { clear, dot, ellipsoid, nameSprite } from "./marks";
import { Pace } from "./pace";
import { frustum, makeRover, mounted, type Tint } from "./rover-body";

const COLORS = { main: 0x58d0f5, branch: [0xff9d3c, 0xffc46b, 0xff7a59, 0xf7b0c2], select: 0xffe14d, keepOut: 0xff5d52, track: 0x8ff0a8 };
const SKY = new Color(0xc9ab8d);
const NIGHT = new Color(0x1b1613);
const FRUSTUM_M = 2.5;
const NAMED = 60;
/** Of the page's pixels each way, while the view is turned and the machine is slow; a little more than half. */
const HALF = 0.52;
/** After the last movement, until all is drawn again. */
const REST_MS = 200;

export interface Layer {
  grid: Grid;
  /** Fewer heights of the same ground, for while the view is turned. */
  coarse: Grid;
  extent: Extent;
  ortho: Texture | null;
}

/** Whether the graphics are computed by the processor, where every sample of a pixel costs. */
function inSoftware(): boolean {
  const gl = document.createElement("canvas").getContext("webgl2");
  const told = gl?.getExtension("WEBGL_debug_renderer_info");
  const name = gl !== null && told != null ? String(gl.getParameter(told.UNMASKED_RENDERER_WEBGL)) : "";
  gl?.getExtension("WEBGL_lose_context")?.loseContext();
  return /swiftshader|llvmpipe|software/i.test(name);
}

export interface SceneTarget {
  target: Target;
  selected: boolean;
  color: number;
  products: number;
}

/** Where the rover is to stand for the selected target; `tint` says whether it may. */
export interface Stand {
  pose: Pose;
  target: Target;
  tint: Tint;
}

export class SiteScene {
  private readonly renderer: WebGLRenderer;
  private readonly scene = new Scene();
  readonly camera = new PerspectiveCamera(45, 1, 0.05, 1200);
  private readonly controls: OrbitControls;
  private readonly sun = new DirectionalLight(0xfff1dd, 1.5);
  private readonly sky = new AmbientLight(0xffe7cf, 1.7);
  private readonly fog = new Fog(SKY.getHex(), 90, 260);
  private readonly ground = new Group();
  private readonly coarse = new Group();
  private readonly software = inSoftware();
  private readonly pace = new Pace(this.software);
  private turning = false;
  private rest: ReturnType<typeof setTimeout> | null = null;
  private readonly drapes: Drape[] = [];
  /** Of the ground's layers. */
  private readonly materials: MeshLambertMaterial[] = [];
  private readonly targets = new Group();
  private readonly stand = new Group();
  private readonly plan = new Group();
  private readonly keepOuts = new Group();
  private readonly track = new Group();
  private readonly measure = new Group();
  private readonly rover = new Group();
  private readonly frusta = new Group();
  private lens: Lens | null = null;
  private up: (east: number, north: number) => number = () => 0;
  private painting: Painting = NOTHING;
  private size: [number, number] = [1, 1];
  private frame = 0;
  private disposed = false;
  /** Frames drawn since the scene was made; a page at rest does not count up. */
  drawn = 0;

  constructor(
    private readonly canvas: HTMLCanvasElement,
    private readonly low: boolean,
    private readonly onDrawn: (count: number) => void,
  ) {
    this.renderer = new WebGLRenderer({ canvas, antialias: !low && !this.software, powerPreference: "high-performance", preserveDrawingBuffer: low });
    this.setEffort();
    this.scene.background = SKY.clone();
    this.scene.fog = this.fog;
    this.scene.add(this.sky, this.sun);
    this.scene.add(this.ground, this.coarse, this.targets, this.stand, this.plan, this.keepOuts, this.track, this.measure, this.rover);
    this.camera.position.set(-9, 12, 17);
    this.controls = new OrbitControls(this.camera, canvas);
    this.controls.maxPolarAngle = Math.PI * 0.495;
    this.controls.minDistance = 0.6;
    this.controls.maxDistance = 160;
    this.controls.zoomToCursor = true;
    this.controls.addEventListener("change", () => this.invalidate());
    this.controls.addEventListener("start", () => this.turn(true));
    this.controls.addEventListener("end", () => this.turn(false));
  }

  /** Less may be drawn while the view is turned; all is drawn again soon after. */
  private turn(turning: boolean): void {
    if (this.rest !== null) clearTimeout(this.rest);
    this.rest = null;
    if (!turning) {
      this.rest = setTimeout(() => {
        this.rest = null;
        this.turning = false;
        this.setEffort();
      }, REST_MS);
      return;
    }
    if (this.turning) return;
    this.turning = true;
    this.pace.begin(performance.now());
    this.setEffort();
  }

  private setEffort(): void {
    const effort = this.turning ? this.pace.effort : 0;
    const full = this.low ? 0.5 : Math.min(2, devicePixelRatio);
    const ratio = effort > 0 && !this.low ? Math.min(full, HALF * devicePixelRatio) : full;
    if (ratio !== this.renderer.getPixelRatio()) this.renderer.setPixelRatio(ratio);
    this.coarse.visible = effort === 2;
    this.ground.visible = effort < 2;
    this.invalidate();
  }

  /** Ask for one frame. */
  invalidate(): void {
    if (this.frame !== 0 || this.disposed) return;
    this.frame = requestAnimationFrame(() => {
      this.frame = 0;
      if (this.disposed) return;
      if (this.turning && this.pace.frame(performance.now())) this.setEffort();
      if (this.lens === null) {
        this.keepAbove();
        this.renderer.render(this.scene, this.camera);
      } else {
        this.lens.render(this.renderer, this.scene, ...this.size);
      }
      this.drawn += 1;
      this.onDrawn(this.drawn);
    });
  }

  resize(width: number, height: number): void {
    if (width === 0 || height === 0) return;
    this.size = [width, height];
    this.renderer.setSize(width, height, false);
    this.camera.aspect = width / height;
    this.camera.updateProjectionMatrix();
    this.invalidate();
  }

  private keepAbove(): void {
    const floor = this.up(this.camera.position.x, -this.camera.position.z) + 0.3;
    if (this.camera.position.y < floor) this.camera.position.y = floor;
  }

  /** Read a picture of the ground. */
  async picture(url: string): Promise<Texture> {
    // Decoded beside the main thread, and standing on its head as textures do.
    const loader = new ImageBitmapLoader().setOptions({ imageOrientation: "flipY", premultiplyAlpha: "none" });
    const texture = new Texture(await loader.loadAsync(url));
    texture.flipY = false;
    texture.needsUpdate = true;
    texture.colorSpace = SRGBColorSpace;
    // A software renderer takes half a second for the mipmaps of a large picture: they come when all is shown.
    if (this.software) {
      texture.generateMipmaps = false;
      texture.minFilter = LinearFilter;
    }
    texture.anisotropy = this.low || this.software ? 1 : Math.min(8, this.renderer.capabilities.getMaxAnisotropy());
    return texture;
  }

  /** Put other pictures onto the ground that is shown. */
  setPictures(orthos: readonly (Texture | null)[]): void {
    this.materials.forEach((material, k) => {
      const ortho = orthos[k] ?? null;
      if (material.map === ortho || ortho === null) return;
      material.map?.dispose();
      material.map = ortho;
    });
    this.invalidate();
  }

  /** Give the pictures of the ground the mipmaps that they were shown without. */
  smooth(): void {
    for (const { map } of this.materials) {
      if (map === null || map.generateMipmaps) continue;
      map.dispose(); // its storage has one level
      map.generateMipmaps = true;
      map.minFilter = LinearMipmapLinearFilter;
      map.needsUpdate = true;
    }
    this.invalidate();
  }

  /** Show the ground, finest layer first, in the place of what was shown; the view stays where it is. */
  setGround(layers: readonly Layer[]): void {
    const first = this.ground.children.length === 0;
    const kept = new Set(layers.map((layer) => layer.ortho));
    for (const child of [...this.ground.children, ...this.coarse.children]) {
      const { material } = child as Mesh<BufferGeometry, MeshLambertMaterial>;
      if (material.map !== null && kept.has(material.map)) material.map = null; // not given up with its mesh
    }
    clear(this.ground);
    clear(this.coarse);
    this.drapes.length = this.materials.length = 0;
    this.up = surface(layers.map((layer) => layer.grid));
    layers.forEach((layer, k) => {
      const hole = layers[k - 1]?.extent ?? null;
      const material = new MeshLambertMaterial({ color: layer.ortho === null ? 0xb08a68 : 0xffffff, map: layer.ortho });
      const geometry = groundGeometry(layer.grid, layer.extent, hole);
      const thin = layer.coarse === layer.grid ? geometry : groundGeometry(layer.coarse, layer.extent, hole);
      const drape = new Drape(geometry, layer.extent, this.low ? 1024 : 2048);
      const meshes = [new Mesh(geometry, material), drape.mesh, new Mesh(thin, material), drape.over(thin)];
      if (k > 0) for (const mesh of meshes) mesh.position.y = -0.02;
      this.drapes.push(drape);
      this.materials.push(material);
      this.ground.add(...meshes.slice(0, 2));
      this.coarse.add(...meshes.slice(2));
    });
    this.paint(this.painting);
    if (first) {
      this.controls.target.copy(toScene(0, 0, this.up(0, 0)));
      this.controls.update();
    }
    this.invalidate();
  }

  /** Lay colours, areas and lines over the ground. */
  paint(painting: Painting): void {
    this.painting = painting;
    for (const drape of this.drapes) drape.paint(painting);
    this.invalidate();
  }

  /** Light the ground from a direction (east, north, up); below the horizon it is night. */
  setSun(direction: Vector): void {
    const [east, north, up] = direction;
    const day = Math.max(0, Math.min(1, (up + 0.05) / 0.25));
    this.sun.position.copy(toScene(east, north, Math.max(0.03, up)).multiplyScalar(100));
    this.sun.intensity = 1.5 * Math.max(0, Math.min(1, up / 0.12));
    this.sky.intensity = 0.35 + 1.35 * day;
    const colour = NIGHT.clone().lerp(SKY, day);
    this.scene.background = colour;
    this.fog.color.copy(colour);
    this.invalidate();
  }

  setTargets(list: readonly SceneTarget[]): void {
    clear(this.targets);
    for (const { target, selected, color, products } of list) {
      const p = target.position;
      const place = toScene(p.east_m, p.north_m, p.up_m);
      const normal = toScene(target.normal[0] ?? 0, target.normal[1] ?? 0, target.normal[2] ?? 1).normalize();
      this.targets.add(dot(place, selected ? COLORS.select : color, selected ? 0.026 : 0.019));
      this.targets.add(new ArrowHelper(normal, place, selected ? 0.7 : 0.4, selected ? COLORS.select : 0xffffff, 0.12, 0.07));
      if (list.length <= NAMED || selected) {
        this.targets.add(nameSprite(place, target.name + (products > 0 ? `  ▣ ${products}` : ""), selected));
      }
      if (selected) this.targets.add(ellipsoid(place, target.covariance_m2));
    }
    this.sizeMarks();
    this.invalidate();
  }

  /** Dots and names keep their size on the screen, whatever the camera's angle. */
  private sizeMarks(): void {
    const wider = this.lens?.widerThan(this.camera) ?? 1;
    for (const group of [this.targets, this.measure]) {
      for (const child of group.children) {
        if (!(child instanceof Sprite)) continue;
        const size = (child.userData.size ??= child.scale.clone()) as Vector3;
        child.scale.copy(size).multiplyScalar(wider);
      }
    }
  }

  /** Show where the rover is to stand; it can be taken hold of. */
  setStand(stand: Stand | null, shape: RoverShape | null): void {
    clear(this.stand);
    if (stand !== null && shape !== null) {
      const ghost = makeRover(shape, 0.6, stand.tint);
      this.place(ghost, stand.pose);
      this.stand.add(ghost);
      // From the arm's shoulder to the target.
      ghost.updateMatrixWorld(true);
      const [x = 0, y = 0, z = 0] = shape.shoulder_m;
      const shoulder = new Vector3(x, z, -y).applyMatrix4(ghost.matrixWorld);
      const { east_m, north_m, up_m } = stand.target.position;
      const color = stand.tint === "refused" ? 0xff6258 : stand.tint === "reached" ? 0x7ee2a0 : COLORS.select;
      this.stand.add(
        new LineSegments(
          new BufferGeometry().setFromPoints([shoulder, toScene(east_m, north_m, up_m)]),
          new LineBasicMaterial({ color, depthTest: false }),
        ),
      );
    }
    this.invalidate();
  }

  /** Whether a place on the screen lies on the rover that shows where to stand. */
  holdsStand(x: number, y: number): boolean {
    const caster = this.caster(x, y);
    return caster !== null && this.stand.children.length > 0 && caster.intersectObjects(this.stand.children, true).some((hit) => hit.object instanceof Mesh);
  }

  /** Low walls round keep-outs; their areas are painted on the ground. */
  setKeepOuts(list: readonly { ring: readonly Point[]; selected: boolean }[]): void {
    clear(this.keepOuts);
    for (const { ring, selected } of list) {
      const color = selected ? COLORS.select : COLORS.keepOut;
      this.keepOuts.add(
        new Mesh(
          wallGeometry(ring, 0.3, this.up),
          new MeshBasicMaterial({ color, transparent: true, opacity: 0.3, side: DoubleSide, depthWrite: false }),
        ),
      );
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
        new MeshBasicMaterial({ color, transparent: true, opacity: dim ? 0.25 : 0.85, side: DoubleSide, depthWrite: false, polygonOffset: true, polygonOffsetFactor: -3 }),
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

  /** Ends of a measured line with their heights; the triangle shows run and rise. */
  setMeasure(ends: readonly { at: Point; up: number | null }[], text: string): void {
    clear(this.measure);
    const places = ends.map(({ at: [e, n], up }) => toScene(e, n, up ?? this.up(e, n)));
    for (const place of places) this.measure.add(dot(place, 0xffffff, 0.014));
    const [a, b] = places;
    if (a !== undefined && b !== undefined) {
      const corner = new Vector3(b.x, a.y, b.z);
      const line = (points: Vector3[], opacity: number): LineSegments => {
        const segments = new LineSegments(new BufferGeometry().setFromPoints(points), new LineBasicMaterial({ color: 0xffffff, depthTest: false, transparent: true, opacity }));
        segments.renderOrder = 9;
        return segments;
      };
      this.measure.add(line([a, b], 1), line([a, corner, corner, b], 0.55));
      this.measure.add(nameSprite(a.clone().lerp(b, 0.5), text, false));
    }
    this.sizeMarks();
    this.invalidate();
  }

  setRover(pose: Pose | null, shape: RoverShape | null): void {
    if (this.rover.children.length === 0 && shape !== null) this.rover.add(makeRover(shape), this.frusta);
    this.rover.visible = pose !== null && shape !== null;
    if (pose !== null) this.place(this.rover, pose);
    this.invalidate();
  }

  /** Show what cameras see; the mast stands at the angles. */
  setFrusta(shape: RoverShape | null, names: readonly string[], pan: number, tilt: number): void {
    clear(this.frusta);
    for (const camera of shape?.cameras ?? []) {
      if (shape === null || !names.includes(camera.name)) continue;
      this.frusta.add(frustum(mounted(shape, camera, pan, tilt), FRUSTUM_M, camera.mount === "mast" ? 0x8fd8ff : 0xffc46b));
    }
    this.invalidate();
  }

  /** Stand a body on the ground: height and tilt from four points under it. */
  private place(body: Object3D, pose: Pose): void {
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
    body.quaternion.setFromRotationMatrix(new Matrix4().makeBasis(forward, up, right));
    body.position.copy(toScene(e, n, this.up(e, n)));
  }

  /** Look through a camera of the rover (site frame); null goes back to the free view. */
  setLens(model: CameraModel | null): void {
    this.lens?.dispose();
    this.lens = model === null ? null : new Lens(model);
    this.controls.enabled = model === null;
    this.sizeMarks();
    this.rover.visible = model === null && this.rover.children.length > 0;
    this.invalidate();
  }

  /** Whether the pointer moves the view; not while something is dragged. */
  hold(held: boolean): void {
    this.controls.enabled = !held && this.lens === null;
  }

  /** Move the view by pixels of the screen. */
  pan(right: number, down: number): void {
    if (this.lens === null && (right !== 0 || down !== 0)) this.controls.pan(right, down);
  }

  /** Turn round what is looked at, radians: to the right, and upward to look from higher. */
  orbit(right: number, upward: number): void {
    if (right !== 0) this.controls.rotateLeft(right);
    if (upward !== 0) this.controls.rotateUp(upward);
  }

  /** Come closer by a factor. */
  zoom(factor: number): void {
    if (this.lens !== null) return;
    const away = this.camera.position.clone().sub(this.controls.target);
    away.setLength(Math.max(this.controls.minDistance, Math.min(this.controls.maxDistance, away.length() / factor)));
    this.camera.position.copy(this.controls.target).add(away);
    this.controls.update();
    this.invalidate();
  }

  /** Level of the displayed ground. */
  level(east: number, north: number): number {
    return this.up(east, north);
  }

  overview(): void {
    this.camera.position.set(-9, 12 + this.up(0, 0), 17);
    this.controls.target.copy(toScene(0, 0, this.up(0, 0)));
    this.controls.update();
    this.invalidate();
  }

  /** Turn to a target unless it is well in view and near. */
  lookAtIfHidden(target: Target): void {
    if (this.lens !== null) return;
    const { east_m, north_m, up_m } = target.position;
    const place = toScene(east_m, north_m, up_m);
    const seen = place.clone().project(this.camera);
    const inside = Math.abs(seen.x) < 0.85 && Math.abs(seen.y) < 0.85 && seen.z < 1;
    if (!inside || place.distanceTo(this.camera.position) > 40) this.lookAt(place);
  }

  private lookAt(place: Vector3): void {
    const away = this.camera.position.clone().sub(this.controls.target);
    if (away.length() > 14) away.setLength(14);
    this.controls.target.copy(place);
    this.camera.position.copy(place).add(away);
    this.controls.update();
    this.invalidate();
  }

  /** The ray through a place on the screen (CSS pixels of the page); null outside the picture of a camera. */
  private caster(x: number, y: number): Raycaster | null {
    const box = this.canvas.getBoundingClientRect();
    const caster = new Raycaster();
    if (this.lens !== null) {
      const ray = this.lens.ray(x - box.left, y - box.top, box.width, box.height);
      if (ray === null) return null;
      caster.set(ray.origin, ray.direction);
      caster.camera = this.lens.camera;
    } else {
      caster.setFromCamera(new Vector2((2 * (x - box.left)) / box.width - 1, 1 - (2 * (y - box.top)) / box.height), this.camera);
    }
    return caster;
  }

  /** First guess of the ground under a place on the screen, from the displayed surface. */
  guess(x: number, y: number): { east: number; north: number; up: number } | null {
    const hit = this.caster(x, y)?.intersectObjects(this.ground.children, false)[0];
    return hit === undefined ? null : { east: hit.point.x, north: -hit.point.z, up: hit.point.y };
  }

  /** Where the ray through a place on the screen meets the level `up`; null when it never does. */
  atLevel(x: number, y: number, up: number): { east: number; north: number } | null {
    const point = this.caster(x, y)?.ray.intersectPlane(new Plane(new Vector3(0, 1, 0), -up), new Vector3()) ?? null;
    return point === null ? null : { east: point.x, north: -point.z };
  }

  /** Where a point of the site appears on the screen, CSS pixels of the page. */
  project(east: number, north: number, up: number): [number, number] {
    const box = this.canvas.getBoundingClientRect();
    if (this.lens !== null) {
      const [x, y] = this.lens.project([east, north, up], box.width, box.height);
      return [box.left + x, box.top + y];
    }
    const p = toScene(east, north, up).project(this.camera);
    return [box.left + ((p.x + 1) / 2) * box.width, box.top + ((1 - p.y) / 2) * box.height];
  }

  dispose(): void {
    this.disposed = true;
    cancelAnimationFrame(this.frame);
    this.lens?.dispose();
    for (const group of [this.ground, this.targets, this.stand, this.plan, this.keepOuts, this.track, this.measure, this.rover]) clear(group);
    this.controls.dispose();
    this.renderer.dispose();
  }
}
