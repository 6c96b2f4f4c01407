// The bar of a run that this page controls: on, still, a step, back; its speed; where it halts; its futures.
import { useEffect, useRef, useState } from "preact/hooks";
import { RATES } from "../time/clock";
import { moment } from "../time/format";
import { type App, UNITS } from "../shell/app";
import { Futures } from "./futures";
import { Halts } from "./halts";
import { Icon, IconButton } from "../shell/icons";
import { Scrub } from "../shell/timeline";

/** How fine a time is shown where a run stands still at an instruction, ns. */
const FINE_NS = 1;

export function RunBar({ app }: { app: App }) {
  const { clock, store } = app, run = store.run.value!, isHere = clock.atEnd.value;
  const [open, setOpen] = useState<"" | "halts" | "futures">(""), bar = useRef<HTMLElement>(null);
  const toggle = (which: "halts" | "futures") => setOpen(open === which ? "" : which);
  const close = () => {
    bar.current?.querySelector<HTMLElement>("[aria-expanded=true]")?.focus();
    setOpen("");
  };
  const { canGoBack } = store;
  useEffect(() => { if (!canGoBack) app.unit.value = "millisecond"; }, [canGoBack]);
  const said = run.trouble || (run.is_running ? "" : [isHere ? run.why : `the run stands at ${moment(run.head_ns)}`, isHere ? run.place : ""].filter(Boolean).join(" · "));
  return (
    <section class="timeline run-bar" aria-label="Time" ref={bar} onKeyDown={(event) => { if (event.key === "Escape" && open) close(); }}>
      {canGoBack && <IconButton icon="stepBack" label={`Back by one ${unitName(app)}`} disabled={run.is_running} onClick={() => app.step(-1)} />}
      <IconButton icon={run.is_running ? "pause" : "play"} label={run.is_running ? "Pause the run" : "Let the run go on from here"} onClick={() => app.toggle()} />
      <IconButton icon="stepOn" label={`On by one ${unitName(app)}`} disabled={run.is_running} onClick={() => app.step(1)} />
      <select class="unit" aria-label="A step goes by one" value={app.unit.value} onChange={(event) => { app.unit.value = event.currentTarget.value as typeof app.unit.value; }}>
        {UNITS.filter(([unit]) => canGoBack || unit === "millisecond").map(([unit, name]) => <option value={unit}>{name}</option>)}
      </select>
      <select class="rate" aria-label="Speed of the run" value={run.speed} onChange={(event) => app.ask({ do: "speed", speed: Number(event.currentTarget.value) })}>
        {[...new Set([...RATES, run.speed])].filter(Boolean).sort((a, b) => a - b).map((rate) => <option value={rate}>{`${rate} ×`}</option>)}
        <option value={0}>fastest</option>
      </select>
      <Scrub app={app} />
      <output class="now" aria-live="off">{moment(clock.now.value, run.is_running ? clock.span.value / 1000 : FINE_NS)}</output>
      <IconButton icon="last" label="To where the run stands" pressed={isHere} onClick={() => clock.goWithRun()} />
      {canGoBack && <span class="bar-buttons">
        <BarButton icon="halts" name="Halts" count={run.halts.length} isOpen={open === "halts"} onClick={() => toggle("halts")} />
        <BarButton icon="futures" name="Futures" count={run.futures.length} isOpen={open === "futures"} onClick={() => toggle("futures")} />
      </span>}
      <p class={run.trouble ? "run-why trouble" : "run-why"} role={run.trouble ? "alert" : "status"}>{said}</p>
      {open === "halts" && <Halts app={app} onClose={close} />}
      {open === "futures" && <Futures app={app} onClose={close} />}
    </section>
  );
}

function unitName(app: App): string {
  return UNITS.find(([unit]) => unit === app.unit.value)![1];
}

function BarButton({ icon, name, count, isOpen, onClick }: { icon: "halts" | "futures"; name: string; count: number; isOpen: boolean; onClick: () => void }) {
  return (
    <button type="button" class="bar-button" aria-expanded={isOpen} aria-haspopup="dialog" onClick={onClick}>
      <Icon name={icon} />{name} <span class="count">{count}</span>
    </button>
  );
}
