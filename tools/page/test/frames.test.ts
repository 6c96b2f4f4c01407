// The decoder, against frames that Python packed.
import { readFileSync } from "node:fs";
import { describe, expect, it } from "vitest";
import { type Column, type Frame, FrameError, frameAt, framesIn, Runs } from "../src/data/frames";
import { joined, Lane, OPEN_END_NS } from "../src/data/lane";
import { KINDS } from "../src/generated/view";

interface Expected {
  readonly kind: string; readonly channel: number; readonly count: number; readonly of: number; readonly width: number; readonly from: number; readonly to: number;
  readonly isReduced: boolean; readonly replaces: boolean; readonly columns: Readonly<Record<string, readonly (number | string | null)[]>>;
}
const made = JSON.parse(readFileSync(new URL("frames.json", import.meta.url), "utf8")) as { frames: readonly Expected[]; data: string };
const bytes = () => {
  const found = Buffer.from(made.data, "base64");
  return found.buffer.slice(found.byteOffset, found.byteOffset + found.byteLength);
};
const plain = (frame: Frame, name: string): (number | string | null)[] => {
  const column = frame.columns.get(name)!;
  if (column instanceof Runs) return Array.from({ length: column.length }, (_, row) => { const value = column.at(row); return typeof value === "string" ? value : Buffer.from(value).toString("hex"); });
  return Array.from(column, (value) => (Number.isNaN(value) ? null : value));
};

describe("a frame", () => {
  const frames = framesIn(bytes());

  it("is there of every kind, with rows and without", () => {
    expect(frames.map((frame) => frame.kind)).toEqual([...KINDS, ...KINDS].map((kind) => kind.name));
  });

  it.each(made.frames.map((expected, n) => [`${expected.kind} ${expected.count}`, expected, n] as const))("%s has the rows that Python packed", (_, expected, n) => {
    const frame = frames[n]!, { columns, ...head } = expected;
    expect({ kind: frame.kind, channel: frame.channel, count: frame.count, of: frame.of, width: frame.width, from: frame.from, to: frame.to, isReduced: frame.isReduced, replaces: frame.replaces }).toEqual(head);
    for (const [name, values] of Object.entries(columns)) expect(plain(frame, name)).toEqual(values);
  });

  it("is refused when it is cut at any byte", () => {
    const all = bytes(), [, end] = frameAt(all, 0);
    for (let length = 0; length < end; length++) expect(() => frameAt(all.slice(0, length), 0)).toThrow(FrameError);
  });

  it("is refused with a place of a text that is not there", () => {
    const all = bytes();
    let start = 0;
    for (let next = start; ; start = next) {
      const [frame, end] = frameAt(all, start);
      if (frame?.kind === "text") break;
      next = end;
    }
    const [frame] = frameAt(all, start), { count } = frame!, head = 48 + 8 * count + Math.ceil(count / 8) * 8;
    new DataView(all).setUint32(start + head + 8, 99, true);
    expect(() => frameAt(all, start)).toThrow(/not there/);
  });

  it("is refused with a size that is none", () => {
    for (const by of [-8, -1, 1, 4]) {
      const all = bytes(), head = new DataView(all);
      head.setUint32(24, head.getUint32(24, true) + by, true);
      expect(() => frameAt(all, 0)).toThrow(FrameError);
    }
  });

  it("of a kind that a package added is passed over", () => {
    const all = bytes();
    new DataView(all).setUint8(5, 64);
    expect(framesIn(all)).toHaveLength(frames.length - 1);
  });
});

describe("rows of a live run", () => {
  const frames = framesIn(bytes());

  it.each(frames.slice(0, KINDS.length).map((frame) => [frame.kind, frame] as const))("%s go on where they ended", (_, frame) => {
    const twice = joined(frame, { ...frame, from: frame.to, to: frame.to + 10 });
    // All rows of the second are at or before the end of the first: none is new.
    expect(twice.count).toBe(frame.count);
    for (const name of twice.columns.keys()) expect(plain(twice, name)).toEqual(plain(frame, name));
  });

  it("are joined with texts of both", () => {
    const text = frames.find((frame) => frame.kind === "text")!, later = text.t.map((t) => t + text.to + 10);
    const all = joined(text, { ...text, t: later, columns: new Map([...text.columns, ["t_ns", later]]) });
    expect(all.count).toBe(2 * text.count);
    expect(plain(all, "text")).toEqual([...plain(text, "text"), ...plain(text, "text")]);
  });

  it("are added to what was asked for without an end, and replace all when the frame says so", () => {
    const lane = new Lane(), text = frames.find((frame) => frame.kind === "text")!, later = (n: number): Frame => {
      const t = text.t.map((_, row) => text.to + 100 * n + row);
      return { ...text, replaces: false, from: t[0]!, to: t.at(-1)!, t, columns: new Map([...text.columns, ["t_ns", t]]) };
    };
    lane.add({ ...text, replaces: false, to: OPEN_END_NS });
    const rows = () => lane.best(text.from, text.to + 1e15)!, first = rows();
    for (let n = 1; n < 40; n++) lane.extend(later(n));
    expect(rows().count).toBe(40 * text.count);
    expect(plain(rows(), "text")).toEqual(Array.from({ length: 40 }, () => plain(text, "text")).flat());
    expect(plain(first, "text")).toEqual(plain(text, "text"));
    lane.add({ ...text, replaces: true, to: 7 });
    expect(lane.best(0, 7)!.to).toBe(7);
  });

  it("of the moment that it ended with are added once", () => {
    const levels = frames.find((frame) => frame.kind === "levels")!, of = (t: number[]): Frame => {
      const level = Uint32Array.from(t.keys());
      return { ...levels, replaces: false, count: t.length, t: Float64Array.from(t), columns: new Map<string, Column>([["t_ns", Float64Array.from(t)], ["level", level], ["edges", level]]) };
    };
    expect(Array.from(joined(of([1, 5]), of([5, 5, 6])).t)).toEqual([1, 5, 5, 6]);
    expect(Array.from(joined(of([1, 5, 5]), of([5, 5, 6])).t)).toEqual([1, 5, 5, 6]);
    expect(plain(joined(of([1, 5]), of([5, 5, 6])), "level")).toEqual([0, 1, 1, 2]);
  });

  it("are asked for anew when they are too many", () => {
    const lane = new Lane(), few = { ...frames.find((frame) => frame.kind === "levels")!, isReduced: false, replaces: false, to: OPEN_END_NS };
    lane.add(few);
    lane.answered({ from: few.from, to: few.to, pixels: 100 });
    expect(lane.suffices(0, 1e15, 100, 1e15)).toBe(true);
    const t = Float64Array.from({ length: 61_000 }, (_, n) => few.t.at(-1)! + 1 + n), level = new Uint32Array(t.length);
    lane.extend({ ...few, count: t.length, of: t.length, from: t[0]!, to: t.at(-1)!, t, columns: new Map<string, Column>([["t_ns", t], ["level", level], ["edges", level]]) });
    expect(lane.suffices(0, 1e15, 100, 1e15)).toBe(false);
  });
});
