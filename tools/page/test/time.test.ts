// Time: the window, cursors and playing; ticks and words.
import { describe, expect, it } from "vitest";
import { firstFrom, lastAt } from "../src/data/search";
import { Clock, LEAST_SPAN_NS } from "../src/time/clock";
import { decimals, duration, frequency, moment, quantity, roundStep, tickBase, tickLabel, ticks } from "../src/time/format";

function clock(end = 1000): Clock {
  const made = new Clock();
  made.setRun(0, end);
  made.showAll();
  return made;
}

describe("the clock", () => {
  it("stays in the run", () => {
    const time = clock();
    time.seek(-1);
    expect(time.now.value).toBe(0);
    time.seek(1001);
    expect(time.now.value).toBe(1000);
    time.setCursor("a", 5000);
    expect(time.a.value).toBe(1000);
    time.setCursor("a", null);
    expect(time.a.value).toBeNull();
  });

  it.each([0.5, 2, 1e-9, 1e9])("keeps what is under the pointer there while it zooms by %f", (factor) => {
    const time = clock(1e9);
    time.look(2e8, 6e8);
    const about = 3e8, share = (about - time.from.value) / time.span.value;
    time.zoom(factor, about);
    expect(time.from.value).toBeGreaterThanOrEqual(0);
    expect(time.to.value).toBeLessThanOrEqual(1e9);
    expect(time.span.value).toBeGreaterThanOrEqual(LEAST_SPAN_NS);
    if (time.span.value < 5e8 && factor !== 2) expect((about - time.from.value) / time.span.value).toBeCloseTo(share, 5);
  });

  it("brings now into the window as it plays, and pauses at the end", () => {
    const time = clock();
    time.look(0, 100);
    time.play();
    time.rate.value = 1;
    time.advance(150 / 1e6); // 150 ns
    expect(time.now.value).toBe(150);
    expect(time.from.value).toBeLessThanOrEqual(150);
    expect(time.to.value).toBeGreaterThan(150);
    time.advance(1);
    expect(time.now.value).toBe(1000);
    expect(time.playing.value).toBe(false);
    time.play();
    expect(time.now.value).toBe(0);
  });

  it("leaves the window alone when now is elsewhere", () => {
    const time = clock();
    time.look(0, 100);
    time.seek(500);
    time.look(0, 100);
    time.seek(600);
    expect([time.from.value, time.to.value]).toEqual([0, 100]);
  });

  it("goes with a live run as it grows, and not after a pause", () => {
    const time = clock();
    time.atEnd.value = true;
    time.setRun(0, 2000);
    expect([time.now.value, time.to.value]).toEqual([2000, 2000]);
    time.pause();
    time.setRun(0, 3000);
    expect(time.now.value).toBe(2000);
  });

  it("goes with where a run stands that was set back, and not after who looks goes elsewhere", () => {
    const time = clock(3000);
    time.head.value = 1200;
    time.goWithRun();
    expect([time.now.value, time.atEnd.value]).toEqual([1200, true]);
    time.head.value = 1500;
    time.setRun(0, 3000);
    expect(time.now.value).toBe(1500);
    time.seek(100);
    time.head.value = 1700;
    time.setRun(0, 3000);
    expect([time.now.value, time.atEnd.value]).toEqual([100, false]);
  });

  it("shows all of a run that grows while all is looked at", () => {
    const time = clock();
    time.setRun(0, 2000);
    expect([time.now.value, time.from.value, time.to.value]).toEqual([0, 0, 2000]);
    time.look(0, 500);
    time.setRun(0, 3000);
    expect(time.to.value).toBe(500);
  });

  it("has speeds in steps", () => {
    const time = clock();
    time.faster(1);
    expect(time.rate.value).toBe(2);
    for (let n = 0; n < 20; n++) time.faster(-1);
    expect(time.rate.value).toBe(0.01);
  });
});

describe("places in times", () => {
  it("are at and behind a time", () => {
    const times = Float64Array.of(1, 5, 5, 9);
    expect([0, 1, 5, 9, 10].map((t) => [lastAt(times, t), firstFrom(times, t)])).toEqual([[-1, 0], [0, 0], [2, 1], [3, 3], [3, 4]]);
  });
});

describe("words of time", () => {
  it.each([[0, "0 ns"], [999, "999 ns"], [1000, "1 µs"], [1.5e6, "1.5 ms"], [-2e9, "-2 s"], [1234567, "1.235 ms"]])("a length of %f ns is %s", (ns, text) => expect(duration(ns)).toBe(text));
  it.each([[1000, "1 MHz"], [-2e6, "500 Hz"], [0, ""], [3e9, "333.3 mHz"]])("%f ns is %s", (ns, text) => expect(frequency(ns)).toBe(text));
  it("a moment is as fine as it is looked at", () => {
    expect(moment(12345678901)).toBe("12.346 s");
    expect(moment(12345678901, 1)).toBe("12.345\u2009678\u2009901 s");
  });
  it("steps are round, and no more than asked", () => {
    for (const span of [7, 1e3, 3.3e9, 0.0021]) for (const most of [2, 5, 12]) {
      const step = roundStep(span, most), lead = Number(step.toExponential().split("e")[0]);
      expect(span / step).toBeLessThanOrEqual(most * (1 + 1e-9));
      expect([1, 2, 5]).toContainEqual(Math.round(lead * 1e9) / 1e9);
    }
  });
  it("ticks have no dust of rounding", () => {
    expect(ticks(0, 0.5, 0.1)).toEqual([0, 0.1, 0.2, 0.3, 0.4, 0.5]);
    expect(decimals(0.02)).toBe(2);
  });
  it("fine ticks count from a round moment", () => {
    const base = tickBase(43187000123, 500);
    expect(base).toBe(43187000000);
    expect(tickBase(43187000123, 5000)).toBe(43185000000);
    expect(tickBase(43187000123, 1e6)).toBe(0);
    expect(tickLabel(43187000500, 500, base)).toBe("+500 ns");
    expect(tickLabel(2e9, 5e8, 0)).toBe("2.0 s");
  });
});

describe("a value", () => {
  it("is 0 below what a channel measures, and has its unit", () => {
    expect([1.5731e-13, -9e-10, 1e-9, 0.25].map((value) => quantity(value, "m/s"))).toEqual(["0 m/s", "0 m/s", "1.0000e-9 m/s", "0.25 m/s"]);
  });
});
