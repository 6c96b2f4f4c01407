// The variables of the program that a run is watched by: a line to add one by its name, and those that are there.
import { useEffect, useRef, useState } from "preact/hooks";
import type { App } from "../../shell/app";
import { IconButton } from "../../shell/icons";

/** How long a name is typed at before what it may become is asked for, ms. */
const TYPED_MS = 120;

export function Variables({ app }: { app: App }) {
  const [words, setWords] = useState(""), input = useRef<HTMLInputElement>(null), { store } = app, run = store.run.value;
  useEffect(() => {
    const timer = setTimeout(() => store.offer(words), TYPED_MS);
    return () => clearTimeout(timer);
  }, [words]);
  if (!run || !app.controls || !store.canGoBack) return null;
  const add = (event: Event) => {
    event.preventDefault();
    if (words.trim()) app.ask({ do: "watch", words: words.trim() });
    setWords("");
    input.current?.focus();
  };
  return (
    <div class="variables">
      <form class="one-line" onSubmit={add}>
        <input ref={input} class="grow" list="variables" aria-label="A variable of the program" placeholder="variable: speed, state.count, values[2] …" value={words} maxLength={400} autocomplete="off" spellcheck={false} onInput={(event) => setWords(event.currentTarget.value)} />
        <datalist id="variables">{store.offered.value.map((one) => <option value={one} />)}</datalist>
        <button type="submit">Plot</button>
      </form>
      {run.variables.length > 0 && <ul class="chips" aria-label="Watched variables">{run.variables.map((name) => (
        <li key={name}><span>{name}</span><IconButton icon="missed" label={`Do not watch ${name}`} onClick={() => {
          app.ask({ do: "watch_not", words: name });
          input.current?.focus(); // the button goes, and with it where keys go
        }} /></li>
      ))}</ul>}
    </div>
  );
}
