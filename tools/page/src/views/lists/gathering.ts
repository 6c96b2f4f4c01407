// Rows of several channels of one kind as one list in order of time, and those that pass a filter.
import { computed } from "@preact/signals";
import { useMemo } from "preact/hooks";
import { type Frame, Runs } from "../../data/frames";
import type { Store } from "../../data/store";
import type { ChannelHeader } from "../../generated/view";
import type { App } from "../../shell/app";
import type { Clock } from "../../time/clock";

/** A list has as many rows whatever the pixels. */
const LISTED_PIXELS = 1000;

export interface Item {
  readonly channel: ChannelHeader;
  readonly frame: Frame;
  readonly row: number;
  readonly t: number;
}

export interface Gathered {
  readonly items: readonly Item[];
  /** Rows that there are, more than are here where some are left out. */
  readonly of: number;
}

/** All rows of channels, as far as they are here; around a time where the whole is reduced. */
export function gathered(store: Store, channels: readonly ChannelHeader[], from: number, to: number): Gathered {
  const items: Item[] = [];
  let of = 0;
  for (const channel of channels) {
    const whole = store.whole(channel.id), frame = whole?.isReduced && store.canAsk ? (store.rows(channel.id, from, to, LISTED_PIXELS) ?? whole) : whole;
    if (!frame) continue;
    of += Math.max(whole?.of ?? 0, frame.of);
    for (let row = 0; row < frame.count; row++) items.push({ channel, frame, row, t: frame.t[row]! });
  }
  if (channels.length > 1) items.sort((a, b) => a.t - b.t);
  return { items, of };
}

/** Items whose texts hold every word of a filter; a word with a minus before it must not be there. */
export function filtered(items: readonly Item[], filter: string, more: (item: Item) => string): readonly Item[] {
  const words = filter.toLowerCase().split(/\s+/).filter((word) => word && word !== "-");
  if (!words.length) return items;
  const known = new Map<Frame, Map<string, string>>();
  return items.filter((item) => {
    let texts = known.get(item.frame);
    if (!texts) known.set(item.frame, (texts = new Map<string, string>()));
    const columns = [...item.frame.columns].filter((column): column is [string, Runs<string>] => column[1] instanceof Runs && column[0] !== "data" && column[0] !== "fields");
    const key = columns.map(([, runs]) => runs.place(item.row)).join(" ");
    let text = texts.get(key);
    if (text === undefined) texts.set(key, (text = columns.map(([, runs]) => runs.at(item.row)).join(" ").toLowerCase()));
    const all = `${text} ${more(item).toLowerCase()}`;
    return words.every((word) => (word.startsWith("-") ? !all.includes(word.slice(1)) : all.includes(word)));
  });
}

/** Place of the last item at or before a time. */
export function itemAt(items: readonly Item[], t: number): number {
  let low = 0, high = items.length;
  while (low < high) {
    const middle = (low + high) >>> 1;
    if (items[middle]!.t <= t) low = middle + 1;
    else high = middle;
  }
  return low - 1;
}

/** Rows of channels and those that pass a filter, made anew when one of them changes. */
export function useShown(app: App, channels: readonly ChannelHeader[], filter: string, more: (item: Item) => string, keeps?: (item: Item) => boolean): { readonly all: Gathered; readonly shown: readonly Item[] } {
  const { store, clock } = app, isPart = store.canAsk && channels.some((channel) => store.whole(channel.id)?.isReduced);
  const from = isPart ? clock.from.value : 0, to = isPart ? clock.to.value : 0, version = store.version.value;
  const all = useMemo(() => gathered(store, channels, from, to), [store, channels.map((channel) => channel.id).join(" "), from, to, version]);
  const shown = useMemo(() => filtered(keeps ? all.items.filter(keeps) : all.items, filter, more), [all, filter, keeps]);
  return { all, shown };
}

/** Place of the item of now; who uses it is drawn again when it becomes another one, not with each frame. */
export function useCurrent(shown: readonly Item[], clock: Clock): number {
  return useMemo(() => computed(() => itemAt(shown, clock.now.value)), [shown, clock]).value;
}
