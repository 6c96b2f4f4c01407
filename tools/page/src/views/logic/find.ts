// Looks for an edge, a value, a short pulse or a text in the rows of a channel, and measures the pulse at a time.
import { type Frame, numbers, Runs } from "../../data/frames";
import { lastAt } from "../../data/search";
import type { Store } from "../../data/store";

export type Sought =
  | { readonly what: "rising" | "falling" | "change" }
  | { readonly what: "value"; readonly value: number }
  | { readonly what: "shorter"; readonly ns: number }
  | { readonly what: "text"; readonly text: string };

/** The time of the nearest row after (1) or before (-1) a time that is sought; undefined where there is none in these rows. */
export function findIn(frame: Frame, t: number, way: 1 | -1, sought: Sought): number | undefined {
  const matches = matcher(frame, sought);
  let row = lastAt(frame.t, t);
  if (way === 1) row++;
  else while (row >= 0 && frame.t[row]! >= t) row--;
  for (; row >= 0 && row < frame.count; row += way) if (matches(row)) return frame.t[row]!;
  return undefined;
}

function matcher(frame: Frame, sought: Sought): (row: number) => boolean {
  if (sought.what === "text") {
    const text = sought.text.toLowerCase(), hits = new Map<string, Set<number>>();
    const columns = [...frame.columns].filter((column): column is [string, Runs<string>] => column[1] instanceof Runs && column[0] !== "data" && column[0] !== "fields");
    for (const [name, runs] of columns) hits.set(name, new Set(Array.from({ length: runs.distinct }, (_, n) => n).filter((n) => runs.value(n).toLowerCase().includes(text))));
    return (row) => columns.some(([name, runs]) => hits.get(name)!.has(runs.place(row)));
  }
  const values = numbers(frame, frame.kind === "samples" ? "value" : frame.kind === "state" ? "state" : "level");
  if (!(values as unknown)) return () => true; // rows of text: each is a change
  const differs = (row: number) => row > 0 && values[row] !== values[row - 1];
  switch (sought.what) {
    case "rising": return (row) => row > 0 && values[row]! > values[row - 1]!;
    case "falling": return (row) => row > 0 && values[row]! < values[row - 1]!;
    case "change": return differs;
    case "value": return (row) => values[row] === sought.value && (row === 0 || differs(row));
    case "shorter": return (row) => differs(row) && row + 1 < frame.count && frame.t[row + 1]! - frame.t[row]! < sought.ns;
  }
}

/** chosen: so many requests a search makes of a server before it gives up. */
const MOST_REQUESTS = 400;

/** As `findIn`, over the whole run: of what is here reduced, exact rows are asked for piece by piece. */
export async function find(store: Store, channel: number, t: number, way: 1 | -1, sought: Sought): Promise<number | undefined> {
  const { start_ns, end_ns } = store.header.peek(), all = await store.exact(channel, start_ns, end_ns); // of a wire out of sight nothing is here
  if (!all) return undefined;
  if (!all.isReduced || !store.canAsk) return findIn(all, t, way, sought);
  let width = Math.max(1000, ((end_ns - start_ns) * 2000) / Math.max(1, all.of)), at = t;
  for (let n = 0; n < MOST_REQUESTS && at >= start_ns && at <= end_ns; n++) {
    const from = Math.max(start_ns, way === 1 ? at - 1 : at - width), to = Math.min(end_ns, way === 1 ? at + width : at + 1);
    const frame = await store.exact(channel, from, to);
    if (!frame || frame.isReduced) {
      if (width < 100) return undefined;
      width /= 4;
      continue;
    }
    const found = findIn(frame, t, way, sought);
    if (found !== undefined && found >= from && found <= to) return found;
    at = way === 1 ? to + 1 : from - 1;
    width *= 1.5;
  }
  return undefined;
}

/** The pulse of a wire at a time: from when to when its value stands, and the time from its rise to the next; undefined where rows are left out; the run has no more than until `end`. */
export function pulseAt(frame: Frame, t: number, end: number): { from: number; to: number; value: number; period: number | undefined } | undefined {
  const row = lastAt(frame.t, t), values = numbers(frame, "level");
  if (row < 0 || numbers(frame, "edges")[row]! > 1) return undefined;
  let first = row, last = row + 1;
  while (first > 0 && values[first - 1] === values[row]) first--;
  while (last < frame.count && values[last] === values[row]) last++;
  if (last >= frame.count) return { from: frame.t[first]!, to: Math.min(end, frame.to), value: values[row]!, period: undefined };
  let next = last + 1;
  while (next < frame.count && values[next] === values[last]) next++;
  return { from: frame.t[first]!, to: frame.t[last]!, value: values[row]!, period: next < frame.count ? frame.t[next]! - frame.t[first]! : undefined };
}

/** A length of time as a person writes it: "2 us", "10ns", "0.5 ms"; NaN where it is none. */
export function parsedDuration(text: string): number {
  const found = /^\s*([\d.]+)\s*(ns|us|µs|ms|s)?\s*$/.exec(text);
  if (!found) return NaN;
  return Number(found[1]) * { ns: 1, us: 1e3, "µs": 1e3, ms: 1e6, s: 1e9 }[(found[2] ?? "us") as "ns" | "us" | "µs" | "ms" | "s"];
}

/** A number as a person writes it: decimal, 0x…, 0b…; NaN where it is none. */
export function parsedValue(text: string): number {
  const trimmed = text.trim();
  return trimmed ? Number(trimmed) : NaN;
}
