// Times and numbers as a person reads them, and the ticks of an axis.

const UNITS = [[1e9, "s"], [1e6, "ms"], [1e3, "µs"], [1, "ns"]] as const;

/** A step of 1, 2 or 5 times a power of ten, so that at most `most` of it are in a span. */
export function roundStep(span: number, most: number): number {
  const least = span / Math.max(1, most), power = 10 ** Math.floor(Math.log10(least));
  return [1, 2, 5, 10].map((times) => times * power).find((step) => step >= least * (1 - 1e-9))!;
}

/** Multiples of a step within bounds, without sums of rounding. */
export function ticks(from: number, to: number, step: number): number[] {
  const found: number[] = [], slack = step * 1e-9;
  for (let n = Math.ceil((from - slack) / step); n * step <= to + slack; n++) found.push(Number((n * step).toPrecision(15)));
  return found;
}

/** How many decimals show a step. */
export function decimals(step: number): number {
  return Math.max(0, -Math.floor(Math.log10(step) + 1e-9));
}

/** A length of time with the unit that suits it: "1.25 ms". */
export function duration(ns: number): string {
  const size = Math.abs(ns), [scale, unit] = UNITS.find(([scale]) => size >= scale) ?? UNITS[3];
  return `${trimmed(ns / scale, scale === 1 ? 3 : 4)} ${unit}`;
}

/** A moment of the run, in seconds: "12.345 s"; `step_ns` says how fine it is meant. */
export function moment(ns: number, step_ns = 1e6): string {
  const digits = Math.min(9, Math.max(3, decimals(step_ns / 1e9)));
  const [whole, part] = (ns / 1e9).toFixed(digits).split(".") as [string, string];
  return `${whole}.${part.replace(/(...)(?=.)/g, "$1\u2009")} s`;
}

/** A moment as a screen reader says it. */
export function spoken(ns: number): string {
  return `${(ns / 1e9).toFixed(3)} seconds`;
}

export function frequency(ns: number): string {
  if (!ns) return "";
  const hz = 1e9 / Math.abs(ns), [scale, unit] = ([[1e6, "MHz"], [1e3, "kHz"], [1, "Hz"], [1e-3, "mHz"]] as const).find(([scale]) => hz >= scale) ?? [1e-3, "mHz"];
  return `${trimmed(hz / scale, 4)} ${unit}`;
}

/** A number with so many significant digits, without zeros at its end. */
export function trimmed(value: number, digits: number): string {
  if (!Number.isFinite(value)) return "–";
  const text = Math.abs(value) >= 10 ** digits ? value.toFixed(0) : value.toPrecision(digits);
  return text.includes("e") ? text : text.includes(".") ? text.replace(/\.?0+$/, "") : text;
}

/** What is less than this is 0 that was computed: no channel measures so finely. */
const LEAST = 1e-9;

/** A value of a channel with its unit. */
export function quantity(measured: number, unit: string): string {
  const value = Math.abs(measured) < LEAST ? 0 : measured;
  return unit ? `${trimmed(value, 5)} ${unit}` : trimmed(value, 5);
}

/** The label of a tick of the time axis: whole seconds for coarse ones, a distance from `base` for fine ones. */
export function tickLabel(t: number, step: number, base: number): string {
  if (step >= 1e6) return `${(t / 1e9).toFixed(Math.max(0, decimals(step / 1e9)))} s`;
  const [scale, unit] = UNITS.find(([scale]) => step >= scale) ?? UNITS[3];
  return `+${((t - base) / scale).toFixed(0)} ${unit}`;
}

/** From where fine ticks count: a round moment at or before the window's begin. */
export function tickBase(from: number, step: number): number {
  return step >= 1e6 ? 0 : Math.floor(from / (1000 * step)) * 1000 * step;
}

const TWO = (byte: number) => byte.toString(16).padStart(2, "0");
export function hex(bytes: Uint8Array): string {
  return Array.from(bytes, TWO).join(" ");
}
