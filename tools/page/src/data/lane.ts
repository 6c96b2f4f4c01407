// What the page has of one channel: pieces of it, some exact, some reduced, and which of them shows a window best.
import type { Column, Frame } from "./frames";
import { Runs } from "./frames";
import { grown } from "./grown";

/** Pieces kept beside the one that spans most, and requests remembered. */
const MOST_PIECES = 8;
/** chosen: so many rows come one by one before the piece that they are added to is asked for anew, reduced. */
const MOST_GROWN = 60_000;
/** How much wider what was asked for may be than the window that it serves. */
export const RESERVE = 4;
/** Rows for so much fewer pixels still show a window well. */
export const LEAST_SHARE = 0.6;
/** The end of what is asked for of a run that goes on: further than any. */
export const OPEN_END_NS = 2 ** 62;

interface Answer {
  readonly from: number;
  readonly to: number;
  readonly pixels: number;
}

export class Lane {
  private pieces: Frame[] = [];
  private answers: Answer[] = [];

  /** Takes rows that were asked for, or all that there are. */
  add(frame: Frame): void {
    if (frame.replaces) this.clear();
    this.pieces = this.pieces.filter((piece) => !(within(piece, frame) && density(piece) <= density(frame)));
    this.pieces.push(frame);
    if (this.pieces.length > MOST_PIECES) {
      const widest = this.pieces.reduce((a, b) => (b.to - b.from > a.to - a.from ? b : a));
      this.pieces.splice(this.pieces.findIndex((piece) => piece !== widest), 1);
    }
  }

  /** Takes new rows of a live run: they go on where those end that were asked for without an end. */
  extend(frame: Frame): void {
    this.pieces = this.pieces.map((piece) => (piece.to >= OPEN_END_NS ? joined(piece, frame) : piece));
    if (this.pieces.every((piece) => piece.to < OPEN_END_NS || piece.count <= MOST_GROWN)) return;
    this.pieces = this.pieces.filter((piece) => piece.to < OPEN_END_NS || piece.count <= MOST_GROWN);
    this.answers = [];
  }

  /** What was asked for has come. */
  answered(answer: Answer): void {
    this.answers = [answer, ...this.answers].slice(0, MOST_PIECES);
  }

  /** The piece that shows a window best: an exact one that covers it, else the finest that does, else what overlaps most. */
  best(from: number, to: number): Frame | undefined {
    const covering = this.pieces.filter((piece) => piece.from <= from && piece.to >= to);
    const exact = covering.filter((piece) => !piece.isReduced);
    if (exact.length) return exact.reduce((a, b) => (a.count <= b.count ? a : b));
    if (covering.length) return covering.reduce((a, b) => (density(a) >= density(b) ? a : b));
    const overlap = (piece: Frame) => Math.min(piece.to, to) - Math.max(piece.from, from);
    return this.pieces.length ? this.pieces.reduce((a, b) => (overlap(a) >= overlap(b) ? a : b)) : undefined;
  }

  /** Whether nothing finer is to be had for a window on so many pixels; `end` is that of the run. */
  suffices(from: number, to: number, pixels: number, end: number): boolean {
    const piece = this.best(from, to);
    if (piece && !piece.isReduced && piece.from <= from && piece.to >= to) return true;
    return this.answers.some((answer) => serves(answer, from, to, pixels, end));
  }

  clear(): void {
    this.pieces = [];
    this.answers = [];
  }
}

/** Whether a request has what a window on so many pixels needs. */
export function serves(asked: Answer, from: number, to: number, pixels: number, end: number): boolean {
  const width = Math.max(1, Math.min(asked.to, end) - asked.from);
  return asked.from <= from && asked.to >= to && (asked.pixels / width) * Math.max(1, to - from) >= pixels * LEAST_SHARE && width <= Math.max(1, to - from) * RESERVE;
}

const within = (inner: Frame, outer: Frame) => inner.from >= outer.from && inner.to <= outer.to;
const density = (frame: Frame) => (frame.isReduced ? frame.count / Math.max(1, frame.to - frame.from) : Infinity);

/** A frame with the rows of another one that are behind its last; what both have stands once. */
export function joined(first: Frame, next: Frame): Frame {
  const skip = firstNew(first, next), columns = new Map<string, Column>();
  for (const [name, column] of first.columns) {
    const width = column instanceof Runs || column.length === first.count ? 1 : first.width;
    columns.set(name, grown(column, next.columns.get(name)!, skip * width));
  }
  const t = columns.get("t_ns") as Float64Array;
  return { ...first, to: Math.max(first.to, next.to), count: t.length, of: first.of + next.of - skip, isReduced: first.isReduced || next.isReduced, replaces: false, t, columns };
}

function firstNew(first: Frame, next: Frame): number {
  const end = first.count ? first.t[first.count - 1]! : -Infinity;
  let skip = 0;
  while (skip < next.count && next.t[skip]! < end) skip++;
  // Rows at the same moment: those that the first one has already.
  let same = 0;
  while (same < first.count && first.t[first.count - 1 - same] === end) same++;
  while (same-- > 0 && skip < next.count && next.t[skip] === end) skip++;
  return skip;
}
