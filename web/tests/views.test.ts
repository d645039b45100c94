import { describe, expect, it } from "vitest";
import { backProject, type CameraModel, cameraOf, clipMatrix, ellipseInImage, isLinear, moved, project, type Vector, warp } from "../src/lib/camera";
import { coverageColour, edges, HIDDEN, slopeRaster, UNKNOWN } from "../src/lib/overlay";
import { axesOf, marksIn } from "../src/lib/image-marks";
import { azimuthOf, directionAt, loadingOrder, named, placeOf, type Strip } from "../src/lib/panorama";
import { linesOf, legsOf, type PlanTree } from "../src/lib/plan-tree";
import { scaleBar } from "../src/lib/scale-bar";
import { terrainProblem } from "../src/lib/terrain-files";
import { alongPath, planEnd, quantile, spotsAt, summary } from "../src/lib/spread";

const none = [0, 0, 0];
// Vectors, pixels and points 5 m down their rays, as the rover's own camera code gives them.
const CAMERAS: [string, CameraModel, [number, number], Vector][] = [
  [
    "CAHV",
    { kind: "CAHV", width: 1024, height: 768, C: [0.02, 0.1, 0], A: [1, 0, 0], H: [511.5, -1123.5, 0], V: [383.5, 0, -1123.5], O: none, R: none, E: none, linearity: 1 },
    [307.2, 614.4],
    [4.84175, 0.9768, -0.99096],
  ],
  [
    "CAHVOR",
    {
      kind: "CAHVOR", width: 1024, height: 1024, C: [0.005639, 0.087625, 0.154192], A: [0.999762, 0.021824, -0.000864],
      H: [495.748, -1177.7069, -5.8033], V: [515.6504, 15.934, -1188.779], O: [0.988542, 0.148335, 0.027948],
      R: [0.019876, -0.014281, 0.020876], E: none, linearity: 1,
    },
    [307.2, 819.2],
    [4.79837, 0.85569, -1.04573],
  ],
  [
    "CAHVORE",
    {
      kind: "CAHVORE", width: 640, height: 480, C: [0.5, 0.06, 0.55], A: [0.766044, 0, -0.642788], H: [244.7512, -285, -205.3706],
      V: [0.2732, 0, -372.2703], O: [0.766044, 0, -0.642788], R: [0, -0.013, -0.0075], E: [0.0009, 0.0023, 0.0016], linearity: 0.37,
    },
    [0, 0],
    [3.1516, 3.98147, 2.16238],
  ],
];

describe("camera models", () => {
  it.each(CAMERAS)("%s projects as the rover does", (_kind, camera, [sample, line], point) => {
    const seen = project(camera, point);
    expect(seen?.[0]).toBeCloseTo(sample, 1);
    expect(seen?.[1]).toBeCloseTo(line, 1);
    const { origin, ray } = backProject(camera, sample, line);
    const off = point.map((v, k) => v - ((origin[k] ?? 0) + 5 * (ray[k] ?? 0)));
    expect(Math.hypot(...off)).toBeLessThan(3e-3);
  });

  it("as a matrix gives the same pixel", () => {
    const camera = (CAMERAS[0] as (typeof CAMERAS)[0])[1];
    const point = [4.84175, 0.9768, -0.99096, 1];
    const clip = clipMatrix(camera, 0.1, 100).map((row) => row.reduce((sum, v, k) => sum + v * (point[k] ?? 0), 0));
    const [x = 0, y = 0, z = 0, w = 1] = clip;
    expect(((x / w + 1) / 2) * 1024 - 0.5).toBeCloseTo(307.2, 2);
    expect(((1 - y / w) / 2) * 768 - 0.5).toBeCloseTo(614.4, 2);
    expect(Math.abs(z / w)).toBeLessThan(1);
    expect(isLinear(camera)).toBe(true);
  });

  it.each(CAMERAS.slice(1))("%s is bent from a linear picture to within a tenth of a pixel", (_kind, camera) => {
    const bent = warp(camera, 48, 36, 1.2);
    expect(isLinear(bent.linear)).toBe(true);
    for (const node of [60, 700, 900, 1000]) {
      const [row, column] = [Math.floor(node / 49), node % 49];
      const sample = (column * camera.width) / 48 - 0.5;
      const line = (row * camera.height) / 36 - 0.5;
      const { origin, ray } = backProject(camera, sample, line);
      const far: Vector = [origin[0] + 1e6 * ray[0], origin[1] + 1e6 * ray[1], origin[2] + 1e6 * ray[2]];
      const seen = project(bent.linear, far) ?? [Number.NaN, Number.NaN];
      expect(seen[0]).toBeCloseTo(bent.from[node]?.[0] ?? 0, 1);
      expect(seen[1]).toBeCloseTo(bent.from[node]?.[1] ?? 0, 1);
    }
  });

  it("turns with its mount", () => {
    const camera = (CAMERAS[0] as (typeof CAMERAS)[0])[1];
    // The mount's x looks north, y west, z up, and it stands at (10, 20, 1).
    const there = moved(camera, [[0, 1, 0], [-1, 0, 0], [0, 0, 1]], [10, 20, 1]);
    expect(project(there, [10 - 0.9768, 20 + 4.84175, 1 - 0.99096])?.[0]).toBeCloseTo(307.2, 2);
  });

  it("draws an error ellipse and reads labels", () => {
    const camera = (CAMERAS[0] as (typeof CAMERAS)[0])[1];
    const one = ellipseInImage(camera, [5.02, 0.1, 0], [[1e-4, 0, 0], [0, 1e-4, 0], [0, 0, 4e-4]], 1);
    expect(one?.center[0]).toBeCloseTo(511.5, 6);
    // 1 cm at 5 m are 2.25 px across, 2 cm 4.49 px up; along the view nothing is seen.
    expect(Math.sqrt(one?.matrix[0] ?? 0)).toBeCloseTo(2.247, 2);
    expect(Math.sqrt(one?.matrix[2] ?? 0)).toBeCloseTo(4.494, 2);
    expect(cameraOf({ ...camera })?.linearity).toBe(1);
    expect(cameraOf({ kind: "CAHV", width: 3 })).toBeNull();
    expect(cameraOf("CAHV")).toBeNull();
  });
});

