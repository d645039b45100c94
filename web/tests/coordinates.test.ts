import { describe, expect, it } from "vitest";
import { choices, cornersFrom, crsOf, pointFrom, pointText } from "../src/lib/coordinates";

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
