/** Moving an observation point by hand: while it is dragged the server says whether the target is reached from there. */

import * as calls from "../api/calls";
import type { ObservationRequest, Pose, StandCheck } from "../api/types";
import { app } from "./app.svelte";
import type { MissionState } from "./mission.svelte";

export class StandState {
  /** The request whose point is being moved; null at rest. */
  request = $state.raw<ObservationRequest | null>(null);
  pose = $state.raw<Pose | null>(null);
  /** Verdict on the last pose that was asked about. */
  check = $state.raw<StandCheck | null>(null);
  readonly verdict = $derived(this.check === null ? null : this.check.reachable);

  private asking = false;
  private wanted: Pose | null = null;
  /** Settles with the verdict on the last pose that was shown. */
  private asked: Promise<void> = Promise.resolve();

  constructor(private readonly m: MissionState) {}

  begin(requestId: string): void {
    const request = this.m.requestById.get(requestId) ?? null;
    const pose = request?.observation_point?.pose ?? null;
    this.request = request;
    this.pose = pose;
    this.check = null;
  }

  /** Stand at a place, facing the target. */
  move(east_m: number, north_m: number): void {
    const target = this.m.targetById.get(this.request?.target_id ?? "");
    if (this.pose === null || target === undefined) return;
    const { position } = target;
    const heading_rad = Math.atan2(position.north_m - north_m, position.east_m - east_m);
    this.show({ east_m, north_m, heading_rad });
  }

  /** Turn the nose towards a place. */
  turn(east_m: number, north_m: number): void {
    if (this.pose === null) return;
    this.show({ ...this.pose, heading_rad: Math.atan2(north_m - this.pose.north_m, east_m - this.pose.east_m) });
  }

  /** Turn by an angle, radians; left is positive. */
  turnBy(angle: number): void {
    if (this.pose !== null) this.show({ ...this.pose, heading_rad: this.pose.heading_rad + angle });
  }

  private show(pose: Pose): void {
    this.pose = pose;
    this.wanted = pose;
    if (!this.asking) this.asked = this.ask();
  }

  /** One question at a time; poses passed over meanwhile are left out. */
  private async ask(): Promise<void> {
    this.asking = true;
    while (this.wanted !== null && this.request !== null) {
      const pose = this.wanted;
      this.wanted = null;
      const { id } = this.request;
      const check = await calls.standCheck(id, pose).catch(() => null);
      if (this.request?.id === id) this.check = check;
    }
    this.asking = false;
  }

  /** Keep the pose if the target is reached from it; else it goes back to where it was, and the reason is said. */
  async drop(): Promise<void> {
    const { request, pose } = this;
    if (request === null || pose === null) return;
    await this.asked;
    if (this.request !== request || this.pose !== pose) return; // taken in hand again meanwhile
    const old = request.observation_point?.pose ?? null;
    const same = old !== null && Math.hypot(old.east_m - pose.east_m, old.north_m - pose.north_m) < 1e-3 && Math.abs(old.heading_rad - pose.heading_rad) < 1e-3;
    if (!same && this.check?.reachable === false) {
      app.toast("bad", `The observation point of ${request.target_name} stays where it was`, this.check.reason);
    } else if (!same) {
      await app.attempt(`The observation point of ${request.target_name}`, () =>
        calls.changeRequest(request, { observation_pose: rounded(pose) }),
      );
      await app.attempt("The requests", () => this.m.reload("observation_request"));
    }
    this.cancel();
  }

  cancel(): void {
    this.request = null;
    this.pose = null;
    this.check = null;
    this.wanted = null;
  }

  /** Give the choice back to base placement. */
  async release(request: ObservationRequest): Promise<void> {
    await app.attempt(`The observation point of ${request.target_name}`, () =>
      calls.changeRequest(request, { observation_pose: null }),
    );
    await app.attempt("The requests", () => this.m.reload("observation_request"));
  }
}

const rounded = (pose: Pose): Pose => ({
  east_m: Math.round(pose.east_m * 1000) / 1000,
  north_m: Math.round(pose.north_m * 1000) / 1000,
  heading_rad: Math.round(pose.heading_rad * 1e5) / 1e5,
});
