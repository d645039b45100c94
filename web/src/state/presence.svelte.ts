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
  /** Words go one after the other: a leave-taking must not overtake what was said before it. */
  private words: Promise<unknown> = Promise.resolve();
  private timer: ReturnType<typeof setTimeout> | null = null;

  constructor(readonly mission: string) {}

  /** Say it from now on, while the page is seen; return what ends it. To be called in an effect. */
  begin(): () => void {
    const seen = (): void => {
      if (document.hidden) this.leave();
      else this.soon(0);
    };
    const gone = (): void => {
      if (this.hush()) void this.forget(); // a page that ends waits for nothing
    };
    const farewell = (): Promise<unknown> => {
      this.leave();
      this.soon(BEAT_MS); // should it be the same person who goes on
      return this.words;
    };
    app.farewells.add(farewell);
    document.addEventListener("visibilitychange", seen);
    addEventListener("pagehide", gone);
    return () => {
      app.farewells.delete(farewell);
      document.removeEventListener("visibilitychange", seen);
      removeEventListener("pagehide", gone);
      this.leave();
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
    this.words = this.words.then(async () => {
      try {
        this.take(await calls.sayPresence(this.mission, this.page, selectedOn(app.route)));
      } catch {
        // Who looks is told again soon; nothing else hangs on it.
      }
    });
  }

  private leave(): void {
    if (this.hush()) this.words = this.words.then(() => this.forget());
  }

  /** Say nothing more; return whether the server was told anything that it should forget. */
  private hush(): boolean {
    if (this.timer !== null) clearTimeout(this.timer);
    this.timer = null;
    const told = this.told;
    this.told = false;
    return told;
  }

  private forget(): Promise<unknown> {
    return calls.leavePresence(this.mission, this.page).catch(() => undefined);
  }
}
