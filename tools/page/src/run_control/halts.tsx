// Where the run halts: the list, and a line to add one.
import { useLayoutEffect, useRef, useState } from "preact/hooks";
import type { Store } from "../data/store";
import type { App } from "../shell/app";
import { IconButton } from "../shell/icons";

export function Halts({ app, onClose }: { app: App; onClose: () => void }) {
  const { halts } = app.store.run.value!, [words, setWords] = useState(""), input = useRef<HTMLInputElement>(null);
  useLayoutEffect(() => input.current?.focus(), []);
  const add = (event: Event) => {
    event.preventDefault();
    if (words.trim()) app.ask({ do: "halt_at", words: words.trim() });
    setWords("");
    input.current?.focus();
  };
  return (
    <div class="bar-panel" role="dialog" aria-label="Where the run halts">
      <div class="help-head"><h2>Where the run halts</h2><IconButton icon="close" label="Close" onClick={onClose} /></div>
      <form class="one-line" onSubmit={add}>
        <input ref={input} class="grow" list="places" aria-label="A place to halt at" placeholder="pin PB12 high, line main.c:42, variable speed …" value={words} maxLength={400} onInput={(event) => setWords(event.currentTarget.value)} />
        <datalist id="places">{suggestions(app.store).map((one) => <option value={one} />)}</datalist>
        <button type="submit">Add</button>
      </form>
      {halts.length > 0 ? <ul class="plain-list">{halts.map((halt) => (
        <li key={halt.number}>
          <span class="grow">{halt.words}</span>
          <span class="faint">{halt.count ? `${halt.count} ×` : "not yet"}</span>
          <IconButton icon="missed" label={`Do not halt at ${halt.words}`} onClick={() => {
            app.ask({ do: "halt_not_at", number: halt.number });
            input.current?.focus(); // the button goes, and with it where keys go
          }} />
        </li>
      ))}</ul> : <p class="faint">Pins, packets, goals, places in the world, texts, faults, source lines and variables: the run stands still at the moment itself.</p>}
    </div>
  );
}

/** What may be typed, made of what the run has. */
function suggestions(store: Store): string[] {
  const wires = store.channels("levels").map((wire) => `pin ${wire.doc} changes`), consoles = store.channels("text").map((port) => `${port.name} sends `);
  return [
    ...wires, ...consoles, "packet SIP", "packet VEL", "goal missed", "goal met", "contact", "fault", "robot moves", "robot stops", "robot near 1.0 0.0 0.3", "robot within 0 0 1 1", "sonar 3 below 0.4",
    "note adapter driving", "line ", "variable ",
  ];
}
