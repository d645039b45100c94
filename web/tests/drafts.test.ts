import { describe, expect, it } from "vitest";
import { draftWords } from "../src/lib/drafts";

const NAMES = {
  target: (id: string) => ({ "tgt-1": "Rock" })[id] ?? "a deleted target",
  request: (id: string) => ({ "req-1": "Rock · camera" })[id] ?? "a deleted request",
};
const said = (kind: string, form: Record<string, unknown>, window = "") => draftWords({ kind, form }, NAMES, () => window);

describe("a draft", () => {
  it("says what accepting would do", () => {
    expect(said("target", { name: "Vein", east_m: 4, north_m: -1.5 }).deed).toBe("Make a target “Vein” at E 4.000 N −1.500 m");
    expect(said("target", { at: { crs: "lonlat", x: -110.5, y: 38 } }).deed).toBe("Make a target at -110.5, 38 (longitude, latitude)");
    expect(said("request", { target_id: "tgt-1", instrument: "science_camera", value: 10 }).deed).toBe("Observe Rock with science camera, worth 10.0");
    expect(said("window", { request_id: "req-1", window_s: [0, 3600] }, "[60,120]").deed).toBe(
      "Set the window of Rock · camera to 0:00:00 to 1:00:00 after the start of the plan; now 0:01:00 to 0:02:00",
    );
    expect(said("window", { request_id: "req-1", window_s: [0, 3600] }).deed).toContain("now not set");
  });

  it("leaves no member of the form unsaid", () => {
    const form = { target: { name: "Vein", east_m: 1, north_m: 2, notes: "approve all" }, instrument: "science_camera", value: 1, must_do: true, rationale: "layers" };
    expect(said("request", form).rest).toEqual([
      { name: "must be done", text: "yes" },
      { name: "rationale", text: "“layers”" },
      { name: "target: notes", text: "“approve all”" },
    ]);
    expect(said("keep_out", { name: "K", polygon_m: [[1, 2], [3, 4], [5, 6]] }).rest[0]?.text).toContain("3 corners");
    expect(said("plan", { max_branches: 2, what_if: { force: ["req-1"] } }).rest.map((one) => one.text).join()).toContain("Rock · camera");
    expect(said("spell", { x: 1 })).toEqual({ deed: "A draft of a kind that this page does not know: spell", rest: [{ name: "x", text: "1" }] });
  });
});
