// One view at a time with tabs above, on a narrow page.
import { useEffect, useRef } from "preact/hooks";
import type { App, ViewKind } from "./app";

export function Tabs({ app, views, active, onChoose }: { app: App; views: readonly ViewKind[]; active: string; onChoose: (id: string) => void }) {
  const place = useRef<HTMLDivElement>(null), list = useRef<HTMLDivElement>(null), view = views.find((one) => one.id === active) ?? views[0]!;
  useEffect(() => {
    const host = document.createElement("div");
    host.className = `view view-${view.id}`;
    place.current!.append(host);
    const end = view.mount(app, host);
    list.current?.querySelector("[aria-selected=true]")?.scrollIntoView({ block: "nearest", inline: "nearest" });
    return () => {
      end();
      host.remove();
    };
  }, [view.id]);
  const steps: Readonly<Record<string, number>> = { ArrowRight: 1, ArrowLeft: -1, Home: -Infinity, End: Infinity };
  return (
    <div class="tabs">
      <div class="tab-list" role="tablist" aria-label="Views" ref={list} onKeyDown={(event) => {
        const step = steps[event.key], at = views.indexOf(view);
        if (step === undefined) return;
        event.preventDefault();
        onChoose(views[Math.min(views.length - 1, Math.max(0, at + step))]!.id);
        requestAnimationFrame(() => list.current?.querySelector<HTMLElement>("[aria-selected=true]")?.focus());
      }}>
        {views.map((one) => <button type="button" role="tab" id={`tab-${one.id}`} aria-controls="tab-panel" aria-selected={one === view} tabIndex={one === view ? 0 : -1} onClick={() => onChoose(one.id)}>{one.title}</button>)}
      </div>
      <div class="tab-panel" id="tab-panel" role="tabpanel" aria-labelledby={`tab-${view.id}`} ref={place} />
    </div>
  );
}
