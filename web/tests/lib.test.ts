import { describe, expect, it } from "vitest";
import type { RoverInstrument } from "../src/api/types";
import { nodesOf, tokenize } from "../src/lib/crl";
import { parseRows, parseTargets, wrongCells } from "../src/lib/csv";
import * as format from "../src/lib/format";
import { instrumentTitle, useOf } from "../src/lib/instruments";
import { KEYS, keyList, keyName } from "../src/lib/keys";
import { appended, blendAngle, type Columns, indexAt, momentAt, nodeStates, stepTimes } from "../src/lib/replay";
import { bodyOf, freshFields, problemsOf } from "../src/lib/request-form";
import { formatRoute, isSamePlace, parseRoute, type Route } from "../src/lib/route";
import { contours, contourStep, type Grid, heightAt, slopes } from "../src/lib/terrain-image";

describe("numbers for people", () => {
  it("gives durations and sizes in their largest unit", () => {
    const times = [0, 9.94, 42, 119, 120, 7_200, 47 * 3600, 12 * 86_400].map(format.lasted);
    expect(times).toEqual(["0.0 s", "9.9 s", "42 s", "119 s", "2 min", "2 h", "47 h", "12 days"]);
    expect([12, 2048, 5 * 2 ** 20, 3 * 2 ** 30].map(format.bytes)).toEqual(["12 B", "2.0 KiB", "5.0 MiB", "3.0 GiB"]);
  });

  it("tell times as clocks and on the Mars clock, whose second is longer", () => {
    expect(format.clock(3909)).toBe("1:05:09");
    expect(format.clock(-5)).toBe("−0:00:05");
    expect(format.solarTime(10, 0)).toBe("10:00");
    // One hour of LMST is 3699 s.
    expect(format.solarTime(10, 3698.97)).toBe("11:00");
    expect(format.planSeconds(10, "11:00")).toBeCloseTo(3698.97, 1);
    expect(format.planTime(10, format.lmstSeconds(10, 1234))).toBeCloseTo(1234);
  });

  it("refuse what is not a time of day", () => {
    for (const text of ["", "25:00", "10:60", "ten", "10"]) expect(format.planSeconds(10, text)).toBeNull();
  });

  it("never round a chance to nothing or to certainty", () => {
    expect(format.percent(0.001)).toBe("<1 %");
    expect(format.percent(0.999)).toBe(">99 %");
    expect(format.percent(0)).toBe("0 %");
    expect(format.percent(1)).toBe("100 %");
    expect(format.percent(null)).toBe("–");
  });

  it("write joules as watt-hours and small lengths as centimetres", () => {
    expect(format.energy(3600 * 292)).toBe("292 Wh");
    expect(format.energy(3600 * 4.25)).toBe("4.25 Wh");
    expect(format.length(0.048)).toBe("4.8 cm");
    expect(format.length(12.345)).toBe("12.35 m");
    expect(format.signed(-1.24)).toBe("−1.2");
    expect(format.signed(0.001)).toBe("0.0");
  });

  it("give the half axes of an error ellipsoid, whatever its direction", () => {
    const [a, b, c] = [0.05, 0.02, 0.01];
    const angle = 0.7;
    const [u, v] = [Math.cos(angle), Math.sin(angle)];
    const rotated = [
      [u * u * a * a + v * v * b * b, u * v * (a * a - b * b), 0],
      [u * v * (a * a - b * b), v * v * a * a + u * u * b * b, 0],
      [0, 0, c * c],
    ];
    format.standardDeviations(rotated).forEach((value, k) => expect(value).toBeCloseTo([a, b, c][k] ?? 0, 9));
    expect(format.standardDeviations([[1, 0, 0], [0, 1, 0], [0, 0, 1]])).toEqual([1, 1, 1]);
  });
});

describe("deep links", () => {
  it("bring back what was open and selected", () => {
    const route: Route = {
      mission: "msn-1",
      plan: "pln-2",
      run: null,
      tab: "crl",
      view: "scene",
      selection: { kind: "step", id: "option-3/4" },
    };
    expect(formatRoute(route)).toBe("#/m/msn-1?plan=pln-2&tab=crl&view=scene&sel=step:option-3/4");
    expect(parseRoute(formatRoute(route))).toEqual(route);
  });

  it("tells whether a person still looks at the same thing", () => {
    const here = parseRoute("#/m/msn-1?plan=pln-2&tab=crl&sel=target:tgt-1");
    expect(isSamePlace(here, { ...here, plan: "pln-3", run: "run-1", view: "map" })).toBe(true);
    expect(isSamePlace(here, { ...here, selection: { kind: "target", id: "tgt-1" } })).toBe(true);
    for (const gone of [{ mission: "msn-2" }, { tab: "plan" }, { selection: null }, { selection: { kind: "target", id: "tgt-2" } as const }]) {
      expect(isSamePlace(here, { ...here, ...gone })).toBe(false);
    }
  });

  it("do not stumble over what is not an address of ours", () => {
    for (const hash of ["", "#", "#/", "#/x/y", "#/m/", "#/m"]) expect(parseRoute(hash).mission).toBeNull();
    expect(parseRoute("#/m/a?sel=nonsense:1").selection).toBeNull();
    expect(parseRoute("#/m/a?sel=target").selection).toBeNull();
  });
});

