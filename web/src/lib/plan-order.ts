/** What a person asks of the next plan, checked as the server does. */

/** What is wrong with a limit on the chance of an overrun, per cent; empty if nothing is. */
export function riskProblemOf(percent: number | null | undefined): string {
  if (percent === null || percent === undefined) return "";
  if (!Number.isFinite(percent)) return "a number is needed";
  if (percent <= 0) return `${percent} % is given; it has to be more than 0`;
  if (percent >= 100) return `${percent} % is given; it has to be less than 100`;
  return "";
}
