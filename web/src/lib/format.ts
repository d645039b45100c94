/** How numbers are written for people. Inside everything is SI; minutes, watt-hours and degrees exist only here. */

const MARS_SECOND = 1.0274912517;

export const MINUS = "−";
export const NONE = "–";

export function number(value: number | null | undefined, digits = 1): string {
  if (value === null || value === undefined || !Number.isFinite(value)) return NONE;
  return value.toFixed(digits).replace("-", MINUS);
}

export function signed(value: number | null | undefined, digits = 1): string {
  if (value === null || value === undefined || !Number.isFinite(value)) return NONE;
  const text = number(Math.abs(value), digits);
  return Number(value.toFixed(digits)) === 0 ? text : `${value < 0 ? MINUS : "+"}${text}`;
}

export function percent(p: number | null | undefined, digits = 0): string {
  if (p === null || p === undefined || !Number.isFinite(p)) return NONE;
  const value = 100 * p;
  if (value > 0 && value < 1 && digits === 0) return "<1 %";
  if (value < 100 && value > 99 && digits === 0) return ">99 %";
  return `${value.toFixed(digits)} %`;
}

/** Elapsed time, `1:05:09`; days are not used within one sol. */
export function clock(seconds: number | null | undefined): string {
  if (seconds === null || seconds === undefined || !Number.isFinite(seconds)) return NONE;
  const sign = seconds < 0 ? MINUS : "";
  const whole = Math.round(Math.abs(seconds));
  const h = Math.floor(whole / 3600);
  const m = Math.floor((whole % 3600) / 60);
  const s = whole % 60;
  return `${sign}${h}:${String(m).padStart(2, "0")}:${String(s).padStart(2, "0")}`;
}

/** Local mean solar time, hours and minutes, of plan time `seconds` in a sol that starts at `startHour`. */
export function solarTime(startHour: number, seconds: number): string {
  const hours = startHour + seconds / MARS_SECOND / 3600;
  const minutes = Math.round(((((hours % 24) + 24) % 24) * 60)) % 1440;
  return `${String(Math.floor(minutes / 60)).padStart(2, "0")}:${String(minutes % 60).padStart(2, "0")}`;
}

/** Seconds of the Mars clock since midnight at plan time `seconds`, not wrapped at the end of the sol. */
export function lmstSeconds(startHour: number, seconds: number): number {
  return startHour * 3600 + seconds / MARS_SECOND;
}

/** Plan time at which the Mars clock shows `lmst` seconds since midnight. */
export function planTime(startHour: number, lmst: number): number {
  return (lmst - startHour * 3600) * MARS_SECOND;
}

/** Plan seconds at local mean solar time `HH:MM`; null when the text is not a time of day. Before the start is negative. */
export function planSeconds(startHour: number, text: string): number | null {
  const match = /^\s*(\d{1,2}):(\d{2})\s*$/.exec(text);
  if (match === null) return null;
  const hours = Number(match[1]) + Number(match[2]) / 60;
  if (Number(match[1]) > 23 || Number(match[2]) > 59) return null;
  return (hours - startHour) * 3600 * MARS_SECOND;
}

/** Energy: watt-hours, as batteries are spoken of. */
export function energy(joules: number | null | undefined): string {
  if (joules === null || joules === undefined || !Number.isFinite(joules)) return NONE;
  const wh = joules / 3600;
  return `${number(wh, Math.abs(wh) < 10 ? 2 : Math.abs(wh) < 100 ? 1 : 0)} Wh`;
}

export function degrees(radians: number | null | undefined, digits = 0): string {
  if (radians === null || radians === undefined || !Number.isFinite(radians)) return NONE;
  return `${number((radians * 180) / Math.PI, digits)}°`;
}

/** Length: centimetres below a metre. */
export function length(metres: number | null | undefined): string {
  if (metres === null || metres === undefined || !Number.isFinite(metres)) return NONE;
  return Math.abs(metres) < 1 ? `${number(metres * 100, Math.abs(metres) < 0.1 ? 1 : 0)} cm` : `${number(metres, 2)} m`;
}

export function bytes(count: number): string {
  if (count < 1024) return `${count} B`;
  if (count < 1024 * 1024) return `${(count / 1024).toFixed(1)} KiB`;
  if (count < 1024 ** 3) return `${(count / 1024 ** 2).toFixed(1)} MiB`;
  return `${(count / 1024 ** 3).toFixed(1)} GiB`;
}

/** How long something took or is past, to its largest unit: `42 s`, `7 min`, `3 h`, `12 days`. */
export function lasted(seconds: number): string {
  if (seconds < 9.95) return `${number(Math.max(0, seconds), 1)} s`;
  if (seconds < 119.5) return `${Math.round(seconds)} s`;
  if (seconds < 119.5 * 60) return `${Math.round(seconds / 60)} min`;
  if (seconds < 48 * 3600) return `${Math.round(seconds / 3600)} h`;
  return `${Math.round(seconds / 86_400)} days`;
}

/** A word of the API as people read it: `carried_over` becomes `carried over`. */
export function words(text: string): string {
  return text.replaceAll("_", " ").replaceAll("-", " ");
}

/** Square roots of the eigenvalues of a symmetric 3x3 matrix, largest first: half axes of the error ellipsoid. */
export function standardDeviations(matrix: readonly (readonly number[])[]): [number, number, number] {
  const m = matrix.flat();
  const g = (k: number): number => m[k] ?? 0;
  const [a, b, c, d, e, f] = [g(0), g(4), g(8), g(1), g(2), g(5)];
  const off = d * d + e * e + f * f;
  const mean = (a + b + c) / 3;
  const spread = Math.sqrt(((a - mean) ** 2 + (b - mean) ** 2 + (c - mean) ** 2 + 2 * off) / 6);
  if (spread < 1e-15) return [Math.sqrt(Math.max(0, mean)), Math.sqrt(Math.max(0, mean)), Math.sqrt(Math.max(0, mean))];
  const [x, y, z] = [(a - mean) / spread, (b - mean) / spread, (c - mean) / spread];
  const [u, v, w] = [d / spread, e / spread, f / spread];
  const half = (x * (y * z - w * w) - u * (u * z - w * v) + v * (u * w - y * v)) / 2;
  const angle = Math.acos(Math.max(-1, Math.min(1, half))) / 3;
  const root = (k: number): number =>
    Math.sqrt(Math.max(0, mean + 2 * spread * Math.cos(angle + (2 * Math.PI * k) / 3)));
  return [root(0), root(2), root(1)];
}

/** A sentence of the server with times and energies as people write them: `360 s` becomes `0:06:00`, and so does `time is 360`. */
export function inUnits(text: string): string {
  return text
    .replace(/\b(time is) (\d{2,}(?:\.\d+)?)(?![\d.]*\d| s\b)/g, (_, said: string, seconds: string) => `${said} ${clock(Number(seconds))}`)
    .replace(/\b(\d+(?:\.\d+)?(?:e[+-]?\d+)?) J\b/g, (_, joules: string) => energy(Number(joules)))
    .replace(/\b(\d{2,}(?:\.\d+)?(?:e[+-]?\d+)?) s\b/g, (_, seconds: string) => clock(Number(seconds)));
}