describe("pasted targets", () => {
  it("are read with or without a heading, with tabs, semicolons or commas", () => {
    const wanted = { name: "Rock 1", east_m: 4.2, north_m: -1.5, instrument: "science_camera", value: 3, wrong: null };
    for (const text of [
      "Rock 1, 4.2, -1.5, science camera, 3",
      "name;x;y;instrument;value\n\nRock 1;4.2;-1.5;Science Camera;3\n",
      'north\teast\ttarget\tvalue\tinstrument\n-1.5\t4.2\t"Rock 1"\t3\tscience_camera',
    ]) {
      expect(parseTargets(text, ["science_camera"])[0]).toMatchObject(wanted);
    }
  });

  it("name the line and the cell that cannot be read", () => {
    const rows = parseTargets("name,east,north,value,instrument\nA,x,1\nB,1,2,-4\n,1,2\nC,1,2\nD,1,2,3,Laser", ["core_drill", "scoop"]);
    expect(rows.map(({ line, wrong }) => [line, wrong?.column, wrong?.value, wrong?.why])).toEqual([
      [2, "east", "x", "east is “x”, not a number of metres"],
      [3, "value", "-4", "value is “-4”, not a number of at least 0"],
      [4, "name", "", "no name"],
      [5, undefined, undefined, undefined],
      [6, "instrument", "Laser", "the rover has no “Laser”; it has core drill, scoop"],
    ]);
  });

  it("keep their lines, whatever is empty or quoted between them", () => {
    const rows = parseTargets('name,east,north\n\n"A\nB",1,2\n\nC,1,2', []);
    expect(rows.map(({ line, name }) => [line, name])).toEqual([[3, "A\nB"], [6, "C"]]);
  });

  it("take no name twice, and no number with words behind it", () => {
    const rows = parseTargets("A,1,2\nB,1,2\nA,3,4\nC,1.5m,2\nD,1,", [], new Set(["B"]));
    expect(rows.map((row) => row.wrong?.why ?? "")).toEqual([
      "",
      "there is a target “B” already",
      "line 1 has the name already",
      "east is “1.5m”, not a number of metres",
      "north is “”, not a number of metres",
    ]);
  });

  it("show what the server refuses in their line and column", () => {
    const rows = parseTargets("name,east,north,value\nA,1,2,3\nB,900,2,3", []);
    const errors = [
      { pointer: "/create/1/target/east_m", detail: "off the terrain" },
      { pointer: "/create/0/value", detail: "too much" },
      { pointer: "/create/7/value", detail: "of no row" },
      { detail: "of nothing" },
    ];
    expect(wrongCells(rows, errors)).toEqual([
      { line: 3, name: "B", column: "east", value: "900", why: "off the terrain" },
      { line: 2, name: "A", column: "value", value: "3", why: "too much" },
    ]);
  });

  it("may hold the separator in quotes", () => {
    expect(parseRows('"a, ""b""",2\r\n')).toEqual([{ line: 1, cells: ['a, "b"', "2"] }]);
  });
});

describe("CRL text", () => {
  const TEXT = `(plan :id p ; a comment with (brackets)
  :node (block :id root
    :node-list ((task :id t1 :action image :probability 0.9 :parameters (target = tgt-1)
                      :metadata (observation = req-1 target = "tgt-1"))
      (branch :id b :options ((option :id o1 :utility 3.5e1
          :node (task :id t2 :start-conditions ((database (:trackerstate "Rock \\"1\\"" /= :lost))) :action wait)))))))`;

  it("is cut into tokens that make the same text again", () => {
    expect(tokenize(TEXT).map((token) => token.text).join("")).toBe(TEXT);
    expect(tokenize("/ odd ' \u0000").map((token) => token.text).join("")).toBe("/ odd ' \u0000");
  });

  it("gives every node its place, action, metadata and parent", () => {
    const nodes = nodesOf(TEXT);
    expect(nodes.map((node) => [node.id, node.kind, node.action, node.parent])).toEqual([
      ["root", "block", null, "p"],
      ["t1", "task", "image", "root"],
      ["b", "branch", null, "root"],
      ["o1", "option", null, "b"],
      ["t2", "task", "wait", "o1"],
    ]);
    expect(nodes[1]?.metadata).toEqual({ observation: "req-1", target: "tgt-1" });
    expect(TEXT.slice(nodes[3]?.start, nodes[3]?.end)).toMatch(/^\(option[^]*\)$/);
    expect(nodes[1]?.line).toBe(3);
    expect(nodes.map((node) => node.probability)).toEqual([null, 0.9, null, null, null]);
  });
});

