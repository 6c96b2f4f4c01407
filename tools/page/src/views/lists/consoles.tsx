// Lines of the program's consoles, both directions.
import { signal } from "@preact/signals";
import { render } from "preact";
import { numbers, texts } from "../../data/frames";
import type { App, ViewKind } from "../../shell/app";
import { moment } from "../../time/format";
import { useCurrent, useShown } from "./gathering";
import { count } from "./packets";
import { Rows } from "./rows";

export const consoles: ViewKind = {
  id: "consoles", title: "Consoles", doc: "What the program prints and what is typed to it, on each of its serial ports.",
  has: (store) => store.channels("text").length > 0,
  mount: (app, host) => {
    render(<Consoles app={app} />, host);
    return () => render(null, host);
  },
};

const port = signal(-1), filter = signal(""), chosenAt = signal<{ t: number; row: number } | null>(null);

function Consoles({ app }: { app: App }) {
  const { clock, store } = app, channels = store.channels("text");
  const { all, shown } = useShown(app, channels.filter((channel) => port.value < 0 || channel.id === port.value), filter.value, () => ""), chosen = chosenAt.value;
  const nameOf = (place: number) => [shown[place]!.channel.source, shown[place]!.channel.name].filter(Boolean).join(" ");
  return (
    <div class="list-view">
      <div class="view-bar">
        {channels.length > 1 && <select aria-label="Console" value={port.value} onChange={(event) => { port.value = Number(event.currentTarget.value); }}>
          <option value={-1}>all</option>{channels.map((channel) => <option value={channel.id}>{[channel.source, channel.name].filter(Boolean).join(" ")}</option>)}
        </select>}
        <input type="search" class="filter" aria-label="Filter lines" placeholder={`filter ${channels.length === 1 ? channels[0]!.name : "lines"}`} value={filter.value} onInput={(event) => { filter.value = event.currentTarget.value; }} />
        <span class="said" role="status">{count(shown.length, all.items.length, all.of)}</span>
      </div>
      <Rows label="Lines of the console" count={shown.length} selected={chosen ? shown.findIndex((item) => item.t === chosen.t && item.row === chosen.row) : -1} current={useCurrent(shown, clock)} follows={clock.playing.value || !chosen}
        onChoose={(place) => {
          const item = shown[place]!;
          chosenAt.value = { t: item.t, row: item.row };
          clock.seek(item.t);
        }}
        classOf={(place) => (numbers(shown[place]!.frame, "is_sent")[shown[place]!.row] ? "sent" : "")}
        row={(place) => {
          const { frame, row, t } = shown[place]!;
          return <><time>{moment(t)}</time>{port.value < 0 && channels.length > 1 && <span class="faint">{nameOf(place)}</span>}<code class="grow line">{numbers(frame, "is_sent")[row] ? "> " : ""}{texts(frame, "text").at(row)}</code></>;
        }} />
    </div>
  );
}
