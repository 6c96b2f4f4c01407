// The logic analyser: levels of detail, search, measures and rows.
import { describe, expect, it } from "vitest";
import { Runs, type Frame } from "../src/data/frames";
import { pieces, type Scale } from "../src/views/logic/drawing";
import { find, findIn, parsedDuration, parsedValue, pulseAt } from "../src/views/logic/find";
import { rowsOf } from "../src/views/logic/rows";
import { channel, frame, levels, runs, store } from "./made";

const scale = (from: number, to: number, width = 100): Scale => ({ from, to, left: 0, width });

describe("a wire's line", () => {
  const square = levels([[0, 0], [10, 1], [20, 0], [30, 1]], { to: 100 });

  it("has each level where there is room", () => {
    expect(pieces(square, scale(0, 100))).toEqual([{ x0: 0, x1: 10, value: 0 }, { x0: 10, x1: 20, value: 1 }, { x0: 20, x1: 30, value: 0 }, { x0: 30, x1: 100, value: 1 }]);
  });

  it("begins with what was before the window, and ends with it", () => {
    expect(pieces(square, scale(12, 18))).toEqual([{ x0: 0, x1: 100, value: 1 }]);
  });

  it("begins where its first row is", () => {
    expect(pieces(levels([[50, 1]], { to: 100 }), scale(0, 100))).toEqual([{ x0: 50, x1: 100, value: 1 }]);
  });

  it("is a block where more changes than a pixel shows, with at most some pieces a pixel", () => {
    const many = levels(Array.from({ length: 100_000 }, (_, n) => [n, n % 2] as const), { to: 100_000 }), found = pieces(many, scale(0, 100_000));
    expect(found.length).toBeLessThan(300);
    expect(found.every((piece) => piece.value === undefined)).toBe(true);
    expect([found[0]!.x0, found.at(-1)!.x1]).toEqual([0, 100]);
  });

  it("shows one short pulse in a long run", () => {
    const glitch = levels([[0, 0], [500_000, 1], [500_001, 0]], { to: 1_000_000 }), found = pieces(glitch, scale(0, 1_000_000));
    expect(found).toEqual([{ x0: 0, x1: 50, value: 0 }, { x0: 50, x1: 51, value: undefined }, { x0: 51, x1: 100, value: 0 }].map((piece) => ({ x0: expect.closeTo(piece.x0, 2) as number, x1: expect.closeTo(piece.x1, 2) as number, value: piece.value })));
  });

  it("is a block where the server left changes out", () => {
    const reduced = levels([[0, 0], [50, 1]], { to: 100, isReduced: true, of: 40 }, [39, 1]);
    expect(pieces(reduced, scale(0, 100))).toEqual([{ x0: 0, x1: 50, value: undefined }, { x0: 50, x1: 100, value: 1 }]);
  });

  it.each([[0, 1], [1e12, 1e12 + 20]])("covers the window from %f to %f without a gap", (from, to) => {
    const found = pieces(levels([[0, 0], [0.5, 1]], { to: 2e12 }), scale(from, to));
    expect(found[0]!.x0).toBe(0);
    expect(found.at(-1)!.x1).toBe(100);
    for (let n = 1; n < found.length; n++) expect(found[n]!.x0).toBeCloseTo(found[n - 1]!.x1, 6);
  });
});

describe("search", () => {
  const wire = levels([[0, 0], [10, 1], [20, 0], [22, 1], [40, 0]], { to: 100 });

  it.each([
    ["rising", 0, 1, 10], ["rising", 9, 1, 10], ["rising", 10, 1, 22], ["rising", 40, 1, undefined], ["rising", 22, -1, 10], ["rising", 10, -1, undefined], ["falling", 0, 1, 20], ["change", 10, -1, undefined], ["change", 11, -1, 10],
  ] as const)("finds a %s edge from %i by %i at %s", (what, t, way, found) => expect(findIn(wire, t, way, { what })).toBe(found));

  it("finds a short pulse, not a longer one", () => {
    expect(findIn(wire, 0, 1, { what: "shorter", ns: 3 })).toBe(20);
    expect(findIn(wire, 0, 1, { what: "shorter", ns: 2 })).toBeUndefined();
  });

  it("finds a value of a bus where it comes", () => {
    const bus = levels([[0, 5], [10, 7], [20, 7], [30, 5]]);
    expect(findIn(bus, 0, 1, { what: "value", value: 7 })).toBe(10);
    expect(findIn(bus, 10, 1, { what: "value", value: 7 })).toBeUndefined();
  });

  it("finds a text in packets, whatever its case, but not in their bytes", () => {
    const bytes = new Runs(Uint32Array.of(0, 0), Uint32Array.of(1), Uint8Array.of(7), (found) => found);
    const packets = frame("packets", [5, 9], { name: runs(["SIP", "VEL"]), says: runs(["x", "125 mm/s"]), data: bytes, fields: runs(["[[0,1,'header','']]", ""]), to_robot: Uint8Array.of(0, 1), is_bad: Uint8Array.of(0, 0) });
    expect(findIn(packets, 0, 1, { what: "text", text: "vel" })).toBe(9);
    expect(findIn(packets, 0, 1, { what: "text", text: "header" })).toBeUndefined();
  });

  it("goes on in exact rows where those here are reduced", async () => {
    const edges = Array.from({ length: 2000 }, (_, n) => [n * 50, n % 2] as const);
    const all = (from: number, to: number): Frame => levels(edges.filter(([t]) => t >= from - 50 && t <= to + 50), { from, to });
    let asked = 0;
    const run = store([channel(0, "levels")], 100_000, { ask: (request, answered) => { asked++; run.receive([all(request.from_ns, request.to_ns)]); answered(true); } });
    run.receive([levels([[0, 0], [99_950, 1]], { from: 0, to: 100_000, isReduced: true, of: 2000 }, [1999, 1])]);
    expect(await find(run, 0, 70_020, 1, { what: "rising" })).toBe(70_050);
    expect(await find(run, 0, 70_020, -1, { what: "falling" })).toBe(70_000);
    expect(asked).toBeLessThan(20);
  });
});