describe("a replay", () => {
  const columns: Columns = {
    t_s: [0, 10, 20],
    east_m: [0, 0, 4],
    north_m: [null, 1, 1],
    heading_rad: [3, -3, -3],
    battery_j: [1, 1, 1],
    energy_used_j: [0, 5, 9],
    tracker_confidence: { A: [null, 0.9, 0.4] },
    tracker_state: { A: [null, "tracked", "lost"], B: ["idle", "idle", "idle"] },
    task: [null, "t1", "t2"],
  };

  it("blends numbers between samples and keeps states as last told", () => {
    const moment = momentAt(columns, 15);
    expect(moment.east_m).toBe(2);
    expect(moment.energy_used_j).toBe(7);
    expect(moment.task).toBe("t1");
    expect(moment.trackers.A).toEqual({ confidence: 0.9, state: "tracked" });
    expect(moment.trackers.B?.state).toBe("idle");
    expect(momentAt(columns, 99).trackers.A?.state).toBe("lost");
    expect(momentAt(columns, 5).north_m).toBe(1);
  });

  it("grows by live samples, also with a tracker that was not there before", () => {
    const sample = { t_s: 30, east_m: 5, north_m: 1, heading_rad: 0, battery_j: 1, energy_used_j: 12, task: null };
    const grown = appended(columns, [{ ...sample, trackers: { A: { state: "lost", confidence: 0.1 }, C: { state: "tracked", confidence: 1 } } }]);
    expect(grown.tracker_confidence.C).toEqual([null, null, null, 1]);
    expect(grown.tracker_state.B).toEqual(["idle", "idle", "idle", null]);
    for (const column of [grown.east_m, grown.task, grown.tracker_state.A]) expect(column).toHaveLength(4);
    expect(columns.t_s).toHaveLength(3);
  });

  it("turns the short way round", () => {
    const half = blendAngle(3, -3, 0.5) ?? 0;
    expect(Math.cos(half)).toBeCloseTo(-1, 6);
    expect(blendAngle(null, 1, 0.5)).toBe(1);
  });

  it("finds samples by halving", () => {
    expect([-1, 0, 9.9, 10, 25].map((t) => indexAt(columns.t_s, t))).toEqual([-1, 0, 0, 1, 2]);
  });

  it("knows what became of each node by any moment", () => {
    const records = [
      { t_s: 0, event: "start", arguments: ["a"] },
      { t_s: 5, event: "end", arguments: ["a", "SUCCEEDED"] },
      { t_s: 5, event: "start", arguments: ["b"] },
      { t_s: 9, event: "end", arguments: ["b", "FAILED", "action-failed"] },
    ];
    expect([...nodeStates(records, 4)]).toEqual([["a", "running"]]);
    expect(nodeStates(records, 9).get("b")).toBe("failed");
    expect(stepTimes(records)).toEqual([0, 5, 9]);
  });
});

const INSTRUMENT = { profile_name: "", doc: "", action: "", energy_j: { mean: 0, sd: 0 }, data_mbit: 0, p_success: 1, standoff_m: 0, field_of_view_rad: 0, camera: "" };
const DRILL: RoverInstrument = { ...INSTRUMENT, name: "core_drill", use: "contact", tracked: true, time_s: { mean: 2400, sd: 0 } };
const SPECTROMETER: RoverInstrument = { ...INSTRUMENT, name: "mast_spectrometer", use: "remote", tracked: false, time_s: { mean: 300, sd: 0 } };

