// Which rows the logic analyser shows, in which order: wires by their groups, what is decoded of them, and analog pins as a scope.
import type { Store } from "../../data/store";
import type { ChannelHeader } from "../../generated/view";

export type RowKind = "group" | "wire" | "analog" | "decoded";

export interface Row {
  readonly kind: RowKind;
  readonly title: string;
  readonly top: number;
  readonly height: number;
  readonly channel: ChannelHeader | undefined;
  /** The waves that stand for a wire's level at times. */
  readonly waves: ChannelHeader | undefined;
}

const HEIGHTS: Readonly<Record<RowKind, number>> = { group: 20, wire: 24, analog: 72, decoded: 24 };
/** What is drawn as text over the time it takes. */
export const DECODED = new Set(["packets", "text", "state"]);

export function rowsOf(store: Store): Row[] {
  const channels = store.chosen, rows: Row[] = [];
  let top = 0;
  const add = (kind: RowKind, title: string, channel?: ChannelHeader, waves?: ChannelHeader) => {
    rows.push({ kind, title, top, height: HEIGHTS[kind], channel, waves });
    top += HEIGHTS[kind];
  };
  const shown = channels.filter((one) => one.kind === "levels" || isAnalog(one) || DECODED.has(one.kind));
  const ofWire = (one: ChannelHeader) => DECODED.has(one.kind) && one.of >= 0 && channels.some((wire) => wire.id === one.of && wire.kind === "levels");
  const titles = [...new Set(shown.filter((one) => !ofWire(one)).map(titleOf))].sort((a, b) => rank(shown, a) - rank(shown, b));
  for (const title of titles) {
    add("group", title || "signals");
    for (const one of shown) {
      if (ofWire(one) || titleOf(one) !== title) continue;
      add(one.kind === "levels" ? "wire" : isAnalog(one) ? "analog" : "decoded", one.name, one, channels.find((wave) => wave.kind === "waves" && wave.of === one.id));
      for (const decoded of shown) if (ofWire(decoded) && decoded.of === one.id) add("decoded", decoded.name, decoded);
    }
  }
  return rows;
}

/** Wires come before what is decoded of all of them; within each the header's order stays. */
function rank(shown: readonly ChannelHeader[], title: string): number {
  const first = shown.findIndex((one) => titleOf(one) === title);
  return shown[first]!.kind === "levels" ? first : first + shown.length;
}

const titleOf = (one: ChannelHeader) => [one.source, one.group].filter(Boolean).join(" · ");
export const isAnalog = (one: ChannelHeader) => one.kind === "samples" && (one.unit === "V" || one.unit === "mV" || one.group.startsWith("analog"));