describe("search in a long run", () => {
  it.each([[0, 1], [100_000, -1]] as const)("from %i by %i finds the one edge that there is", async (t, way) => {
    for (const edge of [501, 2001, 33_333, 77_777]) {
      const run = store([channel(0, "levels")], 100_000, { ask: ({ from_ns, to_ns }, answered) => {
        run.receive([levels([[0, 0], [edge, 1]].filter(([at]) => at === 0 || (at! >= from_ns && at! <= to_ns)) as [number, number][], { from: from_ns, to: to_ns })]);
        answered(true);
      } });
      run.receive([levels([[0, 0]], { from: 0, to: 100_000, isReduced: true, of: 500_000 }, [9])]);
      expect(await find(run, 0, t, way, { what: "rising" })).toBe(edge);
    }
  });
});

describe("search along a wire that no view has asked for", () => {
  const rows: readonly [number, number][] = [[0, 0], [500, 1], [502, 0], [900, 1]];
  it.each([["nothing of it is here", undefined], ["a part of it is here", [800, 1000]]] as const)("where %s", async (_, part) => {
    const piece = (from: number, to: number) => levels(rows.filter(([t]) => t >= from && t <= to), { from, to });
    const run = store([channel(0, "levels")], 1000, { ask: ({ from_ns, to_ns }, answered) => { run.receive([piece(from_ns, to_ns)]); answered(true); } });
    if (part) run.receive([piece(...part)]);
    expect(await find(run, 0, 1000, -1, { what: "shorter", ns: 10 })).toBe(500);
    expect(await find(run, 0, 500, 1, { what: "shorter", ns: 2 })).toBeUndefined();
  });
});

describe("a pulse", () => {
  it("is measured with its period", () => {
    const wire = levels([[0, 0], [10, 1], [25, 0], [40, 1]], { to: 100 });
    expect(pulseAt(wire, 12, 100)).toEqual({ from: 10, to: 25, value: 1, period: 30 });
    expect(pulseAt(wire, 30, 100)).toEqual({ from: 25, to: 40, value: 0, period: undefined });
    expect(pulseAt(wire, 50, 90)).toEqual({ from: 40, to: 90, value: 1, period: undefined });
  });
  it("is not known where changes are left out", () => {
    expect(pulseAt(levels([[0, 0], [50, 1]], {}, [7, 1]), 10, 100)).toBeUndefined();
  });
  it.each([["2 us", 2000], ["10ns", 10], ["0.5 ms", 5e5], ["3", 3000], ["x", NaN], ["", NaN]])("a length written %s is %f ns", (text, ns) => expect(parsedDuration(text)).toEqual(ns));
  it.each([["0x1F", 31], ["0b101", 5], ["7", 7], ["", NaN], ["z", NaN]])("a value written %s is %f", (text, value) => expect(parsedValue(text)).toEqual(value));
});

describe("rows", () => {
  it("stand by group, decoded ones under their wire, and what is of all wires last", () => {
    const run = store([channel(5, "packets", { name: "P2OS", group: "packets" }), channel(1, "levels", { name: "PA9", group: "usart" }), channel(2, "packets", { name: "bytes", of: 1 }), channel(3, "levels", { name: "PB1", group: "motor" }), channel(4, "samples", { name: "VBAT", unit: "V", group: "analog" }), channel(6, "samples", { name: "speed", unit: "m/s" })]);
    expect(rowsOf(run).map((row) => `${row.kind} ${row.title}`)).toEqual(["group usart", "wire PA9", "decoded bytes", "group motor", "wire PB1", "group packets", "decoded P2OS", "group analog", "analog VBAT"]);
  });
});
