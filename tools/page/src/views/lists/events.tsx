// What happened, as a list with a filter.
import { signal } from "@preact/signals";
import { render } from "preact";
import { useCallback } from "preact/hooks";
import { numbers, texts } from "../../data/frames";
import type { App, ViewKind } from "../../shell/app";
import { moment } from "../../time/format";
import { type Item, useCurrent, useShown } from "./gathering";
import { count } from "./packets";
import { Rows } from "./rows";

export const events: ViewKind = {
  id: "events", title: "Events", doc: "What happened: states of the parts, faults, contacts, warnings.",
  has: (store) => store.channels("events").length > 0,
  mount: (app, host) => {
    render(<Events app={app} />, host);
    return () => render(null, host);
  },
};

const filter = signal(""), least = signal(0), selectedAt = signal<{ t: number; row: number } | null>(null);
const SEVERITIES = ["debug", "information", "warning", "error"] as const;

function Events({ app }: { app: App }) {
  const { clock, store } = app;
  const severest = least.value, keeps = useCallback((item: Item) => numbers(item.frame, "severity")[item.row]! >= severest, [severest]), chosen = selectedAt.value;
  const { all, shown } = useShown(app, store.channels("events"), filter.value, (item) => `${item.channel.source} ${SEVERITIES[numbers(item.frame, "severity")[item.row]!] ?? ""}`, keeps);
  const sources = store.channels("events").length > 1;
  return (
    <div class="list-view">
      <div class="view-bar">
        <input type="search" class="filter" aria-label="Filter events: words that are there, -word: that are not" placeholder="filter: collision -link" value={filter.value} onInput={(event) => { filter.value = event.currentTarget.value; }} />
        <select aria-label="Least severity" value={least.value} onChange={(event) => { least.value = Number(event.currentTarget.value); }}>
          <option value={0}>all</option><option value={1}>information</option><option value={2}>warnings</option><option value={3}>errors</option>
        </select>
        <span class="said" role="status">{count(shown.length, all.items.length, all.of)}</span>
      </div>
      <Rows label="Events" count={shown.length} selected={chosen ? shown.findIndex((item) => item.t === chosen.t && item.row === chosen.row) : -1} current={useCurrent(shown, clock)} follows={clock.playing.value || !chosen}
        classOf={(place) => ["debug", "", "warning", "bad"][numbers(shown[place]!.frame, "severity")[shown[place]!.row]!] ?? ""}
        onChoose={(place) => {
          const item = shown[place]!;
          selectedAt.value = { t: item.t, row: item.row };
          clock.seek(item.t);
        }}
        row={(place) => {
          const { frame, row, t, channel } = shown[place]!;
          return <><time>{moment(t)}</time>{sources && <span class="source">{channel.source}</span>}<span class="faint">{texts(frame, "who").at(row)}</span><b>{texts(frame, "what").at(row)}</b><span class="grow">{texts(frame, "detail").at(row)}</span></>;
        }} />
    </div>
  );
}
