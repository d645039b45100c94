import { expect, test } from "vitest";
import { AMOUNTS, FAULTS, faultOf, liveRunsOf, type Link, linkTold, wishTold } from "../src/lib/live";
import type { Run } from "../src/api/types";

const LINK: Link = { t_s: 12, up: true, age_s: 0.4, round_trip_s: 0.002, breaks: 0, commands: [] };
const told = (change: Partial<Link>, unheard = 0.5): string => {
  const { tone, text } = linkTold({ ...LINK, ...change }, unheard);
  return `${tone}: ${text}`;
};

test("a link is told by its state and the age of the last word", () => {
  expect(told({})).toBe("ok: link up, last word 0.4 s ago");
  expect(told({ age_s: 31.4 })).toBe("warn: link up, last word 31 s ago");
  expect(told({ age_s: null })).toBe("warn: link up, no word yet");
  expect(told({ up: false, age_s: 75 })).toBe("bad: link down, last word 75 s ago");
  expect(told({ up: false, age_s: null })).toBe("bad: link down");
  expect(linkTold({ t_s: 3 }, 0.5).text).toBe("rover in the same process");
});

test("what the page itself has not heard of is never told as up", () => {
  expect(linkTold(null, 0).tone).toBe("warn");
  expect(told({}, 12)).toBe("bad: the page has heard nothing for 12 s");
});

test("each state of a link has a sign of its own, so that no colour is needed", () => {
  const signs = [linkTold(LINK, 0), linkTold({ ...LINK, age_s: 31 }, 0), linkTold({ ...LINK, up: false }, 0)].map((s) => s.sign);
  expect(new Set(signs).size).toBe(3);
});

test("live runs that go on or wait are those to stop", () => {
  const run = (id: string, kind: string, state: string): Run => ({ id, kind, state }) as unknown as Run;
  expect(liveRunsOf([])).toEqual([]);
  expect(liveRunsOf([run("a", "dry_run", "running"), run("b", "live", "succeeded")])).toEqual([]);
  const several = [run("a", "live", "running"), run("b", "live", "queued"), run("c", "dry_run", "running")];
  expect(liveRunsOf(several).map((one) => one.id)).toEqual(["a", "b"]);
});

test("what is refused is called by what was asked", () => {
  expect([{ stop: true }, { abort: true }, { step: true }, { pace: 3 }, { paused: true }, { paused: false }].map(wishTold)).toEqual([
    "STOP", "The abort", "The step", "The pace", "Holding the run", "Letting the run go on",
  ]);
});

test("a fault goes with the target and the amount that its kind has, in the server's units", () => {
  expect(faultOf("lose-target", "tgt-1", 3)).toEqual({ kind: "lose-target", target_id: "tgt-1", amount: null });
  expect(faultOf("slow-drive", "tgt-1", null)).toEqual({ kind: "slow-drive", target_id: null, amount: 2 });
  expect(faultOf("low-battery", "", 10)).toEqual({ kind: "low-battery", target_id: null, amount: 36_000 });
  expect(Object.keys(AMOUNTS).every((kind) => FAULTS.some(([known]) => known === kind))).toBe(true);
});
