import { describe, expect, it } from "vitest";
import { choices, cornersFrom, crsOf, Locator, pointFrom, pointText, readOut } from "../src/lib/coordinates";

const UTM = { crs: "EPSG:32612", x: 518334, y: 4251500 };
const DEGREES = { crs: "EPSG:4326", x: -110.79, y: 38.41 };

describe("coordinates", () => {
  it("offers what the mission's place can tell", () => {
    expect(choices(null)).toEqual([]);
    expect(choices(UTM)).toEqual(["site", "lonlat", "projected"]);
    expect(choices(DEGREES)).toEqual(["site", "lonlat"]);
    expect(choices({ crs: 'PROJCRS["local", ...]', x: 0, y: 0 })).toContain("projected");
    expect(choices({ crs: 'GEOGCRS["Mars", ...]', x: 77, y: 18 })).not.toContain("projected");
  });

  it("names the reference that the server converts to", () => {
    expect(crsOf("site", UTM)).toBeNull();
    expect(crsOf("lonlat", UTM)).toBe("lonlat");
    expect(crsOf("projected", UTM)).toBe("EPSG:32612");
    expect(crsOf("projected", DEGREES)).toBeNull();
    expect(crsOf("lonlat", null)).toBeNull();
  });

  it("reads out to a centimetre in each reference", () => {
    expect(readOut([3, -4.567], null)).toBe("E 3.00\u2002N −4.57 m");
    expect(readOut([-110.79, 38.41], "lonlat")).toBe("lon −110.7900000\u2002lat 38.4100000");
    expect(readOut([518334, 4251500], "EPSG:32612")).toBe("x 518334.00\u2002y 4251500.00 m");
  });

  it("asks once for a cell and is a centimetre off at most, on a sphere at 60 degrees", async () => {
    const radius = 6_371_000;
    const deg = 180 / Math.PI;
    let asked = 0;
    // Degrees of a point east and north of 60° by the length of its parallel.
    const truth = (east: number, north: number) => {
      const lat = Math.PI / 3 + north / radius;
      return { x: (east / (radius * Math.cos(lat))) * deg, y: lat * deg };
    };
    let told: () => void = () => undefined;
    const there = new Promise<void>((done) => (told = done));
    const locator = new Locator((east, north) => ((asked += 1), Promise.resolve(truth(east, north))), told);
    expect(locator.at(160, 140)).toBeNull();
    expect(locator.at(161, 141)).toBeNull();
    await there;
    for (const [east, north] of [[160, 140], [249, 51], [151, 149]] as const) {
      const [x, y] = locator.at(east, north) ?? [0, 0];
      const exact = truth(east, north);
      expect(Math.abs((x - exact.x) / deg) * radius * 0.5).toBeLessThan(0.01);
      expect(Math.abs((y - exact.y) / deg) * radius).toBeLessThan(0.01);
    }
    expect(asked).toBe(3);
  });

  it("writes what it reads", () => {
    expect(pointText([-110.79, 38.41], "lonlat")).toBe("-110.79000000, 38.41000000");
    expect(pointFrom(pointText([518338.2, 4251498.5], "EPSG:32612"))).toEqual([518338.2, 4251498.5]);
    expect(pointFrom(" −110.79  38.41 ")).toEqual([-110.79, 38.41]);
    expect(pointFrom("1; 2")).toEqual([1, 2]);
    for (const bad of ["", "1", "1, 2, 3", "1, north", "1,", "Infinity 1"]) expect(pointFrom(bad)).toBeNull();
  });

  it("reads corners and names the line that is none", () => {
    expect(cornersFrom("0, 0\n\n1, 0\n1, 1\n")).toEqual([[0, 0], [1, 0], [1, 1]]);
    expect(cornersFrom("0, 0\n1, x\n1, 1")).toBe("Line 2 is not a pair of numbers: 1, x");
    expect(cornersFrom("0, 0\n1, 1")).toContain("at least 3 corners");
  });
});
