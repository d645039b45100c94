/** What a `calibration/2` document (or `/1`, in which no drive failed and days are alike) says, for people. */

import { number } from "./format";

export interface Rate {
  where: string;
  amount: number;
  /** Standard error; 0 for a rate that no run told. */
  error: number;
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
