import { moved, partAt, snapped, withCorner, withCornerLess, withCornerMore } from "../src/map/polygon-edit";
import { describe, expect, it } from "vitest";
import {
  ellipse,
  type Network,
  offsetPath,
  outline,
  pathOf,
  placeLabels,
  type Point,
  polygonArea,
  ribbonsOf,
  ribbonWidth,
  trackingCone, drivesOf, lossColour, reachSector, standOf } from "../src/map/geometry";
import { measureText } from "../src/lib/measure";
import { densify, groundGeometry, stripGeometry, sunDirection, surface } from "../src/scene/ground";

const network: Network = {
  nodes: [
    { id: "start", target_id: null, pose: { east_m: 0, north_m: 0 } },
    { id: "n1", target_id: "A", pose: { east_m: 4, north_m: 0 } },
    { id: "n2", target_id: "B", pose: { east_m: 4, north_m: 3 } },
  ],
  segments: [
    { start: "start", end: "n1", points_m: [[0, 0], [2, 1], [4, 0]] },
    { start: "n2", end: "n1", points_m: [[4, 3], [5, 1], [4, 0]] },
  ],
};
const nowhere = (): Point | null => null;

describe("the way of a drive", () => {
  it("follows the path network, also against the direction of a segment", () => {
    expect(pathOf(network, null, "A", nowhere)).toEqual([[0, 0], [2, 1], [4, 0]]);
    expect(pathOf(network, "A", "B", nowhere)).toEqual([[4, 0], [5, 1], [4, 3]]);
  });

  it("is straight where the network has no segment, and unknown where there is no place", () => {
    expect(pathOf(network, null, "B", nowhere)).toEqual([[0, 0], [4, 3]]);
    expect(pathOf(null, null, "X", nowhere)).toBeNull();
    expect(pathOf(null, null, "X", (t) => (t === null ? [0, 0] : [1, 1]))).toEqual([[0, 0], [1, 1]]);
  });
});

describe("ribbons", () => {
  const leg = (line: string, from: string | null, to: string, p: number) => ({ line, depth: line === "main" ? 0 : 1, step: `${line}/0`, from, to, p });
  const way = (from: string | null, to: string) => pathOf(network, from, to, nowhere);

  it("are as wide as the drive is probable", () => {
    expect(ribbonWidth(1)).toBeGreaterThan(4 * ribbonWidth(0.01));
    expect(ribbonWidth(7)).toBe(ribbonWidth(1));
  });

  it("lie side by side on the same way and do not overlap", () => {
    const [a, b] = ribbonsOf([leg("main", null, "A", 0.8), leg("option-1", null, "A", 0.2)], way);
    const gap = Math.abs((a?.shift ?? 0) - (b?.shift ?? 0));
    expect(gap).toBeGreaterThanOrEqual(((a?.width ?? 0) + (b?.width ?? 0)) / 2);
  });

  it("lie on opposite sides when one goes there and one comes back", () => {
    const [a, b] = ribbonsOf([leg("main", "A", "B", 0.5), leg("option-1", "B", "A", 0.5)], way);
    expect(Math.sign(a?.shift ?? 0)).toBe(Math.sign(b?.shift ?? 0));
  });

  it("are shifted by their distance everywhere", () => {
    const moved = offsetPath([[0, 0], [10, 0], [10, 10]], 1);
    expect(moved).toEqual([[0, 1], [9, 1], [9, 10]]);
    expect(offsetPath([[0, 0], [5, 0], [0, 0]], 1).every(([x, y]) => Math.hypot(x, y) < 6)).toBe(true);
  });
});

