// @vitest-environment happy-dom
// What needs a document: what is held makes which way, what is done is said in which words, and what a served report opens.
import { render } from "preact";
import { act } from "preact/test-utils";
import { afterEach, beforeEach, describe, expect, it, test, vi } from "vitest";
import { Store, type Command } from "../src/data/store";
import type { RunState } from "../src/generated/view";
import { OPENS_AT, OpenRun } from "../src/views/report/open_run";
import { header } from "./made";
import { Driving } from "../src/hands/driving";
import { padWay, stickShare, wayOf } from "../src/hands/keys";
import { freeName, moved, placedBox, placedCylinder, ROBOT } from "../src/hands/words";
import type { App } from "../src/shell/app";
import { signal } from "@preact/signals";

const asked: { do: string; forward_mps?: number; turn_dps?: number; words?: string; robot?: string }[] = [], trouble = signal("");
const chosen = signal("");
const app = { stops: signal(0), store: { trouble, header: signal({ hands: { most_mps: 0.5, most_dps: 90, is_real: false } }), get handsOffer() { return { robot: chosen.value, most_mps: 0.5, most_dps: 90 }; } }, ask: (command: typeof asked[number]) => asked.push(command) } as unknown as App;
let driving: Driving, end: () => void;

beforeEach(() => {
  vi.useFakeTimers();
  vi.spyOn(document, "hasFocus").mockReturnValue(true);
  asked.length = 0;
  trouble.value = "";
  driving = new Driving(app);
  end = driving.begin();
});
afterEach(() => {
  end();
  vi.useRealTimers();
  vi.restoreAllMocks();
});

test("keys that are held add up, and opposite ones are nothing", () => {
  expect(wayOf(["w", "a"])).toEqual([1, 1]);
  expect(wayOf(["u"])).toEqual([1, 1]);
  expect(wayOf(["ArrowUp", "w", "i"])).toEqual([1, 0]);
  expect(wayOf(["w", "s"])).toEqual([0, 0]);
  expect(wayOf(["q"])).toEqual([0, 0]);
});

test("a stick means nothing in its middle, and all of it at its ends", () => {
  expect([0, 0.11, -0.11, 1, -1].map(stickShare)).toEqual([0, 0, 0, 1, -1]);
  expect(stickShare(0.13)).toBeLessThan(0.02);
});

test("a pad's triggers drive ahead and back, its right stick turns", () => {
  const buttons = Array.from({ length: 17 }, () => ({ value: 0, pressed: false, touched: false }));
  buttons[7]!.value = 1;
  buttons[6]!.value = 0.25;
  expect(padWay({ buttons, axes: [0, 0, 1, 0] })).toEqual([0.75, -1]);
  expect(padWay({ buttons: [], axes: [] })).toEqual([0, 0]);
  expect(padWay(null)).toBeUndefined();
});

test("nothing is asked while it is not switched on", () => {
  driving.key("w", true);
  vi.advanceTimersByTime(1000);
  expect(asked).toEqual([]);
});

test("what is held is said again and again, and once that it is let go", () => {
  driving.turnOn(true);
  driving.key("w", true);
  vi.advanceTimersByTime(300);
  driving.key("w", false);
  vi.advanceTimersByTime(1000);
  expect(asked.map((one) => one.forward_mps)).toEqual([0, 0.5, 0.5, 0.5, 0.5, 0]);
  driving.turnOn(false);
  driving.turnOn(true);
  driving.key("w", true);
  driving.turnOn(false);
  vi.advanceTimersByTime(1000);
  expect(asked.at(-1)).toEqual({ do: "hand", words: "let go wheels" });
});

test("another robot is chosen: the one that was driven stands, drives by itself again, and nothing is held", () => {
  chosen.value = "west";
  driving.turnOn(true);
  driving.key("w", true);
  chosen.value = "east";
  expect(asked.map((one) => [one.robot, one.words ?? one.forward_mps])).toEqual([["west", 0], ["west", 0.5], ["west", "let go wheels"]]);
  vi.advanceTimersByTime(1000);
  driving.key("w", true);
  expect(asked.length).toBe(3);
  chosen.value = "";
});

