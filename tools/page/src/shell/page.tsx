// The whole page: head, views, time. A header without channels is a report alone, read as a document.
import { effect, signal } from "@preact/signals";
import { useEffect, useRef, useState } from "preact/hooks";
import type { PageHeader } from "../generated/view";
import type { Store } from "../data/store";
import { viewsOf } from "../views/all";
import { Sections } from "../views/report/blocks";
import { OPENS_AT } from "../views/report/open_run";
import type { App } from "./app";
import { type Dock, mountDock } from "./dock";
import { Head } from "./head";
import { pressed } from "./keys";
import { LAYOUTS } from "./layouts";
import { goTo, parsedPlace, placeOf, writtenPlace } from "./link";
import { Tabs } from "./tabs";
import { Timeline } from "./timeline";

/** Below it there is one view at a time. */
const WIDE = "(min-width: 760px)";
/** How long the address waits for a time that stands, ms. */
const ADDRESS_MS = 400;

/** @param store Of a page that is served. */
export function ReportPage({ header, store }: { header: PageHeader; store?: Store }) {
  return (
    <div class="document">
      <Head header={header} {...(store ? { trouble: store.trouble.value } : {})} />
      <main class="report"><OPENS_AT.Provider value={store}><Sections sections={header.sections} seek={undefined} /></OPENS_AT.Provider></main>
      {header.footer && <footer>{header.footer}</footer>}
    </div>
  );
}

export function RunPage({ app }: { app: App }) {
  const [start] = useState(() => parsedPlace(location.hash)), header = app.store.header.value;
  const [layout, setLayout] = useState(LAYOUTS.some((one) => one.id === start.layout) ? start.layout! : LAYOUTS[0]!.id), [isWide, setWide] = useState(matchMedia(WIDE).matches);
  const views = viewsOf(app.store), [view, setView] = useState(start.view && views.some((one) => one.id === start.view) ? start.view : (views[0]?.id ?? ""));
  const place = useRef<HTMLElement>(null), dock = useRef<Dock>(undefined);
  useEffect(() => goTo(app, start), []);
  useEffect(() => {
    const query = matchMedia(WIDE), changed = () => setWide(query.matches);
    query.addEventListener("change", changed);
    return () => query.removeEventListener("change", changed);
  }, []);
  useEffect(() => {
    if (!isWide) return undefined;
    dock.current = mountDock(app, place.current!, LAYOUTS.find((one) => one.id === layout)!);
    if (start.view) dock.current.show(start.view);
    return () => {
      dock.current?.dispose();
      dock.current = undefined;
    };
  }, [layout, isWide, views.map((one) => one.id).join(" ")]);
  useEffect(() => effect(() => {
    const { start_ns, end_ns } = app.store.header.value;
    app.clock.setRun(start_ns, Math.max(end_ns, app.clock.head.value ?? 0));
  }), []);
  useEffect(() => keepAddress(app, layout, isWide ? undefined : view), [layout, isWide, view]);
  useEffect(() => {
    const keydown = (event: KeyboardEvent) => {
      const number = Number(event.key);
      if ((event.ctrlKey || event.metaKey) && number >= 1 && views[number - 1]) {
        setView(views[number - 1]!.id);
        dock.current?.show(views[number - 1]!.id);
      } else if (!pressed(app, event)) return;
      event.preventDefault();
    };
    window.addEventListener("keydown", keydown);
    return () => window.removeEventListener("keydown", keydown);
  }, [views.length]);
  useEffect(() => play(app), []);
  const link = async () => {
    const fragment = `#${writtenPlace(placeOf(app, layout, isWide ? undefined : view))}`;
    history.replaceState(null, "", fragment);
    try {
      await navigator.clipboard.writeText(location.href);
      return true;
    } catch {
      return false; // a page from a file may not, in some browsers
    }
  };
  return (
    <div class="app">
      <Head header={header} app={app} {...(isWide ? { layout, onLayout: setLayout } : {})} onLink={link} />
      <main class="stage" ref={place} key={isWide ? "dock" : "tabs"}>{!isWide && views.length > 0 && <Tabs app={app} views={views} active={view} onChoose={setView} />}</main>
      <Timeline app={app} />
    </div>
  );
}

/** The address says where the page is, when time stands. */
function keepAddress(app: App, layout: string, view: string | undefined): () => void {
  let timer: ReturnType<typeof setTimeout> | undefined, isFirst = true;
  const stop = effect(() => {
    const place = placeOf(app, layout, view);
    if (app.clock.playing.value || app.clock.atEnd.value) return;
    clearTimeout(timer);
    if (isFirst) isFirst = false;
    else timer = setTimeout(() => history.replaceState(null, "", `#${writtenPlace(place)}`), ADDRESS_MS);
  });
  return () => {
    stop();
    clearTimeout(timer);
  };
}

/** Times of frames while it plays, ms: for measurements. */
export const frameTimes: number[] = [];

/** Lets time go on with the frames of the screen. */
function play(app: App): () => void {
  let frame = 0;
  const stop = effect(() => {
    if (!app.clock.playing.value) return undefined;
    let last = performance.now();
    const tick = (now: number) => {
      frameTimes.push(now - last);
      if (frameTimes.length > 4000) frameTimes.splice(0, 2000);
      app.clock.advance(now - last);
      last = now;
      frame = requestAnimationFrame(tick);
    };
    frame = requestAnimationFrame(tick);
    return () => cancelAnimationFrame(frame);
  });
  return stop;
}

/** Shown while nothing is there yet, or when nothing comes. */
export const waiting = signal("");
export function Waiting() {
  return <div class="waiting" role="status">{waiting.value}</div>;
}
