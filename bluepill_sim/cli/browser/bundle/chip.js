// A chip of the emulator as WebAssembly: made by replaying what Python recorded (image.py), then run without it.
"use strict";

const FLASH_BASE = 0x08000000, SRAM_BASE = 0x20000000, SRAM_BYTES = 20 * 1024;
const PINS = 16, PORTS = "ABCDE", EDGE_BYTES = 16, SENT_BYTES = 24;
// As `enum notice` of source/page.c.
const READ = 0, WRITE = 1, NO_CLOCK = 2, DUPLICATED = 3, ASKED = 4, PIN = 5, STORE = 6, RESET = 7, SLEEP = 8, TRAP = 9, FAULT = 10;

const hex = (value, digits = 8) => `0x${(value >>> 0).toString(16).padStart(digits, "0")}`;

/** The parts of an ELF that a programmer would write to flash: [address, bytes]. Throws what is wrong with the file. */
function segmentsOf(bytes) {
  const view = new DataView(bytes.buffer, bytes.byteOffset, bytes.byteLength);
  if (bytes.length < 52 || view.getUint32(0) !== 0x7f454c46) throw new Error("this is no ELF file");
  if (bytes[4] !== 1 || bytes[5] !== 1 || view.getUint16(18, true) !== 40) throw new Error("this ELF is not for a 32-bit ARM");
  if (view.getUint16(16, true) !== 2) throw new Error("this ELF is not linked: no program");
  const first = view.getUint32(28, true), size = view.getUint16(42, true), count = view.getUint16(44, true);
  // Linkers may load the file's own headers in front of the first section.
  const sections = [], shoff = view.getUint32(32, true), shsize = view.getUint16(46, true);
  for (let n = 0; n < view.getUint16(48, true); n++) {
    const at = shoff + n * shsize;
    if (at + 40 > bytes.length) throw new Error("this ELF is cut off");
    if (view.getUint32(at + 8, true) & 2) sections.push(view.getUint32(at + 16, true));
  }
  const found = [];
  for (let n = 0; n < count; n++) {
    const at = first + n * size;
    if (at + 32 > bytes.length) throw new Error("this ELF is cut off");
    const offset = view.getUint32(at + 4, true), address = view.getUint32(at + 12, true), length = view.getUint32(at + 16, true);
    if (view.getUint32(at, true) !== 1 || !length) continue;
    if (offset + length > bytes.length) throw new Error("this ELF is cut off");
    const inside = sections.filter((start) => start >= offset && start < offset + length);
    const skipped = inside.length ? Math.min(...inside) - offset : 0;
    found.push([address + skipped, bytes.subarray(offset + skipped, offset + length)]);
  }
  return found;
}

class Chip {
  /**
   * Makes the chip of a page's data, with a program.
   * @param module what WebAssembly made of chip.wasm
   * @param data sizes and steps of the recording, names (page.py)
   * @param segments of the program
   */
  constructor(module, data, segments) {
    this.data = data;
    /** What is not there, each once: text to how often. */
    this.named = new Map();
    this.stopped = "";
    this.onWords = () => {};
    const page = { notice: (...numbers) => this.notice(...numbers), deliver: (slot) => this.takeWords(slot) };
    this.c = new WebAssembly.Instance(module, { page }).exports;
    this.c.__wasm_call_ctors();
    this.buffers = data.sizes.map((size) => this.c.calloc(1, size));
    this.replay();
    this.usarts = Object.entries(data.slots).filter(([, slot]) => slot.name.startsWith("USART")).map(([n]) => Number(n));
    this.load(segments);
    this.out = this.c.calloc(1, data.portBytes);
  }

  get memory() { return new DataView(this.c.memory.buffer); }
  get bytes() { return new Uint8Array(this.c.memory.buffer); }

  replay() {
    const results = [], kept = [];
    const at = (text) => {
      const [place, offset] = text.slice(1).split("+");
      if (text[0] === "b") return this.buffers[place] + Number(offset ?? 0);
      if (text[0] === "r") return results[place] + Number(offset ?? 0);
      if (text[0] === "n" || text === "f") return 0;
      const data = text[0] === "f" ? new TextEncoder().encode(`${place}\0`) : Uint8Array.from(place.match(/../g), (pair) => parseInt(pair, 16));
      const literal = this.c.malloc(data.length);
      kept.push(literal);
      this.bytes.set(data, literal);
      return text[0] === "f" ? this.c.page_function(literal) : literal;
    };
    for (const [kind, name, ...rest] of this.data.steps) {
      if (kind === "call") {
        const wide = this.data.wide[name] ?? [];
        results.push(this.c[name](...rest.map((value, n) => (typeof value === "string" ? at(value) : wide.includes(n) ? BigInt(value) : value))));
        if (name === "page_core_new") this.core = results.at(-1);
        if (name === "page_fabric_new") this.fabric = results.at(-1);
      } else if (kind === "poke") {
        this.bytes.set(Uint8Array.from(rest[1].match(/../g), (pair) => parseInt(pair, 16)), at(name) + rest[0]);
      } else if (kind === "fill") {
        this.bytes.fill(rest[2], at(name) + rest[0], at(name) + rest[0] + rest[1]);
      } else {
        this.memory.setBigUint64(at(name) + rest[0], BigInt(at(rest[1])), true);
      }
    }
    kept.forEach((literal) => this.c.free(literal));
  }

