// Columns that grow at their end: copied only when there is no room behind them, so that a live run costs what is new of it.
import { type Column, type Numbers, Runs } from "./frames";

/** How much of a buffer is used; those that are not known here belong to the wire and are never written to. */
const used = new WeakMap<ArrayBufferLike, number>();

/** Numbers with more behind them; the first ones stay valid. */
export function grownNumbers<T extends Numbers>(first: T, more: T): T {
  const Kind = first.constructor as new (buffer: ArrayBufferLike, offset: number, length: number) => T;
  const size = first.BYTES_PER_ELEMENT, length = first.length + more.length, end = first.byteOffset + first.byteLength;
  let { buffer, byteOffset } = first as { buffer: ArrayBufferLike; byteOffset: number };
  if (used.get(buffer) !== end || buffer.byteLength < end + more.byteLength) {
    buffer = new ArrayBuffer(Math.max(256, 2 * length * size));
    byteOffset = 0;
    new Kind(buffer, 0, length).set(first);
  }
  const all = new Kind(buffer, byteOffset, length);
  all.set(more, first.length);
  used.set(buffer, byteOffset + all.byteLength);
  return all;
}

/** A column with all of another one but its first `skip` cells behind it. */
export function grown(first: Column, next: Column, skip: number): Column {
  if (first instanceof Runs) return first.joined(next as never, skip, grownNumbers);
  return grownNumbers(first, (next as Numbers).subarray(skip));
}
