/** Instruments as the page shows them; which there are and how each is used, the rover's data say. */

import type { RoverInstrument } from "../api/types";
import { clock, words } from "./format";

/** `mast_spectrometer` becomes `Mast spectrometer`. */
export function instrumentTitle(name: string): string {
  const text = words(name);
  return text.slice(0, 1).toUpperCase() + text.slice(1);
}

/** How an instrument is used and how long it takes, in a few words. */
export function useOf(instrument: RoverInstrument): string {
  return `${instrument.use === "contact" ? "by the arm, on contact" : "from afar"}, ${clock(instrument.time_s.mean)}`;
}

/** What a new request on it is worth until somebody says: a contact measurement is what a day is planned round. */
export function usualValue(instrument: RoverInstrument): number {
  return instrument.use === "contact" ? 10 : 4;
}