  /** Puts a program into the flash and stands at its reset, as `BluePill` does. */
  load(segments) {
    const flash = this.buffers[this.data.flash], bytes = this.data.sizes[this.data.flash];
    this.bytes.fill(0xff, flash, flash + bytes);
    let lowest = Infinity;
    for (const [address, data] of segments) {
      const offset = address < bytes ? address : address - FLASH_BASE;
      if (offset < 0 || offset + data.length > bytes) throw new Error(`a part of the program stands at ${hex(address)}, outside of the flash`);
      this.bytes.set(data, flash + offset);
      lowest = Math.min(lowest, offset);
    }
    if (lowest === Infinity) throw new Error("there is no program in this file");
    const stack = this.memory.getUint32(flash + lowest, true), entry = this.memory.getUint32(flash + lowest + 4, true);
    if (stack <= SRAM_BASE || stack > SRAM_BASE + SRAM_BYTES || stack & 3 || !(entry & 1)) throw new Error(`no vectors of a program for this chip stand at ${hex(FLASH_BASE + lowest)}`);
    this.c.page_boot(stack, entry, lowest ? FLASH_BASE + lowest : 0);
  }

  // Running.

  get ns() { return this.c.page_now_ns(); }
  get cycle() { return this.c.page_cycle(); }
  get hz() { return this.c.page_hz(); }

  /** Runs to a time in ns (a BigInt), or to what stops the chip before. */
  run(untilNs) {
    const news = () => { if (this.c.fabric_has_news(this.fabric)) this.usarts.forEach((slot) => this.takeWords(slot)); };
    while (!this.stopped && this.c.page_run(untilNs) === 1) news();
    news();
  }

  takeWords(slot) {
    const count = this.c.fabric_word_count(this.fabric, slot);
    if (!count) return;
    const rows = this.c.fabric_take_words(this.fabric, slot), view = this.memory, words = [];
    for (let n = 0; n < count; n++) words.push({ ns: view.getBigUint64(rows + n * SENT_BYTES, true), word: view.getUint32(rows + n * SENT_BYTES + 8, true) });
    this.onWords(this.data.slots[slot].name, words);
  }

  // Pins, by their numbers.

  /** Has edges of all pins kept from now on: what the chip drives, or what is on the wires. */
  subscribe(ofWire = false) {
    const masks = this.c.calloc(4, 8 * 5), view = this.memory, none = masks + 32, all = masks;
    for (let n = 0; n < 5; n++) view.setUint32(all + 4 * n, 0xffff, true);
    return this.c.fabric_subscribe(this.fabric, ofWire ? none : all, ofWire ? all : none, none, none + 32, 0);
  }

  /** Takes the edges of a subscription: [ns, pin, drive, wire] each. */
  edges(subscription) {
    this.c.fabric_has_news(this.fabric);
    const count = this.c.fabric_row_count(this.fabric, subscription), found = [];
    const rows = count ? this.c.fabric_take_rows(this.fabric, subscription) : 0, view = this.memory;
    for (let n = 0; n < count; n++) {
      const at = rows + n * EDGE_BYTES;
      found.push([view.getBigUint64(at, true), view.getUint8(at + 8), view.getUint8(at + 9), view.getUint8(at + 10)]);
    }
    return found;
  }

  /** Masks of a port as it is now, by the names of `struct port`. */
  port(number) {
    this.c.fabric_look(this.fabric, number, this.out);
    const view = this.memory;
    return Object.fromEntries(Object.entries(this.data.port).map(([name, offset]) => [name, view.getUint32(this.out + offset, true)]));
  }

