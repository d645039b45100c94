import { describe, expect, it } from "vitest";
import { type Localization, movedBy, pixelOf, rowsOf, sigmaOf, type Stop, tiesOf } from "../src/lib/traverse";

const picture = { width: 800, height: 200, left_azimuth_rad: 0.2, top_elevation_rad: 0.05, rad_per_px: 0.0025 };
const stop = (name: string, believed_m: number[]): Stop => ({
  name,
  believed_m,
  believed_covariance_m2: [[1, 0, 0], [0, 4, 0], [0, 0, 0]],
  adjusted_m: believed_m.map((value, axis) => value + (axis === 0 ? 0.3 : axis === 1 ? -0.4 : 0)),
  adjusted_covariance_m2: [[0.01, 0, 0], [0, 0.01, 0], [0, 0, 0]],
  rocks: 12,
  picture,
});
const pair = { first_m: [3, 4, -1.5], second_m: [3.1, 4, -1.5], height_m: 0.3, probability: 0.99 };
const leg = (accepted: boolean) => ({ first: "a", second: "b", length_m: 20, accepted, verdict: "", pairs: [pair], rejected: [pair] });
const found = (accepted: boolean): Localization => ({ format: "localization/1", stops: [stop("a", [0, 0, 0]), stop("b", [0, 20, 0])], legs: [leg(accepted)] });

describe("tie points", () => {
  it("stand where azimuth and elevation put them", () => {
    const [x, y] = pixelOf(stop("a", [1, 2, 1.5]), [1 + 10 * Math.sin(0.7), 2 + 10 * Math.cos(0.7), 1.5 - 10 * Math.tan(0.1)]);
    expect(x).toBeCloseTo((0.7 - 0.2) / 0.0025);
    expect(y).toBeCloseTo(0.15 / 0.0025);
  });

  it("a little left of the first column stay there, on either side of north", () => {
    const at = { ...stop("a", [0, 0, 0]), picture: { ...picture, left_azimuth_rad: 6.2 } };
    expect(pixelOf(at, [10 * Math.sin(6.19), 10 * Math.cos(6.19), 0])[0]).toBeCloseTo(-4);
    expect(pixelOf(at, [10 * Math.sin(0.1), 10 * Math.cos(0.1), 0])[0]).toBeCloseTo((0.1 + 2 * Math.PI - 6.2) / 0.0025);
  });

  it("of a refused leg count as rejected, all of them", () => {
    expect(tiesOf(found(true), leg(true)).map((tie) => tie.accepted)).toEqual([true, false]);
    expect(tiesOf(found(false), leg(false)).map((tie) => tie.accepted)).toEqual([false, false]);
    expect(tiesOf(found(true), { ...leg(true), second: "nowhere" })).toEqual([]);
  });
});

describe("stops", () => {
  it("say how far they moved and how well they are known", () => {
    expect(movedBy(stop("a", [5, 5, 0]))).toBeCloseTo(0.5);
    expect(sigmaOf([[1, 0], [0, 4]])).toBeCloseTo(2);
    expect(sigmaOf([[2, 1], [1, 2]])).toBeCloseTo(Math.sqrt(3));
  });

  it("are cut to the rows with rocks", () => {
    expect(rowsOf(picture, [80, 90], 30)).toEqual({ top: 50, height: 70 });
    expect(rowsOf(picture, [])).toEqual({ top: 0, height: 200 });
  });
});
