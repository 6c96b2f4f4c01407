// Packets as they pass, with a filter, and byte by byte what one says.
import { signal } from "@preact/signals";
import { render } from "preact";
import { useState } from "preact/hooks";
import { numbers, type Runs, texts } from "../../data/frames";
import type { App, ViewKind } from "../../shell/app";
import { hex, moment } from "../../time/format";
import { type Item, itemAt, useCurrent, useShown } from "./gathering";
import { Rows } from "./rows";

export const packets: ViewKind = {
  id: "packets", title: "Packets", doc: "Packets of the robot's protocol; a click explains one byte by byte.",
  has: (store) => store.channels("packets").length > 0,
  mount: (app, host) => {
    render(<Packets app={app} />, host);
    return () => render(null, host);
  },
};

const filter = signal("");
const WAYS = ["←", "→", "·"] as const;
const WAY_WORDS = ["from the robot", "to the robot", "unknown direction"] as const;

const bytesOf = (item: Item) => (item.frame.columns.get("data") as Runs<Uint8Array>).at(item.row);
const wayOf = (item: Item) => numbers(item.frame, "to_robot")[item.row]!;

function Packets({ app }: { app: App }) {
  const { clock, store, selection } = app;
  const { all, shown } = useShown(app, store.channels("packets"), filter.value, (item) => `${hex(bytesOf(item))} ${WAY_WORDS[wayOf(item)]} ${item.channel.name} ${numbers(item.frame, "is_bad")[item.row] ? "bad" : ""}`);
  const chosen = selection.value, selected = chosen ? placeOf(shown, chosen.channel, chosen.t, chosen.place) : -1;
  const choose = (place: number) => {
    const item = shown[place]!;
    selection.value = { channel: item.channel.id, t: item.t, place: sameMoment(item) };
    clock.seek(item.t);
  };
  return (
    <div class="list-view">
      <div class="view-bar">
        <input type="search" class="filter" aria-label="Filter packets: words that are there, -word: that are not" placeholder="filter: VEL -SIP ff 02" value={filter.value} onInput={(event) => { filter.value = event.currentTarget.value; }} />
        <span class="said" role="status">{count(shown.length, all.items.length, all.of)}</span>
      </div>
      <Rows label="Packets" count={shown.length} selected={selected} current={useCurrent(shown, clock)} follows={clock.playing.value || selected < 0} onChoose={choose}
        classOf={(place) => (numbers(shown[place]!.frame, "is_bad")[shown[place]!.row] ? "bad" : "")}
        row={(place) => {
          const item = shown[place]!;
          return (
            <>
              <time>{moment(item.t)}</time><span class="way" role="img" aria-label={WAY_WORDS[wayOf(item)]}>{WAYS[wayOf(item)]}</span>
              <b>{texts(item.frame, "name").at(item.row)}</b><span class="grow">{texts(item.frame, "says").at(item.row)}</span><code>{hex(bytesOf(item))}</code>
            </>
          );
        }} />
      {selected >= 0 && <Explanation item={shown[selected]!} />}
    </div>
  );
}

/** How many rows of the same moment stand before one. */
function sameMoment(item: Item): number {
  let place = 0;
  while (item.row - place - 1 >= 0 && item.frame.t[item.row - place - 1] === item.t) place++;
  return place;
}

function placeOf(items: readonly Item[], channel: number, t: number, place: number): number {
  for (let n = itemAt(items, t); n >= 0 && items[n]!.t === t; n--) if (items[n]!.channel.id === channel && sameMoment(items[n]!) === place) return n;
  return -1;
}

/** "12 of 340", and what is not here. */
export function count(shown: number, here: number, of: number): string {
  const text = shown < here ? `${shown} of ${here}` : `${here}`;
  return here < of ? `${text}, ${of - here} more are left out` : text;
}

/** First byte, byte after the last, name, meaning. */
type Field = readonly [number, number, string, string];

function Explanation({ item }: { item: Item }) {
  const bytes = bytesOf(item), [lit, setLit] = useState(-1), written = texts(item.frame, "fields").at(item.row);
  const fields = written ? (JSON.parse(written) as readonly Field[]) : [];
  const fieldOf = (byte: number) => fields.findIndex(([from, to]) => byte >= from && byte < to);
  return (
    <section class="explanation" aria-label="The chosen packet, byte by byte">
      <p><b>{texts(item.frame, "name").at(item.row)}</b> {texts(item.frame, "says").at(item.row)} <span class="faint">{`${moment(item.t, 1)}, ${WAY_WORDS[wayOf(item)]!}, ${bytes.length} bytes`}</span></p>
      <div class="bytes">
        {Array.from(bytes, (byte, n) => <span class={`byte field-${Math.max(0, fieldOf(n)) % 4}${fieldOf(n) === lit && lit >= 0 ? " lit" : ""}`} onMouseEnter={() => setLit(fieldOf(n))} onMouseLeave={() => setLit(-1)} title={fields[fieldOf(n)]?.[2] ?? ""}>{byte.toString(16).padStart(2, "0")}</span>)}
      </div>
      {fields.length > 0
        ? <table class="fields"><thead><tr><th scope="col">bytes</th><th scope="col">value</th><th scope="col">field</th><th scope="col">meaning</th></tr></thead><tbody>
          {fields.map(([from, to, name, meaning], n) => (
            <tr class={n === lit ? "lit" : ""} onMouseEnter={() => setLit(n)} onMouseLeave={() => setLit(-1)}>
              <td>{to - from > 1 ? `${from}–${to - 1}` : from}</td><td><code>{hex(bytes.subarray(from, to))}</code></td><td>{name}</td><td>{meaning}</td>
            </tr>))}
        </tbody></table>
        : <p class="faint">It has no fields.</p>}
    </section>
  );
}
