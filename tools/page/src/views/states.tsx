// A state machine, drawn, with its state of now lit and a strip of its states over time.
import { render } from "preact";
import { numbers, texts } from "../data/frames";
import { lastAt } from "../data/search";
import type { ChannelHeader } from "../generated/view";
import type { App, ViewKind } from "../shell/app";
import { duration, moment } from "../time/format";
import { reads } from "../time/reads";

export const states: ViewKind = {
  id: "states", title: "State machine", doc: "State machines of the parts, the state of now lit.",
  has: (store) => store.channels("state").length > 0,
  mount: (app, host) => {
    render(<States app={app} />, host);
    return () => render(null, host);
  },
};

function States({ app }: { app: App }) {
  return <div class="state-list">{app.store.channels("state").map((channel) => <Machine key={channel.id} app={app} channel={channel} />)}</div>;
}

const WIDTH = 640, HEIGHT = 420, BOX_W = 108, BOX_H = 34;

function Machine({ app, channel }: { app: App; channel: ChannelHeader }) {
  const { store, clock } = app;
  reads(store.version.value);
  const frame = store.whole(channel.id), row = frame ? lastAt(frame.t, clock.now.value) : -1;
  const state = frame && row >= 0 ? numbers(frame, "state")[row]! : -1, last = frame && row > 0 ? numbers(frame, "state")[row - 1]! : -1;
  const places = placed(channel.states.length), was = new Set<number>();
  if (frame) for (let n = 0; n <= row; n++) was.add(numbers(frame, "state")[n]!);
  const here = frame && row >= 0 ? `${channel.states[state] ?? "?"} since ${moment(frame.t[row]!)}, ${duration(clock.now.value - frame.t[row]!)} so far${texts(frame, "cause").at(row) ? `; ${texts(frame, "cause").at(row)}` : ""}` : "not begun";
  const taken = (from: number, to: number) => from === last && to === state;
  return (
    <section class="machine" aria-label={`State machine ${[channel.source, channel.name].filter(Boolean).join(" ")}`}>
      <p><b>{[channel.source, channel.name].filter(Boolean).join(" ")}</b> <span role="status">{here}</span></p>
      <svg viewBox={`0 0 ${WIDTH} ${HEIGHT}`} role="img" aria-label={`${channel.states.length} states: ${channel.states.map((name, n) => (n === state ? `${name} (now)` : name)).join(", ")}`}>
        <defs>{["idle", "taken"].map((kind) => <marker id={`tip-${channel.id}-${kind}`} class={`tip ${kind}`} viewBox="0 0 8 8" refX="7" refY="4" markerWidth="7" markerHeight="7" orient="auto-start-reverse"><path d="M0 0.500L8 4L0 7.500z" /></marker>)}</defs>
        {channel.transitions.map(({ source, target, cause }) => {
          const from = places[source], to = places[target];
          if (!from || !to || source === target) return null;
          const isTaken = taken(source, target), bothWays = channel.transitions.some((one) => one.source === target && one.target === source);
          return (
            <g class={isTaken ? "transition taken" : "transition"}>
              <path d={arc(from, to, bothWays)} marker-end={`url(#tip-${channel.id}-${isTaken ? "taken" : "idle"})`}><title>{`${channel.states[source]!} → ${channel.states[target]!}${cause ? `: ${cause}` : ""}`}</title></path>
            </g>
          );
        })}
        {channel.states.map((name, n) => {
          const [x, y] = places[n]!;
          return (
            <g class={`state${n === state ? " now" : ""}${was.has(n) ? " was" : ""}`} transform={`translate(${x - BOX_W / 2} ${y - BOX_H / 2})`}>
              <rect width={BOX_W} height={BOX_H} rx="8" /><text x={BOX_W / 2} y={BOX_H / 2 + 5} text-anchor="middle">{name.length > 14 ? `${name.slice(0, 13)}…` : name}</text>
            </g>
          );
        })}
      </svg>
      {frame && <ol class="visits" aria-label="States in order">{Array.from({ length: frame.count }, (_, n) => n).slice(Math.max(0, row - 5), Math.max(0, row - 5) + 12).map((n) => (
        <li class={n === row ? "current" : ""}><button type="button" class="link" onClick={() => clock.seek(frame.t[n]!)}>{`${moment(frame.t[n]!)} ${channel.states[numbers(frame, "state")[n]!] ?? "?"}`}</button> <span class="faint">{texts(frame, "cause").at(n)}</span></li>
      ))}</ol>}
    </section>
  );
}

/** States on an ellipse, the first one at the top left, clockwise. */
function placed(count: number): (readonly [number, number])[] {
  const rx = WIDTH / 2 - BOX_W / 2 - 8, ry = HEIGHT / 2 - BOX_H / 2 - 8;
  return Array.from({ length: count }, (_, n) => {
    const angle = (2 * Math.PI * n) / count - Math.PI / 2;
    return [WIDTH / 2 + rx * Math.cos(angle), HEIGHT / 2 + ry * Math.sin(angle)] as const;
  });
}

/** A line from box to box; bent where there is one back, too. */
function arc([x0, y0]: readonly [number, number], [x1, y1]: readonly [number, number], isBent: boolean): string {
  const dx = x1 - x0, dy = y1 - y0, long = Math.hypot(dx, dy) || 1, bend = isBent ? 26 : 0, cx = (x0 + x1) / 2 - (dy / long) * bend, cy = (y0 + y1) / 2 + (dx / long) * bend;
  const [ax, ay] = edge(x0, y0, cx, cy), [bx, by] = edge(x1, y1, cx, cy);
  return `M${ax.toFixed(1)} ${ay.toFixed(1)}Q${cx.toFixed(1)} ${cy.toFixed(1)} ${bx.toFixed(1)} ${by.toFixed(1)}`;
}

/** Where a line from a box's middle to a point leaves the box. */
function edge(x: number, y: number, tx: number, ty: number): [number, number] {
  const dx = tx - x, dy = ty - y, share = Math.min(dx ? (BOX_W / 2 + 2) / Math.abs(dx) : Infinity, dy ? (BOX_H / 2 + 2) / Math.abs(dy) : Infinity);
  return [x + dx * Math.min(1, share), y + dy * Math.min(1, share)];
}
