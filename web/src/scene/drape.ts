/** What is painted on the ground: one canvas a layer of terrain, draped over its triangles. */

import { CanvasTexture, type BufferGeometry, LinearFilter, Mesh, MeshBasicMaterial, SRGBColorSpace } from "three";
import { canvasOf, edges, type Raster } from "../lib/overlay";
import type { Point } from "../map/geometry";
import type { Extent } from "./ground";

export interface Area {
  ring: readonly Point[];
  fill: string;
  stroke: string;
  /** Metres. */
  width: number;
}

export interface Painting {
  raster: Raster | null;
  areas: readonly Area[];
  /** Lines on the ground: colour and width in metres. */
  lines: readonly { path: readonly Point[]; stroke: string; width: number }[];
}

export const NOTHING: Painting = { raster: null, areas: [], lines: [] };

const rasters = new WeakMap<Raster, HTMLCanvasElement>();

function rasterCanvas(raster: Raster): HTMLCanvasElement {
  const known = rasters.get(raster) ?? canvasOf(raster);
  rasters.set(raster, known);
  return known;
}

export class Drape {
  readonly mesh: Mesh;
  private readonly canvas = document.createElement("canvas");
  private readonly texture: CanvasTexture;
  private readonly others: Mesh[] = [];

  constructor(
    geometry: BufferGeometry,
    private readonly extent: Extent,
    side: number,
  ) {
    this.canvas.width = this.canvas.height = side;
    this.texture = new CanvasTexture(this.canvas);
    this.texture.colorSpace = SRGBColorSpace;
    this.texture.minFilter = LinearFilter;
    this.texture.generateMipmaps = false;
    this.mesh = new Mesh(
      geometry,
      new MeshBasicMaterial({
        map: this.texture,
        transparent: true,
        depthWrite: false,
        polygonOffset: true,
        polygonOffsetFactor: -2,
        polygonOffsetUnits: -2,
      }),
    );
    this.mesh.visible = false;
    this.mesh.renderOrder = 1;
  }

  /** The same painting over other triangles of the same ground. */
  over(geometry: BufferGeometry): Mesh {
    const mesh = new Mesh(geometry, this.mesh.material);
    mesh.visible = this.mesh.visible;
    mesh.renderOrder = 1;
    this.others.push(mesh);
    return mesh;
  }

  paint({ raster, areas, lines }: Painting): void {
    const g = this.canvas.getContext("2d");
    if (g === null) return;
    const { west, south, east, north } = this.extent;
    const [kx, ky] = [this.canvas.width / (east - west), this.canvas.height / (north - south)];
    g.setTransform(1, 0, 0, 1, 0, 0);
    g.clearRect(0, 0, this.canvas.width, this.canvas.height);
    if (raster !== null) {
      const b = edges(raster);
      g.imageSmoothingEnabled = true;
      g.drawImage(rasterCanvas(raster), (b.west - west) * kx, (north - b.north) * ky, (b.east - b.west) * kx, (b.north - b.south) * ky);
    }
    // From here on in metres, north up.
    g.setTransform(kx, 0, 0, -ky, -west * kx, north * ky);
    g.lineJoin = "round";
    const trace = (path: readonly Point[], closed: boolean): void => {
      g.beginPath();
      path.forEach(([x, y], k) => (k === 0 ? g.moveTo(x, y) : g.lineTo(x, y)));
      if (closed) g.closePath();
    };
    // A line narrower than two pixels of the canvas would break up.
    const finest = 2 / kx;
    for (const area of areas) {
      trace(area.ring, true);
      g.fillStyle = area.fill;
      g.fill();
      g.strokeStyle = area.stroke;
      g.lineWidth = Math.max(finest, area.width);
      g.stroke();
    }
    for (const line of lines) {
      trace(line.path, false);
      g.strokeStyle = line.stroke;
      g.lineWidth = Math.max(finest, line.width);
      g.stroke();
    }
    this.mesh.visible = raster !== null || areas.length > 0 || lines.length > 0;
    for (const other of this.others) other.visible = this.mesh.visible;
    this.texture.needsUpdate = true;
  }
}
