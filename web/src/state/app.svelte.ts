/** What belongs to the page and not to a mission: who is at work, what is open, messages, looks. */

import * as calls from "../api/calls";
import { ProblemError } from "../api/client";
import type { Person } from "../api/types";
import type { Coordinates } from "../lib/coordinates";
import { formatRoute, isSamePlace, NOWHERE, parseRoute, type Route, type Selection } from "../lib/route";

export interface Toast {
  id: number;
  tone: "info" | "ok" | "bad";
  title: string;
  text: string;
}

const PREFIX = "outcrop.";

export function remembered<T>(key: string, fallback: T): T {
  try {
    const text = localStorage.getItem(PREFIX + key);
    return text === null ? fallback : (JSON.parse(text) as T);
  } catch {
    return fallback;
  }
}

export function remember(key: string, value: unknown): void {
  try {
    localStorage.setItem(PREFIX + key, JSON.stringify(value));
  } catch {
    // A page without storage works, it only forgets.
  }
}

/** Nobody is kept from logging out by a word that the server does not answer. */
const FAREWELL_MOST_MS = 1_000;

class AppState {
  person = $state.raw<Person | null>(null);
  people = $state.raw<Person[]>([]);
  route = $state.raw<Route>(NOWHERE);
  theme = $state<"dark" | "light">("dark");
  toasts = $state.raw<Toast[]>([]);
  help = $state(false);
  /** What coordinates are shown and typed in, where a mission has a place. */
  coordinates = $state<Coordinates>(remembered("coordinates", "site"));
  auth = $state("profiles");
  /** Nobody administers the service yet. */
  unowned = $state(false);
  provider = $state(false);
  title = $state("");
  connected = $state(true);
  readonly testQuality = new URLSearchParams(location.search).get("quality") === "test";
  readonly webglWanted = new URLSearchParams(location.search).get("webgl") !== "off";
  /** What a page tells the server once more as the person who leaves it, before another one is at work on it. */
  readonly farewells = new Set<() => Promise<unknown>>();
  private counter = 0;

  constructor() {
    this.theme = document.documentElement.dataset.theme === "light" ? "light" : "dark";
    this.route = parseRoute(location.hash);
    addEventListener("hashchange", () => {
      this.route = parseRoute(location.hash);
    });
  }

  get selection(): Selection | null {
    return this.route.selection;
  }

  /** Change what is open. A change of the selection alone does not lengthen the history of the browser. */
  go(changes: Partial<Route>): void {
    const next = { ...this.route, ...changes };
    const url = formatRoute(next);
    if (url === location.hash) return;
    const deep = next.mission !== this.route.mission || next.plan !== this.route.plan || next.run !== this.route.run;
    this.route = next;
    if (deep) history.pushState(null, "", url);
    else history.replaceState(history.state, "", url);
  }

  /** Go where an act led that began on `from`, unless the person has gone elsewhere meanwhile. */
  goOn(from: Route, changes: Partial<Route>): void {
    if (isSamePlace(from, this.route)) this.go(changes);
  }

  select(selection: Selection | null): void {
    this.go({ selection });
  }

  /** Work as one of the local profiles; null takes the one used last, else one that may plan. */
  async workAs(name: string | null): Promise<void> {
    let wanted = name ?? remembered<string | null>("person", null);
    if (wanted === null || name === null) {
      const people = (await calls.people()).filter((person) => person.active);
      this.people = people;
      if (!people.some((person) => person.name === wanted)) {
        wanted =
          (people.find((person) => person.role === "planner") ?? people.find((person) => person.role !== "viewer") ?? people[0])
            ?.name ?? null;
      }
    }
    if (wanted === null) return;
    await this.takeLeave();
    const session = await calls.logIn(wanted);
    this.person = session.person ?? null;
    remember("person", wanted);
  }

  /** Let every part of the page take leave while the server still knows who it is; who hangs is not waited for. */
  async takeLeave(): Promise<void> {
    const all = Promise.allSettled([...this.farewells].map((farewell) => farewell()));
    await Promise.race([all, new Promise((resolve) => setTimeout(resolve, FAREWELL_MOST_MS))]);
  }

  /** Whether the person may do something that needs one of these roles. */
  may(...roles: string[]): boolean {
    const person = this.person;
    if (person === null) return false;
    const role = person.mission_roles[this.route.mission ?? ""] ?? person.role;
    return role === "admin" || roles.includes(role);
  }

  setTheme(theme: "dark" | "light"): void {
    this.theme = theme;
    document.documentElement.dataset.theme = theme;
    try {
      localStorage.setItem(`${PREFIX}theme`, theme);
    } catch {
      // Forgotten with the page.
    }
  }

  toast(tone: Toast["tone"], title: string, text = ""): void {
    this.counter += 1;
    const toast = { id: this.counter, tone, title, text };
    this.toasts = [...this.toasts.slice(-3), toast];
    setTimeout(() => this.dismiss(toast.id), tone === "bad" ? 12_000 : 5_000);
  }

  dismiss(id: number): void {
    this.toasts = this.toasts.filter((toast) => toast.id !== id);
  }

  /** Do something for the person; what the server refuses is said and not lost. Return null then. */
  async attempt<T>(what: string, action: () => Promise<T>): Promise<T | null> {
    try {
      return await action();
    } catch (error) {
      this.refused(what, error);
      return null;
    }
  }

  refused(what: string, error: unknown): void {
    if (error instanceof ProblemError && error.status === 412) {
      this.toast("bad", `${what}: somebody else changed it first`, "The latest version is shown now. Look at it and do it again.");
    } else if (error instanceof ProblemError) {
      const fields = Object.entries(error.fields)
        .filter(([, text]) => text !== error.message)
        .map(([field, text]) => (field === "" ? text : `${field}: ${text}`));
      this.toast("bad", `${what} was refused`, [error.message, ...fields].join(". "));
    } else {
      this.toast("bad", `${what} failed`, error instanceof Error ? error.message : String(error));
    }
  }
}

export const app = new AppState();
