// What the page has of one channel: pieces of it, some exact, some reduced, and which of them shows a window best.
import { type Column, type Frame, type Numbers, Runs } from "./frames";

/** Pieces kept beside the one that spans most. */
const MOST_PIECES = 8;

export class Lane {
  private pieces: Frame[] = [];

  /** Takes a frame; a live one that begins where the last ended goes on with it. */
  add(frame: Frame, isLive = false): void {
    if (frame.replaces) {
      this.pieces = [frame];
      return;
    }
    if (isLive) {
      const last = this.pieces.findIndex((piece) => piece.to <= frame.from && frame.from - piece.to <= 1 || piece.to === frame.from);
      if (last >= 0) {
        this.pieces[last] = joined(this.pieces[last]!, frame);
        return;
      }
    }
    this.pieces = this.pieces.filter((piece) => !(within(piece, frame) && density(piece) <= density(frame)));
    this.pieces.push(frame);
    if (this.pieces.length > MOST_PIECES) {
      const widest = this.pieces.reduce((a, b) => (b.to - b.from > a.to - a.from ? b : a));
      this.pieces.splice(this.pieces.findIndex((piece) => piece !== widest), 1);
    }
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

  /** Whether nothing finer is to be asked for, of a window drawn on so many pixels. */
  suffices(from: number, to: number, pixels: number): boolean {
    const piece = this.best(from, to);
    if (!piece || piece.from > from || piece.to < to) return false;
    return !piece.isReduced || piece.to - piece.from <= (to - from) * RESERVE && piece.count >= pixels / 2;
  }

  clear(): void {
    this.pieces = [];
  }
}

/** How much wider a piece may be than the window that it serves. */
export const RESERVE = 4;

const within = (inner: Frame, outer: Frame) => inner.from >= outer.from && inner.to <= outer.to;
const density = (frame: Frame) => (frame.isReduced ? frame.count / Math.max(1, frame.to - frame.from) : Infinity);

/** A frame and what follows it as one; what both have of their common border stands once. */
export function joined(first: Frame, next: Frame): Frame {
  const skip = firstNew(first, next);
  const columns = new Map<string, Column>();
  for (const [name, column] of first.columns) {
    const wide = column instanceof Runs ? 1 : column.length / Math.max(1, first.count);
    columns.set(name, joinedColumn(column, next.columns.get(name)!, skip * Math.max(1, Math.round(wide) || 1)));
  }
  const t = columns.get("t_ns") as Float64Array;
  return { ...first, to: next.to, count: t.length, of: first.of + next.of - skip, isReduced: first.isReduced || next.isReduced, replaces: false, t, columns };
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

function joinedColumn(first: Column, next: Column, skip: number): Column {
  if (first instanceof Runs) return first.joined(next as never, skip);
  const tail = (next as Numbers).subarray(skip);
  const Kind = first.constructor as new (length: number) => Numbers;
  const all = new Kind(first.length + tail.length);
  all.set(first);
  all.set(tail, first.length);
  return all;
}
