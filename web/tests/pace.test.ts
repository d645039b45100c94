import { describe, expect, it } from "vitest";
import { Pace } from "../src/scene/pace";

function turn(pace: Pace, every: number, frames: number): void {
  let now = 1000;
  pace.begin(now);
  for (let k = 0; k < frames; k += 1) pace.frame((now += every));
}

describe("what is drawn while the view is turned", () => {
  it("is everything where the machine keeps up", () => {
    const pace = new Pace();
    turn(pace, 16, 100);
    expect(pace.effort).toBe(0);
  });

  it("is less, and less again, where it does not", () => {
    const pace = new Pace();
    turn(pace, 60, 2);
    expect(pace.effort).toBe(1);
    turn(pace, 60, 100);
    expect(pace.effort).toBe(2);
  });

  it("is more again after a turn that was quick", () => {
    const pace = new Pace();
    turn(pace, 60, 10);
    turn(pace, 12, 50);
    turn(pace, 12, 50);
    expect(pace.effort).toBe(1);
  });

  it("takes a pause for no slow frame", () => {
    const pace = new Pace();
    turn(pace, 5000, 10);
    expect(pace.effort).toBe(0);
  });
});