test.each([
  ["focus", () => window.dispatchEvent(new Event("blur"))],
  ["the page", () => window.dispatchEvent(new Event("pagehide"))],
  ["the network", () => { trouble.value = "the program does not answer any more"; }],
])("it stands without %s, and a key has to be pressed anew", (_, lose) => {
  driving.turnOn(true);
  driving.key("ArrowUp", true);
  lose();
  const count = asked.length;
  expect(asked.at(-1)).toEqual({ do: "drive", forward_mps: 0, turn_dps: 0 });
  vi.advanceTimersByTime(1000);
  expect(asked.length).toBe(count);
  driving.key("ArrowUp", true);
  expect(asked.at(-1)!.forward_mps).toBe(0.5);
});

test("speeds are changed in steps, and end at the greatest", () => {
  driving.turnOn(true);
  driving.key("-", true);
  expect(driving.share.value).toBeCloseTo(1 / 1.1);
  for (let n = 0; n < 3; n++) driving.key("+", true);
  expect(driving.share.value).toBe(1);
  for (let n = 0; n < 99; n++) driving.key("-", true);
  expect(driving.share.value).toBe(0.05);
});

test("hands are said in words to the millimetre", () => {
  expect(moved("box 1", { x: 1.23456, y: -0.5, heading: Math.PI / 2 })).toBe("move box 1 to 1.235 -0.5 heading 90");
  expect(moved(ROBOT, { x: 0, y: 0, heading: 0 })).toBe("carry robot to 0 0 heading 0");
  expect(placedBox("wall 1", 2, 0.1, { x: 1, y: 0, heading: -0.1 })).toBe("place wall 1 box 2 0.1 at 1 0 heading -5.7");
  expect(placedCylinder("post", 0.05, { x: 1, y: 0, heading: 0 })).toBe("place post cylinder 0.05 at 1 0 heading 0");
  expect(freeName("box", ["box 1", "box 3", "crate"])).toBe("box 2");
});

const state = (words: string, url: string): RunState => ({ opened: [{ number: 6, words, url }], done: 1 }) as unknown as RunState;

function shown(mayControl: boolean | undefined) {
  const asked: Command[] = [], host = document.body.appendChild(document.createElement("div"));
  const store = mayControl === undefined ? undefined : new Store(header([], 1), { ask: () => undefined, command: (one) => asked.push(one) });
  if (store) {
    store.run.value = { opened: [], done: 0 } as unknown as RunState;
    store.mayControl.value = mayControl!;
  }
  void act(() => { render(<OPENS_AT.Provider value={store}><OpenRun number={6} title="point 6" /></OPENS_AT.Provider>, host); });
  return { asked, host, store: store! };
}

describe("a run that a report tells of", () => {
  it("is opened by one click, once it was made", () => {
    const { asked, host, store } = shown(true), went = vi.spyOn(location, "assign").mockImplementation(() => undefined);
    void act(() => { host.querySelector("button")!.click(); });
    expect(asked).toEqual([{ do: "open", number: 6 }]);
    expect(host.querySelector("button")!.disabled).toBe(true);
    void act(() => { store.run.value = state("running …", ""); });
    expect(went).not.toHaveBeenCalled();
    void act(() => { store.run.value = state("the same hash", "http://127.0.0.1:5/#token=a"); });
    expect(went.mock.calls).toEqual([["http://127.0.0.1:5/#token=a"]]);
    expect(host.textContent).toBe("Open point 6the same hash");
  });

  it("may be asked for again when it could not be made, and leads nowhere by a script", () => {
    const { host, store } = shown(true), went = vi.spyOn(location, "assign").mockImplementation(() => undefined);
    went.mockClear();
    void act(() => { host.querySelector("button")!.click(); });
    void act(() => { store.run.value = state("its file is gone", "javascript:1"); });
    expect([went.mock.calls.length, host.querySelector("button")!.disabled, host.querySelector("a")]).toEqual([0, false, null]);
  });

  it("is not made in a page that is one file, nor from a link for looking on", () => {
    expect(shown(undefined).host.textContent).toBe("");
    const { host, store } = shown(false);
    expect(host.textContent).toBe("");
    void act(() => { store.run.value = state("the same hash", "http://127.0.0.1:5/"); });
    expect([host.querySelector("button"), host.querySelector("a")!.href]).toEqual([null, "http://127.0.0.1:5/"]);
  });
});
