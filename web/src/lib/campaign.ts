/** What a campaign says (`campaign/1`), and how the page tells it. */

import { clock, energy, number, percent, words } from "./format";
import type { Line } from "./plan-tree";

export interface Interval {
  low: number | null;
  high: number | null;
}

export interface Bin {
  low: number;
  high: number;
  runs: number;
}

export interface Frequency {
  what: string;
  runs: number;
  share: number;
  interval: Interval;
  predicted: number | null;
}

export interface FailureMode {
  task: string;
  condition: string;
  resource: string;
  runs: number;
  share: number;
  interval: Interval;
  mean_utility: number;
  utility_without: number | null;
  examples: number[];
}

export interface Difference {
  name: string;
  mean: number;
  interval: Interval;
}

export interface CampaignResult {
  runs: number;
  seed: number;
  rover: string;
  utility: {
    mean: number;
    sd: number;
    standard_error: number;
    interval: Interval;
    quantiles: Record<string, number>;
    predicted: number | null;
    deviation: number | null;
  };
  frequencies: Frequency[];
  histogram: Bin[];
  failures: FailureMode[];
  helps: Difference[];
  stopped: string;
}

/** Which runs are listed: those of a range of utilities, with an option, or in which a task failed. */
export interface RunFilter {
  title: string;
  low?: number;
  high?: number;
  option?: string;
  task?: string;
}

const OPTION = "option ";
/** Standard errors between a mean and its prediction that chance alone seldom makes (1 in 370). */
const FAR = 3;

/** The option that a frequency counts; null for outcomes and budgets. */
export function optionOf(found: Frequency): string | null {
  return found.what.startsWith(OPTION) ? found.what.slice(OPTION.length) : null;
}

/** Options in the order of the plan's text with their depth, those that no run took too; then what is not an option. */
export function branchesFlown(lines: readonly Line[], found: readonly Frequency[]): { line: Line; flown: Frequency | null }[] {
  const byOption = new Map(found.flatMap((f) => (optionOf(f) === null ? [] : [[optionOf(f), f] as const])));
  return lines
    .filter((line) => line.depth > 0)
    .map((line) => {
      const flown = byOption.get(line.id) ?? [...byOption].find(([name]) => name?.endsWith(line.id))?.[1] ?? null;
      return { line, flown };
    });
}

/** Whether a prediction, if there is one, lies in the interval of what was flown. */
export function within(found: Frequency): boolean {
  const { low, high } = found.interval;
  return found.predicted === null || ((low ?? 0) <= found.predicted && found.predicted <= (high ?? 1));
}

export function ends({ low, high }: Interval, say: (value: number) => string): string {
  if (low === null) return high === null ? "unknown" : `up to ${say(high)}`;
  return high === null ? `at least ${say(low)}` : `${say(low)} to ${say(high)}`;
}

/** What the mean says of the plan's expectation, or nothing where nothing was expected. */
export function verdict(utility: CampaignResult["utility"]): { text: string; far: boolean } | null {
  if (utility.predicted === null || utility.deviation === null) return null;
  const far = Math.abs(utility.deviation) > FAR;
  const off = `The planner expected ${number(utility.predicted, 2)}; the mean is ${number(Math.abs(utility.deviation), 1)} standard errors ${utility.deviation < 0 ? "below" : "above"} it`;
  return { text: far ? `${off}, more than chance alone makes.` : `${off}, which is within chance.`, far };
}

/** Worst 5 %, middle and best 5 % as a sentence. */
export function spreadOf(quantiles: Record<string, number>): string {
  const at = (p: string): string => number(quantiles[p] ?? null, 1);
  return `One day in twenty earns ${at("0.05")} or less, half of them ${at("0.5")} or more, one in twenty ${at("0.95")} or more.`;
}

/** What stands over the list of runs. */
export function rangeTitle(bin: Bin, last: boolean): string {
  return `Utility ${number(bin.low, 1)} to ${last ? "" : "below "}${number(bin.high, 1)}`;
}

/** A share with the runs it was counted from. */
export function counted(found: { runs: number; share: number }): string {
  return `${percent(found.share, found.share > 0 && found.share < 0.1 ? 1 : 0)}, ${found.runs} ${found.runs === 1 ? "run" : "runs"}`;
}

/** What was changed in a case of "what would help most". */
export function helpWords(name: string): string {
  const more = /^(time|energy)-plus-([0-9.e+]+)-[sj]$/.exec(name);
  if (more === null) return words(name);
  return more[1] === "time" ? `${clock(Number(more[2]))} more time` : `${energy(Number(more[2]))} more energy`;
}
