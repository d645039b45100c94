/** Small things in the scene: dots, names, error ellipsoids, and how a group is emptied. */

import {
  CanvasTexture,
  type Group,
  LinearFilter,
  type Material,
  Mesh,
  MeshBasicMaterial,
  SphereGeometry,
  Sprite,
  SpriteMaterial,
  SRGBColorSpace,
  type Texture,
  type Vector3,
} from "three";

/** Take everything out of a group and free what it holds on the graphics card. Textures of sprites are shared. */
export function clear(group: Group): void {
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

/** Three standard deviations of a position, to scale. */
export function ellipsoid(place: Vector3, covariance: readonly (readonly number[])[]): Mesh {
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

/** A dot of the same size on the screen at any distance. */
export function dot(place: Vector3, color: number, size: number): Sprite {
  const sprite = new Sprite(new SpriteMaterial({ map: discTexture(color), sizeAttenuation: false, depthTest: false }));
  sprite.scale.setScalar(size);
  sprite.position.copy(place);
  sprite.renderOrder = 10;
  return sprite;
}

/** A name beside a place. */
export function nameSprite(place: Vector3, text: string, selected: boolean): Sprite {
  const sprite = new Sprite(new SpriteMaterial({ map: labelTexture(text, selected), sizeAttenuation: false, depthTest: false }));
  sprite.center.set(-0.04, 0.5);
  sprite.scale.set(0.2, 0.025, 1);
  sprite.position.copy(place);
  sprite.renderOrder = 11;
  return sprite;
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
