// @vitest-environment happy-dom
// A report that is served: what it tells of is opened by a click, where the link may.
import { render } from "preact";
import { act } from "preact/test-utils";
import { afterEach, describe, expect, it, vi } from "vitest";
import { Store, type Command } from "../src/data/store";
import type { RunState } from "../src/generated/view";
import { OPENS_AT, OpenRun } from "../src/views/report/open_run";
import { header } from "./made";

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

afterEach(() => { document.body.replaceChildren(); });

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