describe("panorama", () => {
  const count = 9;
  const width = 100;
  const step = (2 * Math.PI) / count / width;
  const strip: Strip = {
    tile_width: width,
    tile_height: 60,
    top_elevation_rad: 0,
    rad_per_px: step,
    tiles: Array.from({ length: count }, (_, k) => ({
      index: k,
      left_azimuth_rad: (1 + k * width * step) % (2 * Math.PI),
      eye_m: [0.1 * Math.sin(k), 0.1 * Math.cos(k), 1.4],
      url: "",
    })),
  };

  it("finds again the direction of a place", () => {
    for (const [x, y] of [[3, 5], [455.5, 20], [850, 59]] as const) {
      const { azimuth, elevation } = directionAt(strip, x, y);
      const eye = strip.tiles[Math.floor(x / width)]?.eye_m ?? [];
      const level = Math.cos(elevation);
      const point = [level * Math.sin(azimuth), level * Math.cos(azimuth), Math.sin(elevation)].map((v, k) => 8 * v + (eye[k] ?? 0));
      const place = placeOf(strip, point[0] ?? 0, point[1] ?? 0, point[2] ?? 0);
      expect(place?.[0]).toBeCloseTo(x, 6);
      expect(place?.[1]).toBeCloseTo(y, 6);
    }
    expect(placeOf(strip, 5, 0, 4)).toBeNull();
  });

  it("begins to load where the rover looks", () => {
    const order = loadingOrder(strip, azimuthOf(Math.PI / 2 - (1 + 4.5 * width * step)));
    expect(order[0]).toBe(4);
    expect(new Set(order).size).toBe(count);
    expect(azimuthOf(Math.PI / 2)).toBeCloseTo(0);
    expect(azimuthOf(0)).toBeCloseTo(Math.PI / 2);
  });
});

describe("overlays", () => {
  it("colour slopes by what the rover stands on", () => {
    const grid = { rows: 2, columns: 3, west: 0, south: 0, east: 2, north: 1, heights: new Float32Array([0, 0, 2, 0, 0, 2]) };
    const raster = slopeRaster(grid, 0.43);
    expect([...raster.pixels.slice(0, 3)]).toEqual([60, 170, 110]);
    expect([...raster.pixels.slice(8, 11)]).toEqual([220, 40, 50]);
    expect(edges(raster)).toEqual({ west: -0.5, south: -0.5, east: 2.5, north: 1.5 });
  });

  it("tell unknown, hidden and seen ground apart", () => {
    expect(coverageColour(0)).toBe(UNKNOWN);
    expect(coverageColour(1)).toBe(HIDDEN);
    expect(coverageColour(3)).not.toEqual(coverageColour(60));
  });
});