  /** Puts levels on pins from outside at times: [ns, pin, level] each. */
  driveLater(rows) {
    const at = this.c.calloc(rows.length, EDGE_BYTES), view = this.memory;
    rows.forEach(([ns, pin, level], n) => {
      view.setBigUint64(at + n * EDGE_BYTES, BigInt(ns), true);
      view.setUint8(at + n * EDGE_BYTES + 8, pin);
      view.setUint8(at + n * EDGE_BYTES + 9, level ? 2 : 1);
    });
    const hasRoom = this.c.fabric_put_inputs(this.fabric, this.data.inputs, at, rows.length);
    this.c.free(at);
    if (!hasRoom) throw new Error("too many levels of pins to come");
  }

  /** Puts a level on a pin from outside, or lets go (null). */
  drive(pin, level) {
    const port = this.buffers[this.data.ports] + (pin >> 4) * this.data.portBytes, bit = 1 << (pin & 15), view = this.memory;
    const put = (name, isSet) => {
      const place = port + this.data.port[name], word = view.getUint32(place, true);
      view.setUint32(place, isSet ? word | bit : word & ~bit, true);
    };
    put("outside", level !== null);
    put("outside_high", level === 1);
    put("outside_weak", false);
    this.c.fabric_pins_changed(this.fabric, pin >> 4);
  }

  /** Has characters arrive at a USART, as many as there is room for; returns how many that were. */
  type(name, words) {
    const slot = Number(Object.keys(this.data.slots).find((n) => this.data.slots[n].name === name));
    const taken = words.findIndex((word) => !this.c.fabric_command(this.fabric, slot, this.data.hear, word, 0));
    return taken < 0 ? words.length : taken;
  }

  // What is not there.

  notice(what, one, two, three, pc) {
    [one, two, three] = [one >>> 0, two >>> 0, three >>> 0];
    const text = this.textOf(what, one, two, three);
    if (!text) return;
    if (what >= RESET && what !== TRAP || what === STORE) this.stopped = text;
    const first = this.named.get(text);
    this.named.set(text, { times: (first?.times ?? 0) + 1, pc: first?.pc ?? pc >>> 0, ns: first?.ns ?? this.ns });
  }

  textOf(what, one, two, three) {
    const place = `${hex(one)}${this.nameAt(one) ? ` (${this.nameAt(one)})` : ""}`;
    switch (what) {
      case READ: return `${place} is read: this page does not have it, the program gets 0`;
      case WRITE: return `${hex(two)} is written to ${place}: this page does not have it, nothing happens`;
      case NO_CLOCK: return `${place} is ${two ? "written" : "read"}, and the peripheral has no clock: RCC_xENR`;
      case DUPLICATED: return `${place}: a write of ${8 * two} bits is duplicated over the word by the APB bridge`;
      case ASKED: return this.question(one, two, three);
      case PIN: return `P${PORTS[one >> 4]}${one & 15}: ${two ? "an output is shorted to a rail" : "two drivers fight, the chip's and the one outside"}`;
      case STORE: return `${hex(two)} is stored to ${place}: flash is not programmed here, and nothing else takes it`;
      case RESET: return "the program asks for a reset (AIRCR): press Restart";
      case SLEEP: return "the program goes into Stop or Standby (SLEEPDEEP): this page has neither";
      case TRAP: return "SCB_CCR UNALIGN_TRP is set: this page traps transfers of several words alone";
      default: return `the core has stopped: ${this.data.halts[one] ?? one} at ${hex(two)}${three ? ` (${hex(three)})` : ""}`;
    }
  }

  question(slot, what, value) {
    const { name, asks } = this.data.slots[slot], asked = asks[what];
    if (asked === "CLOCKS" || asked === "ACCESS") {
      this.c.page_clocks_changed();
      return "";
    }
    if (this.data.harmless.includes(asked)) return "";
    if (asked === "WRITTEN") { // of a device whose C only stores: the register, above what it held
      const place = this.data.slots[slot].base + 4 * (value >>> 16);
      return `${hex(place)} (${this.nameAt(place)}) is written: this page does not have what follows from it`;
    }
    if (asked === "ROUTED") {
      const words = this.buffers[this.data.afio] + 4, mapr = this.memory.getUint32(words, true) & this.data.remaps;
      const routes = [1, 2, 3, 4].map((n) => this.memory.getUint32(words + 4 * n, true));
      return mapr || routes.some(Boolean) ? `AFIO: remaps (MAPR ${hex(mapr)}) and routes of EXTI other than port A are not on this page` : "";
    }
    return `${name}: ${asked ?? what} (${value})`;
  }

  nameAt(address) {
    const base = this.data.registers[address & ~3];
    if (base) return base;
    const found = this.data.bases.findLast(([first]) => first <= address);
    return found && address - found[0] < found[2] ? `${found[1]}+${hex(address - found[0], 2)}` : "";
  }
}

globalThis.p2osChip = { Chip, segmentsOf };
