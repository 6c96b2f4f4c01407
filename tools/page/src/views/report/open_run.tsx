// A run that a report tells of, made again and opened by a click: where the page is served, and its link may.
import { createContext } from "preact";
import { useContext, useEffect, useState } from "preact/hooks";
import type { Store } from "../../data/store";
import { isLink } from "./links";

/** Where it is asked for; undefined in a page that is one file. */
export const OPENS_AT = createContext<Store | undefined>(undefined);

export function OpenRun({ number, title }: { number: number; title: string }) {
  const store = useContext(OPENS_AT), [isAsked, setAsked] = useState(false), run = store?.run.value;
  const found = run?.opened.find((one) => one.number === number), url = found && isLink(found.url) ? found.url : "";
  useEffect(() => {
    if (!isAsked || !url) return;
    setAsked(false); // who comes back finds the link
    location.assign(url);
  }, [isAsked, url]);
  if (!store || !run || (!store.mayControl.value && !found)) return null;
  const isBusy = isAsked && !found;
  return (
    <p class="open-run">
      {store.mayControl.value && !url && <button type="button" disabled={isBusy || found?.words === RUNNING} onClick={() => {
        setAsked(true);
        store.command({ do: "open", number });
      }}>{`Run and open ${title}`}</button>}
      {url && <a href={url}>{`Open ${title}`}</a>}
      <span role="status">{found?.words ?? (isBusy ? "waiting …" : "")}</span>
    </p>
  );
}

/** As the program says it while a point runs. */
const RUNNING = "running …";