describe("predicted spread of position", () => {
  const times = (low: number, mid: number, high: number) => ({ p: [0.1, 0.5, 0.9], time_s: [low, mid, high], energy_j: [0, 0, 0] });
  const tree: PlanTree = {
    format: "plan-tree/2",
    plan: [
      { op: "navigate", to: "A", p_reached: 1, quantiles: times(0, 0, 0) },
      { op: "observe", target: "A", observation: "o", p_reached: 1, quantiles: times(80, 100, 140) },
      {
        op: "branch",
        p_reached: 1,
        quantiles: times(180, 200, 240),
        options: [{ id: "late", when: [], p_taken: 0.25, plan: [{ op: "navigate", to: "C", p_reached: 0.25, quantiles: times(180, 200, 240) }] }],
      },
      { op: "navigate", to: "B", p_reached: 0.75, quantiles: times(180, 200, 240) },
      { op: "observe", target: "B", observation: "q", p_reached: 0.75, quantiles: times(280, 300, 340) },
    ],
  };
  const lines = linesOf(tree);
  const places: Record<string, [number, number]> = { A: [10, 0], B: [10, 10], C: [20, 0] };
  const at = (t: number) =>
    spotsAt(lines, legsOf(lines), [0, 0], (leg) => [leg.from === null ? [0, 0] : (places[leg.from] ?? [0, 0]), places[leg.to] ?? [0, 0]], t);
  const total = (t: number): number => at(t).reduce((sum, spot) => sum + spot.p, 0);

  it("adds up to one at any time", () => {
    for (const t of [0, 50, 90, 150, 190, 260, 320, 1000]) expect(total(t)).toBeCloseTo(1, 6);
  });

  it("lies along the drive, wider when it is less certain", () => {
    const early = summary(at(50));
    expect(early?.at[0]).toBeCloseTo(5, 0);
    expect(early?.at[1]).toBe(0);
    expect(early?.sd).toBeGreaterThan(0.3);
    expect(early?.driven).toBeCloseTo(early?.at[0] ?? 0, 6);
    expect(summary(at(1))?.sd).toBeLessThan(0.1);
    const end = at(1000);
    expect(end.find((spot) => spot.line === "late")?.p).toBeCloseTo(0.25, 6);
    expect(end.find((spot) => spot.line === "main")?.at).toEqual([10, 10]);
    expect(summary([])).toBeNull();
  });

  it("knows quantiles, paths and the end", () => {
    expect(quantile({ low: 80, mid: 100, high: 140 }, 0.9)).toBeCloseTo(140);
    expect(quantile({ low: 80, mid: 100, high: 140 }, 0.5)).toBe(100);
    expect(alongPath([[0, 0], [2, 0], [2, 2]], 0.75)).toEqual([2, 1]);
    expect(alongPath([[3, 3]], 0.4)).toEqual([3, 3]);
    expect(planEnd(lines)).toBe(340);
  });
});

describe("scale bar", () => {
  it.each([
    [0.05, 5, "5 m"],
    [0.002, 0.2, "20 cm"],
    [0.5, 50, "50 m"],
    [20, 2000, "2 km"],
  ])("at %f m a pixel shows %f m", (resolution, metres, text) => {
    const bar = scaleBar(resolution);
    expect(bar.metres).toBeCloseTo(metres);
    expect(bar.text).toBe(text);
    expect(bar.pixels).toBeLessThanOrEqual(120);
    expect(bar.pixels).toBeGreaterThan(40);
  });
});

