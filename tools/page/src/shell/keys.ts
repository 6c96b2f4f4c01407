// The keys of the page: one table for what they do and for the list that names them.
import { numbers } from "../data/frames";
import { firstFrom, lastAt } from "../data/search";
import { find } from "../views/logic/find";
import type { App } from "./app";

export interface Key {
  /** As the list has it. */
  readonly keys: string;
  readonly does: string;
  readonly matches: (event: KeyboardEvent) => boolean;
  readonly run: (app: App) => void;
}

const one = (key: string, isShifted?: boolean) => (event: KeyboardEvent) => event.key === key && (isShifted === undefined || event.shiftKey === isShifted);
const step = (share: number) => (app: App) => app.clock.seek(app.clock.now.peek() + share * app.clock.span.peek());

export const KEYS: readonly Key[] = [
  { keys: "Space", does: "play or pause; a run that this page controls goes on or stands still", matches: one(" "), run: (app) => app.toggle() },
  { keys: "Escape", does: "stop a robot that this page drives", matches: one("Escape"), run: (app) => { if (app.drives) app.stop(); } },
  { keys: "s, Shift s", does: "of such a run: a step on, a step back", matches: one("s"), run: (app) => app.step(1) },
  { keys: "", does: "", matches: one("S"), run: (app) => app.step(-1) },
  { keys: "← →", does: "a hundredth of the window back or on", matches: one("ArrowLeft", false), run: step(-0.01) },
  { keys: "", does: "", matches: one("ArrowRight", false), run: step(0.01) },
  { keys: "Shift ← →", does: "a tenth of the window back or on", matches: one("ArrowLeft", true), run: step(-0.1) },
  { keys: "", does: "", matches: one("ArrowRight", true), run: step(0.1) },
  { keys: "Home End", does: "start or end of the run", matches: one("Home"), run: (app) => app.clock.seek(app.clock.start.peek()) },
  { keys: "", does: "", matches: one("End"), run: (app) => app.clock.seek(app.clock.end.peek()) },
  { keys: "+ −", does: "look closer in time, or from further away", matches: (event) => event.key === "+" || event.key === "=", run: (app) => app.clock.zoom(0.5) },
  { keys: "", does: "", matches: one("-"), run: (app) => app.clock.zoom(2) },
  { keys: "0", does: "show the whole run", matches: one("0"), run: (app) => app.clock.showAll() },
  { keys: "a b", does: "set cursor A or B here; Shift takes it away", matches: one("a"), run: (app) => app.clock.setCursor("a", app.clock.now.peek()) },
  { keys: "", does: "", matches: one("b"), run: (app) => app.clock.setCursor("b", app.clock.now.peek()) },
  { keys: "", does: "", matches: one("A"), run: (app) => app.clock.setCursor("a", null) },
  { keys: "", does: "", matches: one("B"), run: (app) => app.clock.setCursor("b", null) },
  { keys: "[ ]", does: "last or next edge of the chosen wire", matches: one("["), run: (app) => toEdge(app, -1) },
  { keys: "", does: "", matches: one("]"), run: (app) => toEdge(app, 1) },
  { keys: ", .", does: "last or next event", matches: one(","), run: (app) => toEvent(app, -1) },
  { keys: "", does: "", matches: one("."), run: (app) => toEvent(app, 1) },
  { keys: "< >", does: "slower or faster", matches: one("<"), run: (app) => app.faster(-1) },
  { keys: "", does: "", matches: one(">"), run: (app) => app.faster(1) },
];

/** Where keys have a meaning of their own. */
const OWN = "input, select, textarea, [role=listbox], [role=tab], [role=separator], [role=menu], dialog";

/** Takes a key; says whether it had a meaning. */
export function pressed(app: App, event: KeyboardEvent): boolean {
  if (event.ctrlKey || event.metaKey || event.altKey || event.defaultPrevented) return false;
  const target = event.target instanceof Element ? event.target : null;
  if (target?.closest(OWN) || (event.key === " " && target?.closest("button, summary, a"))) return false;
  const found = KEYS.find((key) => key.matches(event));
  found?.run(app);
  return found !== undefined;
}

function toEdge(app: App, way: 1 | -1): void {
  const { store, wire, clock } = app, channel = store.channel(wire.peek() ?? -1) ?? store.channels("levels")[0];
  if (channel) void find(store, channel.id, clock.now.peek(), way, { what: "change" }).then((t) => { if (t !== undefined) clock.seek(t); });
}

function toEvent(app: App, way: 1 | -1): void {
  const { store, clock } = app, now = clock.now.peek(), found: number[] = [];
  for (const channel of store.channels("events")) {
    const frame = store.whole(channel.id);
    if (!frame) continue;
    const severities = numbers(frame, "severity");
    let row = way === 1 ? lastAt(frame.t, now) + 1 : firstFrom(frame.t, now) - 1;
    while (row >= 0 && row < frame.count && severities[row] === 0) row += way; // debug is no event of a person's
    if (row >= 0 && row < frame.count) found.push(frame.t[row]!);
  }
  if (found.length) clock.seek(way === 1 ? Math.min(...found) : Math.max(...found));
}
