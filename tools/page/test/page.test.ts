// Layouts, links, plots, lists and the store.
import { describe, expect, it } from "vitest";
import { Store, type Request } from "../src/data/store";
import { App } from "../src/shell/app";
import { type Layout, LAYOUTS, pruned } from "../src/shell/layouts";
import { goTo, parsedPlace, placeOf, writtenPlace } from "../src/shell/link";
import { aligned, chartsOf, extremes, points } from "../src/views/plots/curves";
import { filtered, gathered, itemAt } from "../src/views/lists/gathering";
import { colouredPath, placeAt, turn } from "../src/views/plan/poses";
import { covers, thingsAt } from "../src/views/plan/things";
import { isLink } from "../src/views/report/links";
import type { WorldThing } from "../src/generated/view";
import { channel, frame, header, runs, samples, store } from "./made";

describe("a layout", () => {
  it.each(LAYOUTS.map((layout) => [layout.id, layout] as const))("%s has each view once and shares that are one", (_, layout) => {
    const views = layout.columns.flatMap((column) => column.groups.flatMap((group) => group.views));
    expect(new Set(views)).toEqual(new Set(["hands", "plan", "logic", "plots", "packets", "consoles", "events", "goals", "states", "scene", "report"]));
    expect(views).toHaveLength(11);
    for (const parts of [layout.columns, ...layout.columns.map((column) => column.groups)]) expect(parts.reduce((sum, part) => sum + part.share, 0)).toBeCloseTo(1);
  });

  it("leaves out what a run has not, and gives its room to the others", () => {
    const layout: Layout = { id: "x", title: "x", columns: [{ share: 0.5, groups: [{ share: 0.5, views: ["plan"] }, { share: 0.5, views: ["logic", "plots"] }] }, { share: 0.5, groups: [{ share: 1, views: ["goals"] }] }] };
    expect(pruned(layout, ["plots"])).toEqual([{ share: 1, groups: [{ share: 1, views: ["plots"] }] }]);
    expect(pruned(layout, [])).toEqual([]);
    expect(pruned(layout, ["plots", "panel-chip", "goals"])[1]!.groups).toEqual([{ share: 1, views: ["goals", "panel-chip"] }]);
  });
});

describe("a link", () => {
  it("brings the page where it was", () => {
    const app = new App(store([channel(0, "levels")], 1e9)), other = new App(store([channel(0, "levels")], 1e9));
    app.clock.look(1e8, 2e8);
    app.clock.seek(1.5e8);
    app.clock.setCursor("a", 1.1e8);
    app.wire.value = 0;
    app.selection.value = { channel: 0, t: 5, place: 1 };
    goTo(other, parsedPlace(`#${writtenPlace(placeOf(app, "lab", "plan"))}`));
    expect(placeOf(other, "lab", "plan")).toEqual(placeOf(app, "lab", "plan"));
    expect(parsedPlace("#layout=lab").layout).toBe("lab");
  });
  it("that is nonsense is nothing", () => {
    expect(parsedPlace("#t=x&from=&s=1.2&wire=1e999&__proto__=5")).toEqual({});
  });
});

