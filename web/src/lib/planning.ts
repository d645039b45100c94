/** What is said of a search for a plan: what it does now, and what its result has to say of itself. */

const PHASES: Readonly<Record<string, string>> = {
  begun: "Reading the day",
  "observation points": "Finding where the rover stands for each target",
  "path network": "Finding paths between them",
  "planning problem": "Weighing drives and observations",
  reading: "Weighing drives and observations",
  branching: "Looking for better plans",
  bounds: "Computing how much better a plan could be",
  CRL: "Writing the plan as CRL",
  done: "Keeping the plan",
};

/** What a planning job does now. Its figures stand beside the plan that is drawn, and nowhere else. */
export function phaseWords(message: string): string {
  const phase = message.split(":", 1)[0] ?? "";
  return PHASES[phase] ?? (message === "" ? "Planning" : message);
}

/** What a day earns with a plan in 5, 50 and 95 % of its futures, every success drawn. */
export type Band = readonly [number, number, number];

/** The band of a plan's summary; null where it has none: no plan, or one made before there were any. */
export function bandOf(summary: Readonly<Record<string, unknown>>): Band | null {
  const [low, middle, high] = [summary.utility_p05, summary.utility_p50, summary.utility_p95];
  return typeof low === "number" && typeof middle === "number" && typeof high === "number" ? [low, middle, high] : null;
}

/** The reasons in a planner's summary, as sentences; empty where it gives none. */
export function reasonsOf(summary: Readonly<Record<string, unknown>>): string[] {
  const given: readonly unknown[] = Array.isArray(summary.reasons) ? summary.reasons : [];
  return given
    .filter((reason): reason is string => typeof reason === "string" && reason !== "")
    .map((reason) => `${reason.slice(0, 1).toUpperCase()}${reason.slice(1)}${reason.endsWith(".") ? "" : "."}`);
}
