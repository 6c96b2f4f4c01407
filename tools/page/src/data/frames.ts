// Frames of the recording: bytes as p2os/view/frames.py packs them, as columns. Numbers lie on the bytes; nothing is parsed.
//
// Times are 64-bit integers on the wire and doubles here: exact up to 104 days.
import { FLAGS, FORMAT, KINDS, type Cells, type ChannelKind, type KindColumns } from "../generated/view";

export type KindName = keyof KindColumns;

/** Bytes that are no frame of this format. */
export class FrameError extends Error {}

/** Texts or runs of bytes, each distinct one once; decoded when it is asked for. */
export class Runs<T> {
  readonly length: number;

  constructor(
    private readonly places: Uint32Array,
    private readonly ends: Uint32Array,
    private readonly blob: Uint8Array,
    private readonly decode: (bytes: Uint8Array) => T,
    private readonly known: (T | undefined)[] = [],
  ) {
    this.length = places.length;
  }

  /** How many distinct ones there are. */
  get distinct(): number {
    return this.ends.length;
  }

  /** Which distinct one a row has: rows with one place have one value. */
  place(row: number): number {
    return this.places[row]!;
  }

  /** A distinct one. */
  value(place: number): T {
    let found = this.known[place];
    if (found === undefined) {
      found = this.decode(this.blob.subarray(place ? this.ends[place - 1] : 0, this.ends[place]));
      this.known[place] = found;
    }
    return found;
  }

  at(row: number): T {
    return this.value(this.places[row]!);
  }

  /** These rows and some more: all of `next` but its first `skip`; `grow` puts numbers behind others. */
  joined(next: Runs<T>, skip: number, grow: <N extends Numbers>(first: N, more: N) => N): Runs<T> {
    const places = next.places.subarray(skip).map((place) => place + this.ends.length), ends = next.ends.map((end) => end + this.blob.length);
    return new Runs(grow(this.places, places), grow(this.ends, ends), grow(this.blob, next.blob), this.decode, this.known);
  }
}

export type Numbers = Float64Array | Float32Array | Uint32Array | Uint8Array;
export type Column = Numbers | Runs<string> | Runs<Uint8Array>;

/** Rows of one channel from one time to another. */
export interface Frame {
  readonly kind: KindName;
  readonly channel: number;
  readonly count: number;
  /** Rows there are in that time: more than `count` where some are left out. */
  readonly of: number;
  readonly from: number;
  readonly to: number;
  /** Cells a row of a wide column. */
  readonly width: number;
  readonly isReduced: boolean;
  readonly replaces: boolean;
  /** Times of the rows, ns. */
  readonly t: Float64Array;
  readonly columns: ReadonlyMap<string, Column>;
}

/** A column of numbers. */
export function numbers(frame: Frame, name: string): Numbers {
  return frame.columns.get(name) as Numbers;
}

/** A column of texts. */
export function texts(frame: Frame, name: string): Runs<string> {
  return frame.columns.get(name) as Runs<string>;
}

const HEAD_BYTES = 48;
const MAGIC = 0x46563250; // "P2VF"
const UTF8 = new TextDecoder("utf-8");
const BY_NUMBER = new Map<number, ChannelKind>(KINDS.map((kind) => [kind.number, kind]));

/** The frame that begins at a place of a buffer, and where the next one begins; undefined where it is of a kind that this page does not know. */
export function frameAt(buffer: ArrayBuffer, start: number): [Frame | undefined, number] {
  if (start % 8 || buffer.byteLength - start < HEAD_BYTES) throw new FrameError(`no frame at ${start} of ${buffer.byteLength} bytes`);
  const head = new DataView(buffer, start);
  if (head.getUint32(0, true) !== MAGIC || head.getUint8(4) !== FORMAT) throw new FrameError("a head of another format");
  const known = BY_NUMBER.get(head.getUint8(5)), flags = head.getUint8(6);
  const count = head.getUint32(12, true), width = head.getUint32(16, true), size = head.getUint32(24, true);
  if (size < HEAD_BYTES || size % 8 || start + size > buffer.byteLength) throw new FrameError(`a frame of ${size} bytes in ${buffer.byteLength - start}`);
  if (!known) return [undefined, start + size];
  const reader = new Reader(buffer, start + HEAD_BYTES, start + size), columns = new Map<string, Column>();
  for (const column of known.columns) columns.set(column.name, reader.column(column.cells, column.isWide ? count * width : count));
  if (reader.place !== start + size) throw new FrameError("bytes behind the last column");
  const frame: Frame = {
    kind: known.name as KindName, channel: head.getUint32(8, true), count, of: head.getUint32(20, true), width,
    from: Number(head.getBigInt64(32, true)), to: Number(head.getBigInt64(40, true)),
    isReduced: (flags & FLAGS.REDUCED) !== 0, replaces: (flags & FLAGS.REPLACES) !== 0,
    t: columns.get("t_ns") as Float64Array, columns,
  };
  return [frame, start + size];
}

/** All frames of a buffer, one behind the other. */
export function framesIn(buffer: ArrayBuffer): Frame[] {
  const found: Frame[] = [];
  for (let place = 0; place < buffer.byteLength;) {
    const [frame, next] = frameAt(buffer, place);
    if (frame) found.push(frame);
    place = next;
  }
  return found;
}

class Reader {
  constructor(
    private readonly buffer: ArrayBuffer,
    public place: number,
    private readonly end: number,
  ) {}

  column(cells: Cells, count: number): Column {
    switch (cells) {
      case "i64": return doubles(new Uint32Array(this.buffer, this.take(8 * count), 2 * count));
      case "f64": return new Float64Array(this.buffer, this.take(8 * count), count);
      case "f32": return new Float32Array(this.buffer, this.take(4 * count), count);
      case "u32": return new Uint32Array(this.buffer, this.take(4 * count), count);
      case "u8": return new Uint8Array(this.buffer, this.take(count), count);
      case "text": return this.runs(count, (bytes) => UTF8.decode(bytes));
      case "bytes": return this.runs(count, (bytes) => bytes);
    }
  }

  private runs<T>(count: number, decode: (bytes: Uint8Array) => T): Runs<T> {
    const [distinct, size] = new Uint32Array(this.buffer, this.take(8), 2) as unknown as [number, number];
    const places = new Uint32Array(this.buffer, this.take(4 * count), count);
    const ends = new Uint32Array(this.buffer, this.take(4 * distinct), distinct);
    const blob = new Uint8Array(this.buffer, this.take(size), size);
    if (places.some((place) => place >= distinct)) throw new FrameError("a row's text is not there");
    if (ends.some((end, n) => end < (n ? ends[n - 1]! : 0) || end > size)) throw new FrameError("texts that end before they begin");
    return new Runs(places, ends, blob, decode);
  }

  private take(bytes: number): number {
    const start = this.place;
    this.place += Math.ceil(bytes / 8) * 8;
    if (this.place > this.end) throw new FrameError("a column that is cut off");
    return start;
  }
}

/** 64-bit integers as doubles: from their halves, several times quicker than by BigInt. */
function doubles(halves: Uint32Array): Float64Array {
  const found = new Float64Array(halves.length / 2);
  for (let n = 0; n < found.length; n++) found[n] = (halves[2 * n + 1]! | 0) * 4294967296 + halves[2 * n]!;
  return found;
}