describe("shapes", () => {
  it("have the area and the spread they tell of", () => {
    expect(polygonArea([[0, 0], [4, 0], [4, 3]])).toBe(6);
    const ring = ellipse([1, 2], [[0.04, 0, 0], [0, 0.01, 0]], 2, 400);
    expect(Math.max(...ring.map((p) => p[0])) - 1).toBeCloseTo(0.4, 4);
    expect(Math.max(...ring.map((p) => p[1])) - 2).toBeCloseTo(0.2, 4);
    expect(polygonArea(outline(3, 3, 0.4, 1, 1))).toBeGreaterThan(1);
  });

  it("open the tracking cone towards where the target was first seen", () => {
    const cone = trackingCone([10, 0], [0, 0], 0.3);
    expect(cone[0]).toEqual([10, 0]);
    for (const [x, y] of cone.slice(1)) {
      expect(Math.hypot(x - 10, y)).toBeCloseTo(10);
      expect(Math.abs(Math.atan2(y, 10 - x))).toBeLessThanOrEqual(0.3001);
    }
  });
});

describe("names on the map", () => {
  it("lie neither on each other nor on a mark, and the first one gets its place", () => {
    const labels = [[0, 0], [30, 2], [60, 0], [31, 3], [32, 4]].map(([x = 0, y = 0]) => ({ at: [x, y] as Point, width: 60, height: 14 }));
    const places = placeLabels(labels, 9);
    expect(places[0]).not.toBeNull();
    const boxes = places.flatMap((shift, k) => {
      const at = labels[k]?.at ?? [0, 0];
      return shift === null ? [] : [[at[0] + shift[0], at[1] + shift[1]]];
    });
    boxes.forEach((a, i) =>
      boxes.slice(i + 1).forEach((b) => {
        const apart = Math.abs((a[0] ?? 0) - (b[0] ?? 0)) >= 60 || Math.abs((a[1] ?? 0) - (b[1] ?? 0)) >= 14;
        expect(apart).toBe(true);
      }),
    );
    expect(places.some((place) => place === null)).toBe(true);
  });
});

describe("the ground in 3D", () => {
  const grid = { rows: 3, columns: 3, west: -1, east: 1, south: -1, north: 1, heights: new Float32Array([0, 0, 0, 0, 1, 0, 0, 0, Number.NaN]) };

  it("has two triangles a cell, none where a height is missing, none in the hole", () => {
    const extent = { west: -1, south: -1, east: 1, north: 1 };
    expect(groundGeometry(grid, extent, null).getIndex()?.count).toBe(3 * 6);
    expect(groundGeometry(grid, extent, { west: -3, south: -3, east: 3, north: 3 }).getIndex()?.count).toBe(0);
    const normal = groundGeometry(grid, extent, null).getAttribute("normal");
    for (let k = 0; k < 4; k += 1) expect(normal.getY(k)).toBeGreaterThan(0);
  });

  it("is covered by what is draped over it", () => {
    const up = surface([grid]);
    expect(up(0, 0)).toBe(1);
    expect(up(9, 9)).toBe(0);
    const strip = stripGeometry([[-1, 0], [0, 0]], 0.1, 0.05, up).getAttribute("position");
    for (let k = 0; k < strip.count; k += 1) {
      expect(strip.getY(k)).toBeCloseTo(up(strip.getX(k), -strip.getZ(k)) + 0.05, 5);
    }
    expect(densify([[0, 0], [1, 0]], 0.3)).toHaveLength(5);
  });

  it("is lit from where the server says, and in between from in between", () => {
    const places = [
      { lmst_h: 6, direction: [1, 0, 0] },
      { lmst_h: 12, direction: [0, 0.1, 0.995] },
      { lmst_h: 18, direction: [-1, 0, 0] },
    ];
    expect(sunDirection(places, 6)[0]).toBeCloseTo(1);
    expect(sunDirection(places, 12)[2]).toBeCloseTo(0.995, 3);
    const [east, , up] = sunDirection(places, 9);
    expect(east).toBeGreaterThan(0.6);
    expect(up).toBeGreaterThan(0.6);
    expect(sunDirection(places, 20)[0]).toBeLessThan(0);
    expect(sunDirection([], 12)).toEqual([0, 0, 1]);
  });
});

