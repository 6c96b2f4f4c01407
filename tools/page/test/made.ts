// Frames and stores made by hand, for tests.
import type { Column, Frame, KindName } from "../src/data/frames";
import { Runs } from "../src/data/frames";
import { type Source, Store } from "../src/data/store";
import type { ChannelHeader, PageHeader } from "../src/generated/view";

export function frame(kind: KindName, t: readonly number[], columns: Readonly<Record<string, Column>>, more: Partial<Frame> = {}): Frame {
  const times = Float64Array.from(t);
  return {
    kind, channel: 0, count: t.length, of: t.length, from: t[0] ?? 0, to: t.at(-1) ?? 0, width: 1, isReduced: false, replaces: false, t: times, columns: new Map<string, Column>([["t_ns", times], ...Object.entries(columns)]), ...more,
  };
}

export function levels(rows: readonly (readonly [number, number])[], more: Partial<Frame> = {}, edges: readonly number[] = rows.map(() => 1)): Frame {
  return frame("levels", rows.map(([t]) => t), { level: Uint32Array.from(rows, ([, level]) => level), edges: Uint32Array.from(edges) }, more);
}

export function samples(rows: readonly (readonly [number, number])[], more: Partial<Frame> = {}): Frame {
  return frame("samples", rows.map(([t]) => t), { value: Float64Array.from(rows, ([, value]) => value) }, more);
}

export function runs(texts: readonly string[]): Runs<string> {
  const parts = texts.map((text) => new TextEncoder().encode(text)), ends: number[] = [];
  for (const part of parts) ends.push((ends.at(-1) ?? 0) + part.length);
  const blob = new Uint8Array(ends.at(-1) ?? 0);
  parts.forEach((part, n) => blob.set(part, n ? ends[n - 1]! : 0));
  return new Runs(Uint32Array.from(parts, (_, n) => n), Uint32Array.from(ends), blob, (bytes) => new TextDecoder().decode(bytes));
}

export function channel(id: number, kind: string, more: Partial<ChannelHeader> = {}): ChannelHeader {
  return { id, name: `${kind} ${id}`, kind, unit: "", group: "", source: "", doc: "", of: -1, width: 1, is_stepped: false, mark: null, sensors: [], cone_rad: 0, range_m: 0, states: [], transitions: [], ...more };
}

export function header(channels: readonly ChannelHeader[], end_ns = 1000, more: Partial<PageHeader> = {}): PageHeader {
  return { format: 1, title: "run", verdict: "", standing: "", lead: "", why: "", start_ns: 0, end_ns, is_live: false, channels, world: null, hands: null, robot_hands: [], robots: [], sections: [], panels: [], left_out: [], footer: "", ...more };
}

export function store(channels: readonly ChannelHeader[], end_ns = 1000, source?: Source): Store {
  return new Store(header(channels, end_ns), source);
}
