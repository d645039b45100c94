/** Who else looks at the mission: this page says that it is there, and hears of others by the mission's stream. */

import { untrack } from "svelte";
import * as calls from "../api/calls";
import type { Looker } from "../api/types";
import { BEAT_MS, marksOf, type Other, othersOf, selectedOn } from "../lib/presence";
import { app } from "./app.svelte";

/** Who walks through a list does not tell every line of it. */
const SETTLED_MS = 250;

export class PresenceState {
  private lookers = $state.raw<readonly Looker[]>([]);
  readonly others = $derived<readonly Other[]>(othersOf(this.lookers, app.person?.name));
  /** Who else has what selected, by its id. */
  readonly marks = $derived(marksOf(this.others));

  private readonly page = crypto.randomUUID();
  private told = false;
  private saying: Promise<void> = Promise.resolve();
  private timer: ReturnType<typeof setTimeout> | null = null;

  constructor(readonly mission: string) {}

  /** Say it from now on, while the page is seen; return what ends it. To be called in an effect. */
  begin(): () => void {
    const seen = (): void => {
      if (document.hidden) void this.leave();
      else this.soon(0);
    };
    const gone = (): void => void this.leave();
    // What was said last may be under way still, and would come after the leave-taking.
    const farewell = async (): Promise<void> => {
      await this.saying;
      await this.leave();
      this.soon(BEAT_MS); // should it be the same person who goes on
    };
    app.farewells.add(farewell);
    document.addEventListener("visibilitychange", seen);
    addEventListener("pagehide", gone);
    return () => {
      app.farewells.delete(farewell);
      document.removeEventListener("visibilitychange", seen);
      removeEventListener("pagehide", gone);
      void this.leave();
    };
  }

  /** The person chose something else, or is another one. */
  moved(): void {
    void app.route;
    void app.person;
    untrack(() => this.soon(SETTLED_MS));
  }

  /** Take in who looks, as the stream tells it. */
  take(data: unknown): void {
    if (Array.isArray(data)) this.lookers = data as Looker[];
  }

  private soon(wait: number): void {
    if (this.timer !== null) clearTimeout(this.timer);
    this.timer = document.hidden ? null : setTimeout(() => this.say(), wait);
  }

  private say(): void {
    this.timer = setTimeout(() => this.say(), BEAT_MS);
    this.told = true;
    // Who looks is told again soon; nothing else hangs on it.
    this.saying = calls.sayPresence(this.mission, this.page, selectedOn(app.route)).then(
      (lookers) => this.take(lookers),
      () => undefined,
    );
  }

  private async leave(): Promise<void> {
    if (this.timer !== null) clearTimeout(this.timer);
    this.timer = null;
    const told = this.told;
    this.told = false;
    if (told) await calls.leavePresence(this.mission, this.page).catch(() => undefined);
  }
}
