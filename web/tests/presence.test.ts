import { expect, test } from "vitest";
import type { ObservationRequest } from "../src/api/types";
import { initialsOf, marksOf, othersOf, placeOf, selectedOn } from "../src/lib/presence";
import { differences, fieldsOf } from "../src/lib/request-form";
import { NOWHERE } from "../src/lib/route";

const route = { ...NOWHERE, mission: "msn-1" };

test("what others are told is the selection, else the run or plan that is open", () => {
  expect(selectedOn(route)).toBeNull();
  expect(selectedOn({ ...route, plan: "pln-1" })).toEqual({ kind: "plan", id: "pln-1" });
  expect(selectedOn({ ...route, plan: "pln-1", run: "run-1" })).toEqual({ kind: "plan", id: "pln-1" });
  expect(selectedOn({ ...route, plan: "pln-1", run: "run-1", tab: "run" })).toEqual({ kind: "run", id: "run-1" });
  const selection = { kind: "request", id: "req-1" } as const;
  expect(selectedOn({ ...route, plan: "pln-1", selection })).toEqual({ kind: "observation_request", id: "req-1" });
  expect(selectedOn({ ...route, plan: "pln-1", selection: { kind: "step", id: "main/1" } })).toEqual({ kind: "plan", id: "pln-1" });
});

test("a click on somebody leads to the place that they tell of", () => {
  for (const selection of [{ kind: "request", id: "req-1" }, { kind: "keep-out", id: "kpo-1" }, { kind: "target", id: "tgt-1" }] as const) {
    expect(placeOf(selectedOn({ ...route, selection }))).toEqual({ selection });
  }
  expect(placeOf(null)).toBeNull();
});

test("somebody is one mark for all of their pages, and nobody sees themselves", () => {
  const target = { kind: "target", id: "tgt-1" };
  const lookers = [
    { page_id: "p1", person: "Ada", selected: target },
    { page_id: "p2", person: "Bo Director", selected: null },
    { page_id: "p3", person: "Bo Director", selected: target },
  ];
  const others = othersOf(lookers, "Ada");
  expect(others).toEqual([{ person: "Bo Director", initials: "BD", selected: [target] }]);
  expect(marksOf(others).get("tgt-1")).toEqual(others);
  expect(initialsOf("élodie")).toBe("É");
});

test("a conflict shows every member that differs, and of a deleted request what was typed", () => {
  const saved = {
    instrument: "science_camera", value: 4, tracked: false, must_do: false, window_s: null, dwell_s: null, after: [], notes: "", constraints: [],
  } as unknown as ObservationRequest;
  const mission = { startHour: 10, kinds: [], requestName: (id: string) => id };
  const mine = { ...fieldsOf(saved, 10, []), value: 9, notes: "vein", mustDo: true };
  expect(differences(mine, saved, mission)).toEqual([["Value", "9", "4"], ["Must do", "yes", "no"], ["Notes", "vein", "–"]]);
  expect(differences(mine, null, mission)).toContainEqual(["Value", "9", "deleted"]);
  expect(differences(mine, null, mission)).toContainEqual(["Notes", "vein", "deleted"]);
});