describe("targets in a picture that came back", () => {
  const camera_model = { kind: "CAHV", width: 100, height: 80, C: [0, 0, 1], A: [1, 0, 0], H: [49.5, -100, 0], V: [39.5, 0, -100] };
  const small = [[1e-4, 0, 0], [0, 1e-4, 0], [0, 0, 4e-4]];
  const at = (id: string, east_m: number, north_m: number) => ({ id, name: id, position: { east_m, north_m, up_m: 1 }, covariance_m2: small });

  it("stand where the label's camera sees them, with their ellipses", () => {
    const shown = marksIn({ camera_model }, [at("A", 5, 0), at("B", 5, 9), at("C", -5, 0)], "A");
    expect(shown?.marks).toHaveLength(1);
    expect(shown?.marks[0]).toMatchObject({ id: "A", own: true });
    expect(shown?.marks[0]?.x).toBeCloseTo(49.5);
    // Two standard deviations: 2 cm across and 4 cm up at 5 m are 0.4 and 0.8 pixels; the longer one stands upright.
    expect(shown?.marks[0]?.rx).toBeCloseTo(0.8, 3);
    expect(shown?.marks[0]?.ry).toBeCloseTo(0.4, 3);
    expect(Math.abs(shown?.marks[0]?.turn ?? 0)).toBeCloseTo(Math.PI / 2, 3);
  });

  it("the picture's own target stands where the rover tracked it, the others where the map has them", () => {
    const shown = marksIn({ camera_model, point_m: [5, 0.5, 1] }, [at("A", 5, 0), at("B", 5, 0)], "A");
    expect(shown?.marks.map((mark) => [mark.id, Math.round(mark.x * 10) / 10])).toEqual([["A", 39.5], ["B", 49.5]]);
  });

  it("show what the tracker found in the picture: pixel, template and covariance", () => {
    const tracker = {
      state: "tracked", confidence: 0.97, point_m: [5, 0.5, 1], pixel: [39.2, 50.1],
      outline: [[29, 40], [49, 40], [49, 60], [29, 60]],
      covariance_m2: [[1e-4, 0, 0], [0, 4e-4, 0], [0, 0, 1e-4]],
    };
    const [mine, other] = marksIn({ camera_model, tracker }, [at("A", 5, 0), at("B", 5, 0)], "A")?.marks ?? [];
    expect(mine).toMatchObject({ x: 39.2, y: 50.1, outline: tracker.outline, tracker: { state: "tracked", confidence: 0.97 } });
    // 4 cm across are two standard deviations of 2 cm: 0.8 pixels at 5 m, lying.
    expect(mine?.rx).toBeCloseTo(0.8, 2);
    expect(Math.abs(mine?.turn ?? 9)).toBeCloseTo(0, 2);
    expect(other).toMatchObject({ outline: null, tracker: null });
    const lost = { state: "lost", confidence: 0.2, point_m: [5, 0.5, 1], covariance_m2: "none" };
    const [gone] = marksIn({ camera_model, tracker: lost }, [at("A", 5, 0)], "A")?.marks ?? [];
    expect(gone).toMatchObject({ outline: null, tracker: { state: "lost", confidence: 0.2 } });
    expect(gone?.x).toBeCloseTo(39.5, 1);
  });

  it("are not guessed without a camera model", () => {
    expect(marksIn({}, [at("A", 5, 0)], null)).toBeNull();
    expect(axesOf([4, 0, 1])).toEqual({ rx: 2, ry: 1, turn: 0 });
  });
});

describe("files of a terrain", () => {
  const file = (name: string, size = 10) => ({ name, size });

  it("are looked at before they are sent", () => {
    expect(terrainProblem(null, null)).toBe("choose a terrain file");
    expect(terrainProblem(file("site.ZIP"), null)).toBe("");
    expect(terrainProblem(file("dem.tif"), file("ortho.png"))).toBe("");
    expect(terrainProblem(file("notes.txt"), null)).toContain("notes.txt is not a terrain");
    expect(terrainProblem(file("dem.tif", 0), null)).toBe("dem.tif is empty");
    expect(terrainProblem(file("site.zip"), file("ortho.png"))).toContain("GeoTIFF only");
    expect(terrainProblem(file("dem.tif"), file("a.gif"))).toContain("a.gif is not an image");
  });
});

describe("names in the panorama", () => {
  const mark = (name: string, x: number, y: number, selected = false) => ({ name, at: [x, y] as const, selected });

  it("are left away where they would lie over another, never that of the selected target", () => {
    expect(named([mark("A", 0, 0), mark("B", 200, 0)], 1)).toEqual([true, true]);
    expect(named([mark("Adirondack", 0, 0), mark("Bonneville", 20, 4)], 1)).toEqual([true, false]);
    expect(named([mark("Adirondack", 0, 0), mark("Bonneville", 20, 4, true)], 1)).toEqual([false, true]);
  });

  it("come back when one looks closer", () => {
    const pair = [mark("Adirondack", 0, 0), mark("Bonneville", 20, 4)];
    expect(named(pair, 4)).toEqual([true, true]);
  });
});
