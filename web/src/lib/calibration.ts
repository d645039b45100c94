/**
 * What a `calibration/3` document says, for people; `/2` has no arrivals and activities, `/1` no drive that failed
 * either, and days are alike.
 */

import { number } from "./format";

export interface Rate {
  where: string;
  amount: number;
  /** Standard error; 0 for a rate that no run told. */
  error: number;
}

/** How often one kind of activity succeeded in runs, and the chance that plans take it to have. */
export interface Activity {
  name: string;
  tried: number;
  succeeded: number;
  chance: Rate;
}

export interface Learned {
  source: string;
  rates: Rate[];
  tracks: number;
  losses: number;
  /** Drives that ended short of their goal. */
  short: Rate;
  failures: number;
  legs: number;
  /** Tracks lost on a drive to their own target besides those by the metre; 0 where nothing was learned. */
  arrival: Rate;
  activities: Activity[];
  /** Days on which the factors below rest; 0 where days are alike. */
  days: number;
  /** Spread between days of what all drives of one have in common: standard deviation of the logarithm. */
  between: Rate[];
}

const PLACES: [string, string][] = [
  ["inside", "inside the tracking region"],
  ["outside", "outside it"],
  ["occluded", "hidden"],
];

const SHARED: [string, string][] = [
  ["time", "times"],
  ["energy", "energies"],
];

function activityOf(document: unknown): Activity[] {
  if (typeof document !== "object" || document === null) return [];
  const { name, tried, succeeded, p_success: amount, p_se: error } = document as Record<string, unknown>;
  if (typeof name !== "string") return [];
  const count = (given: unknown): number => (typeof given === "number" ? given : 0);
  const chance = { where: name, amount: count(amount), error: count(error) };
  return [{ name, tried: count(tried), succeeded: count(succeeded), chance }];
}

/** The numbers of a mission's calibration; null when plans use those of the rover's profile. */
export function calibrationOf(document: Record<string, unknown> | null): Learned | null {
  if (document === null) return null;
  const value = (name: string): number => (typeof document[name] === "number" ? document[name] : 0);
  return {
    source: typeof document["source"] === "string" ? document["source"] : "",
    rates: PLACES.map(([name, where]) => ({
      where,
      amount: value(`${name}_per_m`),
      error: value(`${name}_se_per_m`),
    })),
    tracks: value("tracks"),
    losses: value("losses"),
    short: { where: "", amount: value("fail_per_m"), error: value("fail_se_per_m") },
    failures: value("failures"),
    legs: value("legs"),
    arrival: { where: "", amount: value("arrival_rate"), error: value("arrival_se") },
    activities: Array.isArray(document["activities"]) ? document["activities"].flatMap(activityOf) : [],
    days: value("days"),
    between: SHARED.filter(([name]) => value(`day_${name}_sd`) > 0).map(([name, where]) => ({
      where,
      amount: value(`day_${name}_sd`),
      error: value(`day_${name}_se`),
    })),
  };
}

export function rate({ amount, error }: Rate): string {
  return error > 0 ? `${number(amount, 3)} ± ${number(error, 3)}` : `${number(amount, 3)}, not seen`;
}