describe("what the arm reaches", () => {
  const arm = { shoulder_m: [0.4, 0, 0.42], arm_reach_m: 0.79, arm_min_reach_m: 0.25, arm_azimuth_limit_rad: 1.2 };

  it("lies before the rover, nearer than the reach for the shoulder's height", () => {
    const ring = reachSector({ east_m: 10, north_m: 5, heading_rad: Math.PI / 2 }, arm);
    const north = Math.max(...ring.map((p) => p[1]));
    expect(north).toBeCloseTo(5 + 0.4 + Math.sqrt(0.79 ** 2 - 0.42 ** 2), 3);
    expect(Math.min(...ring.map((p) => p[1]))).toBeGreaterThan(5.39);
  });

  it("is shown for the request in focus, else the first with a place", () => {
    const at = (east_m: number) => ({ pose: { east_m, north_m: 0, heading_rad: 0 } });
    const requests = [{ id: "a", observation_point: null }, { id: "b", observation_point: at(1) }, { id: "c", observation_point: at(2) }];
    expect(standOf(requests, null)?.request.id).toBe("b");
    expect(standOf(requests, "c")?.pose.east_m).toBe(2);
    expect(standOf([], null)).toBeNull();
  });
});

describe("drives of a network", () => {
  it("are drawn once each with the worst chance, or that of one target", () => {
    const segment = (id: string, start: string, end: string, p_lose: Record<string, number>) => ({ id, start, end, p_lose, points_m: [[0, 0], [1, 0]] });
    const network = { segments: [segment("1", "s", "a", { A: 0.1, B: 0.3 }), segment("2", "a", "s", { A: 0.2, B: 0 })] };
    expect(drivesOf(network, null)).toMatchObject([{ loss: 0.3, start: "s", end: "a" }]);
    expect(drivesOf(network, "A")).toMatchObject([{ loss: 0.2 }]);
    expect(drivesOf(null, null)).toEqual([]);
    expect(lossColour(0.3)).not.toBe(lossColour(0.05));
  });
});

describe("a measured line", () => {
  it("tells distance, rise, angle and bearing, and only what is known", () => {
    expect(measureText([[0, 0], [3, 4]], [1, 1])).toBe("5.00 m · up 0.0 cm · 5.00 m straight · 0.0° · bearing 37°");
    expect(measureText([[0, 0], [0, -2]], [1, null])).toBe("2.00 m · bearing 180°");
    expect(measureText([[0, 0], [2, 0]], [0, -2])).toContain("down 2.00 m · 2.83 m straight · −45.0°");
    expect(measureText([[0, 0]], [null])).toBe("");
  });
});

describe("outlines changed by hand", () => {
  const square: Point[] = [[0, 0], [4, 0], [4, 4], [0, 4]];

  it("a corner is found before an edge, an edge before the inside", () => {
    expect(partAt([0.1, 0.1], square, 0.3)).toEqual({ kind: "corner", index: 0 });
    expect(partAt([2, 0.2], square, 0.3)).toEqual({ kind: "edge", index: 0, at: [2, 0] });
    expect(partAt([0.1, 2], square, 0.3)).toEqual({ kind: "edge", index: 3, at: [0, 2] });
    expect(partAt([2, 2], square, 0.3)).toEqual({ kind: "inside" });
    expect(partAt([5, 2], square, 0.3)).toBeNull();
  });

  it("corners are moved, added and removed, and three are kept", () => {
    expect(withCorner(square, 2, [5, 5])).toEqual([[0, 0], [4, 0], [5, 5], [0, 4]]);
    expect(withCornerMore(square, 3, [0, 2])).toEqual([...square, [0, 2]]);
    expect(withCornerLess(square, 1)).toEqual([[0, 0], [4, 4], [0, 4]]);
    expect(withCornerLess(withCornerLess(square, 1), 0)).toHaveLength(3);
    expect(moved(square, [1, -1])[2]).toEqual([5, 3]);
    expect(square[2]).toEqual([4, 4]);
  });

  it("a place is drawn to a corner, else to an edge, else it stays", () => {
    expect(snapped([0.2, 0.1], [square], 0.3)).toEqual([0, 0]);
    expect(snapped([2, 0.2], [square], 0.3)).toEqual([2, 0]);
    expect(snapped([2, 2], [square], 0.3)).toEqual([2, 2]);
    expect(snapped([4.2, 4.2], [square, moved(square, [4.3, 4.3])], 0.3)).toEqual([4.3, 4.3]);
  });
});
