/** The scene through a camera of the rover: the very model the rover has, lens and all. */

import {
  BufferGeometry,
  Float32BufferAttribute,
  Matrix4,
  Mesh,
  MeshBasicMaterial,
  OrthographicCamera,
  PerspectiveCamera,
  Scene,
  Vector3,
  type WebGLRenderer,
  WebGLRenderTarget,
} from "three";
import { backProject, type CameraModel, clipMatrix, cross, isLinear, project, unit, vector, type Vector, type Warp, warp } from "../lib/camera";

const NEAR_M = 0.05;
const FAR_M = 1200;
const LARGEST_PX = 2400;

const inScene = ([e, n, u]: Vector): Vector3 => new Vector3(e, u, -n);
/** Site coordinates of a place in the scene. */
const SITE_FROM_SCENE = new Matrix4().set(1, 0, 0, 0, 0, 0, -1, 0, 0, 1, 0, 0, 0, 0, 0, 1);

/** Largest rectangle of the picture's shape in a box, CSS pixels. */
export function fitted(picture: { width: number; height: number }, width: number, height: number): { left: number; top: number; width: number; height: number } {
  const scale = Math.min(width / picture.width, height / picture.height);
  const [w, h] = [picture.width * scale, picture.height * scale];
  return { left: (width - w) / 2, top: (height - h) / 2, width: w, height: h };
}

export class Lens {
  readonly camera = new PerspectiveCamera();
  private readonly bent: Warp | null;
  private readonly linear: CameraModel;
  private readonly target: WebGLRenderTarget | null = null;
  private readonly stage = new Scene();
  private readonly front = new OrthographicCamera(-1, 1, 1, -1, -1, 1);

  constructor(readonly model: CameraModel) {
    this.bent = isLinear(model) ? null : warp(model);
    this.linear = this.bent?.linear ?? model;
    const axis = vector(this.linear.A);
    const right = unit(cross(axis, cross(vector(this.linear.H), axis)));
    const up = cross(right, axis);
    this.camera.matrixAutoUpdate = false;
    this.camera.matrix
      .makeBasis(inScene(right), inScene(up), inScene(axis).negate())
      .setPosition(inScene(vector(this.linear.C)));
    this.camera.matrixWorld.copy(this.camera.matrix);
    this.camera.matrixWorldInverse.copy(this.camera.matrix).invert();
    const rows = clipMatrix(this.linear, NEAR_M, FAR_M).flat() as Parameters<Matrix4["set"]>;
    const clip = new Matrix4().set(...rows);
    this.camera.projectionMatrix.copy(clip).multiply(SITE_FROM_SCENE).multiply(this.camera.matrixWorld);
    this.camera.projectionMatrixInverse.copy(this.camera.projectionMatrix).invert();
    if (this.bent !== null) {
      const share = Math.min(1, LARGEST_PX / Math.max(this.linear.width, this.linear.height));
      this.target = new WebGLRenderTarget(Math.ceil(this.linear.width * share), Math.ceil(this.linear.height * share), { samples: 4 });
      this.stage.add(this.sheet(this.bent, this.target));
    }
  }

  /** The picture as a sheet whose nodes are pinned where the lens puts them. */
  private sheet(bent: Warp, target: WebGLRenderTarget): Mesh {
    const { columns, rows, from, linear } = bent;
    const position: number[] = [];
    const uv: number[] = [];
    from.forEach(([x, y], k) => {
      position.push((2 * (k % (columns + 1))) / columns - 1, 1 - (2 * Math.floor(k / (columns + 1))) / rows, 0);
      uv.push((x + 0.5) / linear.width, 1 - (y + 0.5) / linear.height);
    });
    const index: number[] = [];
    for (let r = 0; r < rows; r += 1) {
      for (let c = 0; c < columns; c += 1) {
        const a = r * (columns + 1) + c;
        const b = a + columns + 1;
        index.push(a, b, a + 1, a + 1, b, b + 1);
      }
    }
    const geometry = new BufferGeometry();
    geometry.setAttribute("position", new Float32BufferAttribute(position, 3));
    geometry.setAttribute("uv", new Float32BufferAttribute(uv, 2));
    geometry.setIndex(index);
    return new Mesh(geometry, new MeshBasicMaterial({ map: target.texture }));
  }

  /** Draw the scene into the middle of a box of `width` x `height` CSS pixels, dark around it. */
  render(renderer: WebGLRenderer, scene: Scene, width: number, height: number): void {
    const box = fitted(this.model, width, height);
    if (this.target !== null) {
      renderer.setRenderTarget(this.target);
      renderer.render(scene, this.camera);
      renderer.setRenderTarget(null);
    }
    renderer.setScissorTest(false);
    renderer.setViewport(0, 0, width, height);
    renderer.setClearColor(0x0b0d0e);
    renderer.clear();
    const bottom = height - box.top - box.height;
    renderer.setViewport(box.left, bottom, box.width, box.height);
    renderer.setScissor(box.left, bottom, box.width, box.height);
    renderer.setScissorTest(true);
    renderer.render(this.target === null ? scene : this.stage, this.target === null ? this.camera : this.front);
    renderer.setScissorTest(false);
    renderer.setViewport(0, 0, width, height);
  }

  /** How much wider the picture's angle is than that of a view with the given projection: marks are to look alike. */
  widerThan(view: PerspectiveCamera): number {
    const own = Math.abs(this.camera.projectionMatrix.elements[5] ?? 1);
    return Math.min(2, Math.abs(view.projectionMatrix.elements[5] ?? 1) / Math.max(1e-6, own));
  }

  /** Ray of a place on the screen, scene axes; null outside the picture. `x`, `y` from the box's upper left corner. */
  ray(x: number, y: number, width: number, height: number): { origin: Vector3; direction: Vector3 } | null {
    const box = fitted(this.model, width, height);
    const sample = ((x - box.left) / box.width) * this.model.width - 0.5;
    const line = ((y - box.top) / box.height) * this.model.height - 0.5;
    if (sample < -0.5 || line < -0.5 || sample > this.model.width - 0.5 || line > this.model.height - 0.5) return null;
    const { origin, ray } = backProject(this.model, sample, line);
    return { origin: inScene(origin), direction: inScene(ray) };
  }

  /** Where a point of the site appears, from the box's upper left corner; far outside when it does not. */
  project(point: Vector, width: number, height: number): [number, number] {
    const box = fitted(this.model, width, height);
    const seen = project(this.model, point);
    if (seen === null) return [-1e6, -1e6];
    return [
      box.left + ((seen[0] + 0.5) / this.model.width) * box.width,
      box.top + ((seen[1] + 0.5) / this.model.height) * box.height,
    ];
  }

  dispose(): void {
    this.target?.dispose();
    this.stage.traverse((object) => {
      const mesh = object as Mesh;
      mesh.geometry?.dispose();
      (mesh.material as MeshBasicMaterial | undefined)?.dispose();
    });
  }
}
