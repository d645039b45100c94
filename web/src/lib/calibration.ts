/** What a `calibration/2` document (or `/1`, in which no drive failed) says of lost tracks and drives, for people. */

import { number } from "./format";

export interface Rate {
  where: string;
  perMetre: number;
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
}

const PLACES: [string, string][] = [
  ["inside", "inside the tracking region"],
  ["outside", "outside it"],
  ["occluded", "hidden"],
];

/** The numbers of a mission's calibration; null when plans use those of the rover's profile. */
export function calibrationOf(document: Record<string, unknown> | null): Learned | null {
  if (document === null) return null;
  const value = (name: string): number => (typeof document[name] === "number" ? document[name] : 0);
  return {
    source: typeof document["source"] === "string" ? document["source"] : "",
    rates: PLACES.map(([name, where]) => ({
      where,
      perMetre: value(`${name}_per_m`),
      error: value(`${name}_se_per_m`),
    })),
    tracks: value("tracks"),
    losses: value("losses"),
    short: { where: "", perMetre: value("fail_per_m"), error: value("fail_se_per_m") },
    failures: value("failures"),
    legs: value("legs"),
  };
}

export function rate({ perMetre, error }: Rate): string {
  return error > 0 ? `${number(perMetre, 3)} ± ${number(error, 3)}` : `${number(perMetre, 3)}, not seen`;
}