describe("a plot", () => {
  const line = { key: "0", name: "v", channel: channel(0, "samples"), column: "value", factor: 2, isStepped: false, mark: null };

  it("has points from edge to edge of the window alone", () => {
    const rows = samples([[0, 0], [100, 10], [200, 0]]);
    expect(points(rows, line, 50, 150, 100).map((column) => Array.from(column))).toEqual([[5e-8, 1e-7, 1.5e-7], [10, 20, 10]]);
    expect(points(rows, { ...line, isStepped: true }, 50, 150, 100)[1]).toEqual(Float64Array.of(0, 20, 20));
  });
  it("has no time twice", () => {
    for (const [from, to] of [[0, 100], [0, 200], [100, 200], [50, 100], [0, 300]] as const) for (const isStepped of [true, false]) {
      const [xs] = points(samples([[0, 0], [100, 10], [200, 0]]), { ...line, isStepped }, from, to, 100);
      expect([...new Set(xs)]).toEqual(Array.from(xs));
    }
  });
  it("between two rows far apart is a line from edge to edge", () => {
    const [xs, ys] = points(samples([[0, 0], [1e12, 1e12]]), line, 5e11, 5e11 + 4000, 100);
    expect(Array.from(xs)).toEqual([500, 500.000004]);
    expect(Array.from(ys)).toEqual([1e12, 1e12 + 8000]);
  });
  it("holds a stepped value to the end of the run, and a curve ends with its last row", () => {
    const rows = samples([[0, 1], [10, 2]], { to: 50 });
    expect(Array.from(points(rows, { ...line, isStepped: true }, 0, 40, 100)[0])).toEqual([0, 1e-8, 4e-8]);
    expect(Array.from(points(rows, line, 0, 40, 100)[0])).toEqual([0, 1e-8]);
  });
  it("keeps the least and greatest of each pixel", () => {
    const values = Float64Array.from({ length: 10_000 }, (_, n) => (n === 4321 ? 9 : n === 8765 ? -9 : Math.sin(n)));
    const kept = extremes(Float64Array.from(values.keys()), values, 0, 10_000, 100);
    expect(kept).toContain(4321);
    expect(kept).toContain(8765);
    expect(kept.length).toBeLessThanOrEqual(400);
    expect([...kept].sort((a, b) => a - b)).toEqual(kept);
  });
  it("stands with others of its group and unit", () => {
    const run = store([channel(0, "samples", { group: "wheels", unit: "m/s", name: "left" }), channel(1, "samples", { group: "wheels", unit: "m/s", name: "right" }), channel(2, "samples", { group: "sonar", unit: "m" }), channel(3, "pose")], 100);
    run.receive([samples([[0, 1], [100, 2]]), { ...samples([[50, 5]], { from: 0, to: 100 }), channel: 1 }]);
    expect(chartsOf(run).map((chart) => [chart.title, chart.unit, chart.curves.length])).toEqual([["wheels", "m/s", 2], ["sonar", "m", 1], ["position", "m", 2], ["heading", "°", 1]]);
    expect(aligned(run, chartsOf(run)[0]!, 0, 100, 100)[0]).toHaveLength(3);
  });
});

describe("plots of several robots", () => {
  const wheels = (count: number) => store(Array.from({ length: count }, (_, n) => channel(n, "samples", { group: "wheels", unit: "m/s", source: n % 2 ? "east" : "west" })));
  it.each([[4, ["wheels"]], [5, ["west wheels", "east wheels"]]] as const)("of %i curves stand in %j", (count, titles) => expect(chartsOf(wheels(count)).map((chart) => chart.title)).toEqual(titles));
});

describe("a list", () => {
  const run = store([channel(0, "text", { source: "one" }), channel(1, "text", { source: "two" })]);
  run.receive([frame("text", [1, 5], { text: runs(["hello", "world"]), is_sent: Uint8Array.of(0, 0) }), { ...frame("text", [3], { text: runs(["hello again"]), is_sent: Uint8Array.of(1) }, { of: 9 }), channel: 1 }]);
  const all = gathered(run, run.channels("text"), 0, 1000);

  it("is in order of time, and says how many rows there are", () => {
    expect(all.items.map((item) => item.t)).toEqual([1, 3, 5]);
    expect(all.of).toBe(11);
  });
  it.each([["hello", [1, 3]], ["hello -again", [1]], ["HELLO again", [3]], ["two", [3]], ["-", [1, 3, 5]], ["nothing", []]])("filtered by %s has rows at %j", (words, times) =>
    expect(filtered(all.items, words, (item) => item.channel.source).map((item) => item.t)).toEqual(times));
  it("has a place for every time", () => expect([0, 1, 4, 9].map((t) => itemAt(all.items, t))).toEqual([-1, 0, 1, 2]));
});

