// The page's times as upright lines over a drawing: moved by the browser, so that what lies below is not drawn again as time goes.
import { effect } from "@preact/signals";
import type { Clock } from "../time/clock";

const LINES = ["now", "a", "b"] as const;

/**
 * Puts the lines of now and of both cursors over an element.
 *
 * @param leftOf How far from its left a time stands, as CSS has it; outside of what it shows, undefined. It may read signals.
 */
export function timeLines(host: HTMLElement, clock: Clock, leftOf: (t: number) => string | undefined): { readonly place: () => void; readonly dispose: () => void } {
  const lines = LINES.map((name) => {
    const line = document.createElement("div");
    line.className = `time-line ${name}`;
    if (name !== "now") line.dataset["name"] = name.toUpperCase();
    host.append(line);
    return [name, line] as const;
  });
  const place = () => {
    for (const [name, line] of lines) {
      const t = clock[name].value, left = t === null ? undefined : leftOf(t);
      line.hidden = left === undefined;
      if (left !== undefined) line.style.left = left;
    }
  };
  const stop = effect(place);
  return {
    place,
    dispose: () => {
      stop();
      for (const [, line] of lines) line.remove();
    },
  };
}
