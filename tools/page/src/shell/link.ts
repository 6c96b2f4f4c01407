// What a link to the page holds: layout, time, window, cursors and selection, in the fragment of its address.
import type { App } from "./app";

export interface Place {
  readonly layout?: string;
  /** The view in front, where one is at a time. */
  readonly view?: string;
  readonly t?: number;
  readonly from?: number;
  readonly to?: number;
  readonly a?: number;
  readonly b?: number;
  readonly wire?: number;
  readonly selection?: { readonly channel: number; readonly t: number; readonly place: number };
}

const NUMBERS = ["t", "from", "to", "a", "b", "wire"] as const;

/** The place that a fragment holds; what it does not know or cannot read is not in it. */
export function parsedPlace(fragment: string): Place {
  const found = new URLSearchParams(fragment.replace(/^#/, "")), place: Record<string, unknown> = {};
  for (const name of ["layout", "view"]) if (found.get(name)) place[name] = found.get(name);
  for (const name of NUMBERS) {
    const text = found.get(name), value = Number(text);
    if (text && Number.isFinite(value)) place[name] = value;
  }
  const chosen = (found.get("s") ?? "").split(".").map(Number);
  if (chosen.length === 3 && chosen.every(Number.isFinite)) place["selection"] = { channel: chosen[0], t: chosen[1], place: chosen[2] };
  return place;
}

export function writtenPlace(place: Place): string {
  const found = new URLSearchParams();
  for (const name of ["layout", "view", ...NUMBERS] as const) {
    const value = place[name];
    if (value !== undefined) found.set(name, typeof value === "number" ? String(Math.round(value)) : value);
  }
  if (place.selection) found.set("s", `${place.selection.channel}.${Math.round(place.selection.t)}.${place.selection.place}`);
  return found.toString();
}

/** Takes the place of a link; times outside of the run are cut into it. */
export function goTo(app: App, place: Place): void {
  const { clock } = app;
  if (place.from !== undefined && place.to !== undefined && place.to > place.from) clock.look(place.from, place.to);
  if (place.t !== undefined) clock.seek(place.t);
  if (place.a !== undefined) clock.setCursor("a", place.a);
  if (place.b !== undefined) clock.setCursor("b", place.b);
  if (place.wire !== undefined) app.wire.value = place.wire;
  if (place.selection) app.selection.value = place.selection;
}

/** Where the page is. */
export function placeOf(app: App, layout: string, view: string | undefined): Place {
  const { clock } = app, isWhole = clock.from.value <= clock.start.value && clock.to.value >= clock.end.value;
  return {
    layout, t: clock.now.value,
    ...(view ? { view } : {}),
    ...(isWhole ? {} : { from: clock.from.value, to: clock.to.value }),
    ...(clock.a.value === null ? {} : { a: clock.a.value }),
    ...(clock.b.value === null ? {} : { b: clock.b.value }),
    ...(app.wire.value === null ? {} : { wire: app.wire.value }),
    ...(app.selection.value ? { selection: app.selection.value } : {}),
  };
}
