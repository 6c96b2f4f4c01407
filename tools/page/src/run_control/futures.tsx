// The futures of a run: which there are, a new one from here, and where two of them part.
import { useLayoutEffect, useRef, useState } from "preact/hooks";
import type { FutureState } from "../generated/view";
import { moment } from "../time/format";
import type { App } from "../shell/app";
import { IconButton } from "../shell/icons";

const DONE = ["fault sonar-stuck 3 0.2", "fault link-down", "press stop-button", "pin PB12 low", "volts PA0 2.6", "type usart1 go"];

export function Futures({ app, onClose }: { app: App; onClose: () => void }) {
  const run = app.store.run.value!, [words, setWords] = useState(""), input = useRef<HTMLInputElement>(null);
  useLayoutEffect(() => input.current?.focus(), []);
  const drop = (future: FutureState) => {
    app.move({ do: "drop", future: future.name });
    input.current?.focus(); // the button goes, and with it where keys go
  };
  const fork = (event: Event) => {
    event.preventDefault();
    app.move({ do: "fork", ...(words.trim() ? { words: words.trim() } : {}) });
    setWords("");
  };
  return (
    <div class="bar-panel" role="dialog" aria-label="Futures of this run">
      <div class="help-head"><h2>Futures of this run</h2><IconButton icon="close" label="Close" onClick={onClose} /></div>
      <form class="one-line" onSubmit={fork}>
        <input ref={input} class="grow" list="doings" aria-label="What is done where the fork begins" placeholder={`at ${moment(app.clock.now.value)}: nothing, or fault link-down …`} value={words} maxLength={400} onInput={(event) => setWords(event.currentTarget.value)} />
        <datalist id="doings">{DONE.map((one) => <option value={one} />)}</datalist>
        <button type="submit">Fork here</button>
      </form>
      <ul class="plain-list">{run.futures.map((future) => <Row key={future.name} app={app} future={future} onDrop={() => drop(future)} />)}</ul>
    </div>
  );
}

function Row({ app, future, onDrop }: { app: App; future: FutureState; onDrop: () => void }) {
  const run = app.store.run.value!, isChosen = future.name === run.future, isBeside = !isChosen && app.beside.value === future.name;
  const about = future.parent ? `from ${future.parent} at ${moment(future.at_ns)}${future.words ? `: ${future.words}` : ""}` : "the run itself";
  return (
    <li class={isChosen ? "future chosen" : "future"}>
      <div class="one-line">
        <button type="button" class="link" aria-pressed={isChosen} onClick={() => app.move({ do: "choose", future: future.name })}>{future.name}</button>
        <span class="grow faint">{about}</span>
        <span class="faint">{future.is_over ? "at its end" : moment(future.head_ns)}</span>
        {!isChosen && <button type="button" aria-pressed={isBeside} onClick={() => {
          app.beside.value = isBeside ? null : future.name;
          if (!isBeside) app.ask({ do: "compare", future: future.name });
        }}>Compare</button>}
        {future.parent && <IconButton icon="missed" label={`Drop ${future.name}`} onClick={onDrop} />}
      </div>
      {future.against && <Parting app={app} future={future} />}
    </li>
  );
}

function Parting({ app, future }: { app: App; future: FutureState }) {
  const { parting, against } = future, go = (t: number) => app.clock.lookAt(t, 1e6);
  if (!parting.length) return <p class="parting">{`as ${against} until ${moment(future.until_ns)}`}</p>;
  return (
    <div class="parting wide">
      <p>{`parts from ${against} first by ${parting[0]!.signal}`}</p>
      <table class="data">
        <thead><tr><th scope="col">signal</th><th scope="col">when</th><th scope="col">{future.name}</th><th scope="col">{against}</th></tr></thead>
        <tbody>{parting.map((part) => (
          <tr><th scope="row">{part.signal}</th><td><button type="button" class="link" onClick={() => go(part.at_ns)}>{moment(part.at_ns, 1e3)}</button></td><td>{part.one}</td><td>{part.other}</td></tr>
        ))}</tbody>
      </table>
    </div>
  );
}
