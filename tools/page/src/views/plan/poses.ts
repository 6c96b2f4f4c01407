// Where a robot is at a time, and its path as strokes of one colour each.
import { type Frame, numbers } from "../../data/frames";
import { lastAt } from "../../data/search";

export interface Place {
  readonly x: number;
  readonly y: number;
  readonly z: number;
  readonly heading: number;
  readonly pitch: number;
}

/** The place at a time, on the straight way between two rows. */
export function placeAt(frame: Frame, t: number): Place | undefined {
  if (!frame.count) return undefined;
  const low = Math.max(0, lastAt(frame.t, t)), high = Math.min(frame.count - 1, low + 1);
  const step = frame.t[high]! - frame.t[low]!, part = step > 0 ? Math.min(1, Math.max(0, (t - frame.t[low]!) / step)) : 0;
  const between = (name: string) => numbers(frame, name)[low]! + part * (numbers(frame, name)[high]! - numbers(frame, name)[low]!);
  const headings = numbers(frame, "heading_rad");
  return { x: between("x_m"), y: between("y_m"), z: between("z_m"), pitch: between("pitch_rad"), heading: headings[low]! + part * turn(headings[low]!, headings[high]!) };
}

/** The shorter way from one heading to another. */
export function turn(from: number, to: number): number {
  const full = 2 * Math.PI, by = (to - from) % full;
  return by > Math.PI ? by - full : by < -Math.PI ? by + full : by;
}

/** A part of a path that is drawn in one colour: rows from `first` to `last`, both included, and its share of the scale. */
export interface Stroke {
  readonly first: number;
  readonly last: number;
  readonly share: number;
}

export interface ColouredPath {
  readonly strokes: readonly Stroke[];
  /** What 0 and 1 of the scale are: seconds, or metres a second. */
  readonly least: number;
  readonly most: number;
  readonly unit: string;
}

/** chosen: strokes of a path, so that colours change smoothly and drawing stays quick. */
const MOST_STROKES = 240;

export function colouredPath(frame: Frame, by: "time" | "speed"): ColouredPath {
  const rows = Math.max(1, Math.ceil((frame.count - 1) / MOST_STROKES)), strokes: Stroke[] = [], values: number[] = [];
  const xs = numbers(frame, "x_m"), ys = numbers(frame, "y_m");
  for (let first = 0; first < frame.count - 1; first += rows) {
    const last = Math.min(frame.count - 1, first + rows);
    if (by === "time") values.push(frame.t[first]! / 1e9);
    else {
      let way = 0;
      for (let n = first; n < last; n++) way += Math.hypot(xs[n + 1]! - xs[n]!, ys[n + 1]! - ys[n]!);
      values.push(way / Math.max(1e-9, (frame.t[last]! - frame.t[first]!) / 1e9));
    }
    strokes.push({ first, last, share: 0 });
  }
  const least = by === "time" ? (frame.t[0] ?? 0) / 1e9 : 0;
  const most = by === "time" ? (frame.t[frame.count - 1] ?? 0) / 1e9 : Math.max(0.001, ...values);
  return {
    strokes: strokes.map((stroke, n) => ({ ...stroke, share: (values[n]! - least) / Math.max(1e-9, most - least) })),
    least, most, unit: by === "time" ? "s" : "m/s",
  };
}