describe("the plan", () => {
  const path = frame("pose", [0, 100], { x_m: Float32Array.of(0, 1), y_m: Float32Array.of(0, 0), z_m: Float32Array.of(0, 0), heading_rad: Float32Array.of(3, -3), pitch_rad: Float32Array.of(0, 0) });

  it("has the robot on the way between rows, turning the shorter way", () => {
    const at = placeAt(path, 50)!;
    expect(at.x).toBeCloseTo(0.5);
    expect(Math.abs(turn(Math.PI, at.heading))).toBeLessThan(1e-6);
    expect([turn(-3, 3), turn(3, -3), turn(0, 1)]).toEqual([expect.closeTo(6 - 2 * Math.PI, 9), expect.closeTo(2 * Math.PI - 6, 9), 1]);
    expect(placeAt(path, -10)!.x).toBe(0);
    expect(placeAt(path, 500)!.x).toBe(1);
  });
  it("colours by time or by speed", () => {
    expect(colouredPath(path, "time")).toMatchObject({ least: 0, most: 1e-7, unit: "s" });
    expect(colouredPath(path, "speed").most).toBeCloseTo(1e7);
  });
  it("knows what lies under a point, in its own shape", () => {
    const box: WorldThing = { name: "box", kind: "obstacle", shape: "box", x_m: 1, y_m: 0, heading_rad: Math.PI / 4, z_m: 0, height_m: 1, length_m: 2, width_m: 0.2, radius_m: 0, points: [], is_there: true };
    expect([covers(box, 1.6, 0.6), covers(box, 1.6, -0.6), covers({ ...box, shape: "cylinder", radius_m: 0.5 }, 1.4, 0.2), covers({ ...box, heading_rad: 0, shape: "polygon", points: [[0, 0], [1, 0], [0, 1]] }, 1.2, 0.2)]).toEqual([true, false, true, true]);
  });
  it("has things where they were put last, and none that were taken away", () => {
    const thing = (name: string): WorldThing => ({ name, kind: "", shape: "cylinder", x_m: 0, y_m: 0, heading_rad: 0, z_m: 0, height_m: 1, length_m: 0, width_m: 0, radius_m: 1, points: [], is_there: true });
    const run = new Store(header([channel(0, "things")], 100, { world: { name: "w", extent_m: [0, 0, 1, 1], things: [thing("a"), thing("b")] } }), undefined);
    run.receive([frame("things", [10, 20], { thing: Uint32Array.of(0, 1), is_there: Uint8Array.of(1, 0), x_m: Float32Array.of(3, 0), y_m: Float32Array.of(0, 0), heading_rad: Float32Array.of(0, 0) })]);
    expect([5, 10, 20].map((t) => thingsAt(run, t).map((one) => [one.name, one.x_m]))).toEqual([[["a", 0], ["b", 0]], [["a", 3], ["b", 0]], [["a", 3]]]);
  });
});

describe("the store", () => {
  it("asks once for what is missing, wider than it is seen, and not for what is there", async () => {
    const asked: Request[] = [], run = store([channel(0, "samples"), channel(1, "samples")], 1e6, { ask: (request) => asked.push(request) });
    for (let n = 0; n < 5; n++) for (const id of [0, 1]) run.rows(id, 400_000, 500_000, 300);
    await new Promise((resolve) => setTimeout(resolve, 60));
    expect(asked).toEqual([{ want: [0, 1], from_ns: 325_000, to_ns: 575_000, pixels: 750 }]);
    run.rows(0, 420_000, 500_000, 300);
    await new Promise((resolve) => setTimeout(resolve, 60));
    expect(asked).toHaveLength(1);
  });
  it("prefers exact rows, and finer ones to coarse", () => {
    const run = store([channel(0, "samples")], 1000), coarse = samples([[0, 0], [1000, 0]], { isReduced: true, of: 500 }), fine = samples([[400, 0], [500, 0], [600, 0]], { from: 400, to: 600, isReduced: true, of: 100 }), exact = samples([[450, 0], [460, 1]], { from: 450, to: 460 });
    run.receive([coarse, fine, exact]);
    expect([run.rows(0, 452, 458), run.rows(0, 440, 520), run.rows(0, 0, 900)]).toEqual([exact, fine, coarse]);
  });
});

describe("a link in a report", () => {
  it.each([["runs/1/report.html", true], ["https://example.org", true], ["javascript:alert(1)", false], [" JaVaScript:alert(1)", false], ["data:text/html,x", false], ["", false], ["../a:b", true]])("%s: %s", (href, is) => expect(isLink(href)).toBe(is));
});
