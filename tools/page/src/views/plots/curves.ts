// Which curves stand in which chart, and their points in a window of time.
import type { AlignedData } from "uplot";
import uPlot from "uplot";
import { type Frame, numbers } from "../../data/frames";
import { firstFrom, lastAt } from "../../data/search";
import type { Store } from "../../data/store";
import type { ChannelHeader } from "../../generated/view";

export interface Curve {
  readonly key: string;
  readonly name: string;
  readonly channel: ChannelHeader;
  /** Of the channel's columns, and what it is multiplied with for the unit. */
  readonly column: string;
  readonly factor: number;
  readonly isStepped: boolean;
  readonly mark: number | null;
}

export interface Chart {
  readonly title: string;
  readonly unit: string;
  readonly curves: readonly Curve[];
}

/** What of a pose is drawn over time. */
const POSE = [["position", "m", [["x", "x_m", 1], ["y", "y_m", 1]]], ["heading", "°", [["heading", "heading_rad", 180 / Math.PI]]]] as const;

/** One chart for each group and unit, in the header's order, variables of the program first; of poses those of position and heading at the end. */
export function chartsOf(store: Store): Chart[] {
  const charts = new Map<string, { title: string; unit: string; curves: Curve[] }>();
  const put = (title: string, unit: string, curve: Curve) => {
    const key = `${title} ${unit}`;
    if (!charts.has(key)) charts.set(key, { title, unit, curves: [] });
    charts.get(key)!.curves.push(curve);
  };
  for (const channel of store.chosen) {
    if (channel.kind !== "samples") continue;
    const name = [channel.source, channel.name].filter(Boolean).join(" ");
    put(channel.group || channel.name, channel.unit, { key: `${channel.id}`, name, channel, column: "value", factor: 1, isStepped: channel.is_stepped, mark: channel.mark });
  }
  for (const [title, unit, parts] of POSE) for (const channel of store.chosen.filter(({ kind }) => kind === "pose")) for (const [name, column, factor] of parts)
    put(title, unit, { key: `${channel.id} ${column}`, name: [channel.source, name].filter(Boolean).join(" "), channel, column, factor, isStepped: false, mark: null });
  const watched = (chart: Chart) => Number(chart.unit !== "" || !chart.curves.every((curve) => curve.channel.kind === "samples"));
  return [...charts.values()].sort((a, b) => watched(a) - watched(b)).flatMap(apart);
}

/** Curves that are told apart in one chart. */
const MOST_CURVES = 4;

/** A chart; of too many curves of several robots, one for each robot. */
function apart(chart: Chart): Chart[] {
  const sources = [...new Set(chart.curves.map((curve) => curve.channel.source))];
  if (chart.curves.length <= MOST_CURVES || sources.length < 2) return [chart];
  return sources.map((source) => ({ title: [source, chart.title].filter(Boolean).join(" "), unit: chart.unit, curves: chart.curves.filter((curve) => curve.channel.source === source) }));
}

/**
 * Points of a curve in a window, at most some a pixel: of more, the least and greatest of each. Times in seconds.
 *
 * What goes on beyond the window ends at its edge: dashes of a line that is a million times wider take a browser seconds.
 */
export function points(frame: Frame, curve: Curve, from: number, to: number, pixels: number): [Float64Array, Float64Array] {
  const values = numbers(frame, curve.column), { t } = frame, first = firstFrom(t, from), last = firstFrom(t, to), xs: number[] = [], ys: number[] = [];
  const put = (at: number, value: number) => {
    xs.push(at / 1e9);
    ys.push(value * curve.factor);
  };
  const between = (at: number, row: number) => curve.isStepped || row + 1 >= frame.count ? values[row]! : values[row]! + ((at - t[row]!) / (t[row + 1]! - t[row]!)) * (values[row + 1]! - values[row]!);
  if (first > 0 && (first === frame.count || t[first]! > from)) {
    if (first < frame.count || curve.isStepped) put(from, between(from, first - 1));
  }
  const rows = last - first <= 4 * pixels ? undefined : extremes(t, values, first, last, pixels);
  for (let n = 0; n < (rows?.length ?? last - first); n++) {
    const row = rows ? rows[n]! : first + n;
    put(t[row]!, values[row]!);
  }
  if (last > 0 && (last < frame.count || curve.isStepped)) {
    const end = last < frame.count ? to : Math.min(to, Math.max(frame.to, t[last - 1]!));
    if (!xs.length || end / 1e9 > xs.at(-1)!) put(end, between(end, last - 1));
  }
  return [Float64Array.from(xs), Float64Array.from(ys)];
}

/** Rows that show the least and greatest of each pixel, in order. */
export function extremes(times: Float64Array, values: ArrayLike<number>, first: number, last: number, pixels: number): number[] {
  const found: number[] = [], begin = times[first]!, span = Math.max(1, times[last - 1]! - begin);
  for (let row = first; row < last;) {
    const pixel = Math.floor(((times[row]! - begin) / span) * pixels);
    let least = row, most = row, next = row + 1;
    for (; next < last && Math.floor(((times[next]! - begin) / span) * pixels) <= pixel; next++) {
      if (values[next]! < values[least]!) least = next;
      if (values[next]! > values[most]!) most = next;
    }
    for (const one of [...new Set([row, Math.min(least, most), Math.max(least, most), next - 1])].sort((a, b) => a - b)) found.push(one);
    row = next;
  }
  return found;
}

/** All curves of a chart on one row of times, as uPlot has it. */
export function aligned(store: Store, chart: Chart, from: number, to: number, pixels: number): AlignedData {
  const tables = chart.curves.map((curve): AlignedData => {
    const frame = store.rows(curve.channel.id, from, to, pixels);
    return frame ? points(frame, curve, from, to, pixels) : [[], []];
  });
  return tables.length === 1 ? tables[0]! : uPlot.join(tables);
}

/** The value of a curve at a time: that of the row in force, or on the way to the next one. */
export function valueAt(store: Store, curve: Curve, t: number): number | undefined {
  const frame = store.rows(curve.channel.id, t, t) ?? store.whole(curve.channel.id);
  if (!frame?.count) return undefined;
  const low = lastAt(frame.t, t), values = numbers(frame, curve.column);
  if (low < 0) return undefined;
  const high = Math.min(low + 1, frame.count - 1), step = frame.t[high]! - frame.t[low]!;
  const part = curve.isStepped || !step ? 0 : (t - frame.t[low]!) / step;
  return (values[low]! + part * (values[high]! - values[low]!)) * curve.factor;
}