describe("the request form", () => {
  it("sends a window in plan seconds", () => {
    const fields = { ...freshFields(DRILL), from: "11:00", until: "12:00" };
    expect(problemsOf(fields, 10, 14400)).toEqual({});
    expect(bodyOf(fields, 10)).toMatchObject({ instrument: "core_drill", window_s: [3699, 7398], value: 10, tracked: true });
    expect(bodyOf(freshFields(SPECTROMETER), 10)).toMatchObject({ window_s: null, tracked: false, value: 4 });
  });

  it("takes instruments from the rover and none of its own", () => {
    expect(problemsOf(freshFields(undefined), 10, 14400)).toMatchObject({ instrument: "an instrument is needed" });
    expect(instrumentTitle(DRILL.name)).toBe("Core drill");
    expect(useOf(DRILL)).toBe("by the arm, on contact, 0:40:00");
    expect(useOf(SPECTROMETER)).toBe("from afar, 0:05:00");
  });

  it("says what is wrong before the server does", () => {
    const check = (changes: object) => Object.keys(problemsOf({ ...freshFields(DRILL), ...changes }, 10, 14400));
    expect(check({ value: null })).toEqual(["value"]);
    expect(check({ value: -1 })).toEqual(["value"]);
    expect(check({ dwell: -1 })).toEqual(["dwell"]);
    expect(check({ from: "11:00" })).toEqual(["until"]);
    expect(check({ from: "9:00", until: "12:00" })).toEqual(["from"]);
    expect(check({ from: "12:00", until: "11:00" })).toEqual(["until"]);
    expect(check({ from: "23:00", until: "23:30" })).toEqual(["from"]);
    expect(check({ from: "soon", until: "12:00" })).toEqual(["from"]);
  });
});

describe("pictures of the ground", () => {
  // A plane that rises 1 m per 2 m to the north.
  const rows = 5;
  const columns = 9;
  const grid: Grid = {
    rows,
    columns,
    west: -4,
    east: 4,
    south: -2,
    north: 2,
    heights: Float32Array.from({ length: rows * columns }, (_, k) => (2 - Math.floor(k / columns)) / 2),
  };

  it("take heights between posts and nothing outside", () => {
    expect(heightAt(grid, 0.3, 0.5)).toBeCloseTo(0.25);
    expect(heightAt(grid, 5, 0)).toBeNull();
  });

  it("show the slope of a plane", () => {
    for (const slope of slopes(grid)) expect(slope).toBeCloseTo(Math.atan(0.5), 5);
  });

  it("draw contours where the ground has their height", () => {
    for (const [level, flat] of contours(grid, 0.3)) {
      for (let k = 0; k < flat.length; k += 2) expect((flat[k + 1] ?? 0) / 2).toBeCloseTo(level, 5);
    }
    expect(contours(grid, 0.3).size).toBe(7);
    expect(contourStep(6)).toBe(0.5);
  });
});

describe("keys", () => {
  it("are named the same with either command key", () => {
    const press = (key: string, held: object = {}) => keyName({ key, ctrlKey: false, metaKey: false, shiftKey: false, altKey: false, ...held });
    expect(press("T")).toBe("t");
    expect(press("z", { metaKey: true })).toBe("ctrl+z");
    expect(press("Z", { ctrlKey: true, shiftKey: true })).toBe("ctrl+shift+z");
    expect(press("?", { shiftKey: true })).toBe("?");
    expect(press("Enter", { shiftKey: true })).toBe("shift+enter");
    expect(press("ArrowLeft", { altKey: true })).toBe("alt+arrowleft");
  });

  it("stand for one thing within a part of the page, and each is written for the help", () => {
    for (const { title, keys } of Object.values(KEYS)) {
      const names = Object.values<{ keys: readonly string[] }>(keys).flatMap((binding) => binding.keys);
      expect(new Set(names).size, title).toBe(names.length);
    }
    const list = keyList().flatMap((scope) => scope.keys);
    expect(list.every((key) => key.keys.trim() !== "" && key.text !== "")).toBe(true);
    expect(list.find((key) => key.text.startsWith("undo"))?.keys).toBe("Ctrl Z");
  });

  it("of a part of the page hide the page's own only where they mean the same kind of thing", () => {
    // A view that has the focus hears its keys first: no letter of the page may get lost there unseen.
    const page = Object.values<{ keys: readonly string[] }>(KEYS.page.keys).flatMap((binding) => binding.keys);
    for (const scope of ["cross", "hold", "outline", "turn", "timeline", "list", "row", "split"] as const) {
      const own = Object.values<{ keys: readonly string[] }>(KEYS[scope].keys).flatMap((binding) => binding.keys);
      expect(own.filter((key) => page.includes(key)), scope).toEqual([]);
    }
  });
});

describe("a sentence of the server", () => {
  it("tells times and energies as people write them, and nothing else", () => {
    expect(format.inUnits("no route makes it within 360 s and 1.5e+06 J, in its window")).toBe(
      "no route makes it within 0:06:00 and 417 Wh, in its window",
    );
    expect(format.inUnits("no option is eligible if time is 2954.034 and T2 is lost")).toBe("no option is eligible if time is 0:49:14 and T2 is lost");
    expect(format.inUnits("time is 2954.5 s")).toBe("time is 0:49:15");
    expect(format.inUnits("the arm reaches 0.79 m, 3 s late, S12 stays")).toBe("the arm reaches 0.79 m, 3 s late, S12 stays");
  });
});
