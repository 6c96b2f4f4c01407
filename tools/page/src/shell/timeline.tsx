// The time of the page: playing, speed, and a bar over the whole run with what happened on it.
import { effect } from "@preact/signals";
import { useEffect, useRef } from "preact/hooks";
import { numbers } from "../data/frames";
import { moment, roundStep, spoken, tickLabel, ticks } from "../time/format";
import { RATES } from "../time/clock";
import type { App } from "./app";
import { IconButton } from "./icons";
import { RunBar } from "../run_control/bar";
import { SMALL_FONT, surface } from "./surface";
import { theme } from "./theme";
import { reads } from "../time/reads";

/** Steps of the bar over the whole run. */
const STEPS = 10000;
const EDGE = 8;

export function Timeline({ app }: { app: App }) {
  const { clock, store } = app, isLive = store.header.value.is_live;
  if (app.controls) return <RunBar app={app} />;
  const run = store.run.value;
  return (
    <section class="timeline" aria-label="Time">
      <IconButton icon="first" label="To the start" onClick={() => clock.seek(clock.start.value)} />
      <IconButton icon={clock.playing.value ? "pause" : "play"} label={clock.playing.value ? "Pause" : "Play"} onClick={() => clock.toggle()} />
      <IconButton icon="last" label={isLive ? "Go with the run" : "To the end"} {...(isLive ? { pressed: clock.atEnd.value } : {})} onClick={() => {
        if (isLive) clock.goWithRun();
        else clock.seek(clock.end.value);
      }} />
      <select class="rate" aria-label="Speed of playing" value={clock.rate.value} onChange={(event) => { clock.rate.value = Number(event.currentTarget.value); }}>
        {RATES.map((rate) => <option value={rate}>{`${rate} ×`}</option>)}
      </select>
      <Scrub app={app} />
      <output class="now" aria-live="off">{moment(clock.now.value, clock.span.value / 1000)}</output>
      {app.drives && <button type="button" class="stop" onClick={() => app.stop()}>STOP</button>}
      {run && app.drives ? <p class={run.trouble ? "run-why trouble" : "run-why"} role="status">{run.trouble || run.why}</p> : run && <p class="run-why" role="status">{run.is_running ? "the run goes on" : `the run stands still${run.why ? `: ${run.why}` : ""}`}</p>}
    </section>
  );
}

export function Scrub({ app }: { app: App }) {
  const { clock } = app, place = useRef<HTMLDivElement>(null), length = clock.end.value - clock.start.value;
  useEffect(() => {
    const { canvas, dispose } = surface(place.current!, "", () => {
      reads(app.store.version.value, clock.head.value, app.store.run.value?.futures, clock.start.value, clock.end.value, clock.from.value, clock.to.value, clock.a.value, clock.b.value);
    }, ({ g, width, height }) => {
      const start = clock.start.value, span = clock.end.value - start, x = (t: number) => EDGE + ((t - start) / span) * (width - 2 * EDGE);
      g.fillStyle = theme.value.sonar;
      g.fillRect(x(clock.from.value), 0, Math.max(2, x(clock.to.value) - x(clock.from.value)), height);
      g.font = SMALL_FONT;
      g.fillStyle = theme.value.faint;
      g.strokeStyle = theme.value.line;
      g.textAlign = "center";
      const step = roundStep(span, Math.max(2, width / 80));
      for (const t of ticks(start, clock.end.value, step)) {
        g.beginPath(); g.moveTo(x(t), height - 13); g.lineTo(x(t), height - 9); g.stroke();
        if (x(t) > 14 && x(t) < width - 20) g.fillText(tickLabel(t, step, 0), x(t), height - 1);
      }
      for (const channel of app.store.channels("events")) {
        const frame = app.store.whole(channel.id);
        if (!frame) continue;
        const severities = numbers(frame, "severity");
        for (let row = 0; row < frame.count; row++) {
          const severity = severities[row]!;
          if (!severity) continue;
          g.fillStyle = severity >= 3 ? theme.value.bad : severity === 2 ? theme.value.warn : theme.value.faint;
          g.fillRect(x(frame.t[row]!), severity >= 2 ? 1 : 4, severity >= 2 ? 2 : 1, severity >= 2 ? 8 : 4);
        }
      }
      const head = clock.head.value;
      if (head !== null) {
        g.fillStyle = theme.value.right;
        g.fillRect(x(head) - 1, 0, 2, height - 12);
        g.beginPath(); g.moveTo(x(head) - 5, height - 12); g.lineTo(x(head) + 5, height - 12); g.lineTo(x(head), height - 19); g.fill();
      }
      for (const [t, colour] of [[clock.a.value, theme.value["cursor-a"]], [clock.b.value, theme.value["cursor-b"]]] as const) {
        if (t === null) continue;
        g.fillStyle = colour;
        g.fillRect(x(t) - 1, 0, 2, height - 12);
      }
    });
    canvas.setAttribute("aria-hidden", "true");
    canvas.removeAttribute("role");
    canvas.removeAttribute("aria-label");
    canvas.tabIndex = -1;
    return dispose;
  }, []);
  const input = useRef<HTMLInputElement>(null);
  useEffect(() => effect(() => {
    const element = input.current;
    if (!element) return;
    element.value = String(Math.round(((clock.now.value - clock.start.value) / Math.max(1, clock.end.value - clock.start.value)) * STEPS));
    element.setAttribute("aria-valuetext", spoken(clock.now.value));
  }), []);
  return (
    <div class="scrub" ref={place}>
      <input ref={input} type="range" min="0" max={STEPS} step="1" aria-label="Time of the run" onInput={(event) => clock.seek(clock.start.value + (Number(event.currentTarget.value) / STEPS) * length)} />
    </div>
  );
}
