// Plots of numbers over time, one chart for each group with its unit, on the page's time.
import { effect, signal, untracked } from "@preact/signals";
import { render } from "preact";
import uPlot from "uplot";
import { numbers } from "../../data/frames";
import { firstFrom } from "../../data/search";
import type { App, ViewKind } from "../../shell/app";
import { timeLines } from "../../shell/lines";
import { curveColour, theme } from "../../shell/theme";
import { quantity, roundStep, tickBase, tickLabel, ticks } from "../../time/format";
import { aligned, type Chart, chartsOf, valueAt } from "./curves";
import { reads } from "../../time/reads";
import { Variables } from "./variables";

const LEAST_HEIGHT_PX = 150;
/** Curves on one another are both seen: widths and dashes by their place. */
const STROKES: readonly { width: number; dash: number[] }[] = [{ width: 2.6, dash: [] }, { width: 1.6, dash: [6, 4] }, { width: 1.8, dash: [2, 3] }, { width: 1.6, dash: [10, 3, 2, 3] }];

export const plots: ViewKind = {
  id: "plots", title: "Plots", doc: "Numbers over time with their units: speeds, ranges, voltages, variables of the program.",
  has: (store) => chartsOf(store).length > 0 || (store.mayControl.value && store.canGoBack && !store.header.value.hands?.is_real), // variables are chosen here
  mount: (app, host) => {
    const list = document.createElement("div"), variables = document.createElement("div");
    list.className = "plot-list";
    host.append(variables, list);
    render(<Variables app={app} />, variables);
    let mounted: (() => void)[] = [], key = "";
    const stop = effect(() => {
      const charts = chartsOf(app.store), found = JSON.stringify(charts.map((chart) => [chart.title, chart.unit, chart.curves.map((curve) => curve.key)]));
      if (found === key) return;
      key = found;
      for (const end of mounted) end();
      list.replaceChildren();
      mounted = charts.map((chart) => mountChart(app, list, chart, charts.length));
    });
    return () => {
      stop();
      render(null, variables);
      for (const end of mounted) end();
    };
  },
};

function mountChart(app: App, list: HTMLElement, chart: Chart, count: number): () => void {
  const { clock, store } = app, section = document.createElement("section"), legend = document.createElement("div"), place = document.createElement("div");
  section.className = "plot";
  section.setAttribute("aria-label", `${chart.title}, ${chart.unit || "without unit"}`);
  legend.className = "plot-legend";
  place.className = "plot-place";
  section.append(legend, place);
  list.append(section);
  const hidden = signal<ReadonlySet<string>>(new Set());
  render(<Legend app={app} chart={chart} hidden={hidden} />, legend);
  let plot: uPlot | undefined, lines: { readonly dispose: () => void } | undefined, asked = 0;
  const height = () => Math.max(LEAST_HEIGHT_PX, Math.min(260, list.clientHeight / count - 34));
  const build = () => {
    lines?.dispose();
    plot?.destroy();
    plot = new uPlot(options(app, chart, place.clientWidth || 600, height()), aligned(store, chart, clock.from.peek(), clock.to.peek(), place.clientWidth || 600), place);
    plot.root.querySelector("canvas")?.setAttribute("role", "img");
    plot.root.querySelector("canvas")?.setAttribute("aria-label", `${chart.title} over time: ${chart.curves.map((curve) => curve.name).join(", ")}${chart.unit ? `, in ${chart.unit}` : ""}`);
    listen(app, plot);
    const { over } = plot;
    lines = untracked(() => timeLines(over, clock, (t) => (t < clock.from.value || t > clock.to.value ? undefined : `${((t - clock.from.value) / clock.span.value) * 100}%`)));
  };
  const stopBuild = effect(() => {
    reads(theme.value);
    build();
  });
  const paint = () => {
    asked = 0;
    if (!plot) return;
    plot.setData(aligned(store, chart, clock.from.peek(), clock.to.peek(), plot.width), true);
    chart.curves.forEach((curve, n) => {
      const isShown = !hidden.peek().has(curve.key);
      if (plot!.series[n + 1]!.show !== isShown) plot!.setSeries(n + 1, { show: isShown });
    });
  };
  const stopPaint = effect(() => {
    reads(store.version.value, clock.from.value, clock.to.value, hidden.value);
    asked ||= requestAnimationFrame(paint);
  });
  const observer = new ResizeObserver(() => {
    if (plot && place.clientWidth && (plot.width !== place.clientWidth || plot.height !== height())) plot.setSize({ width: place.clientWidth, height: height() });
  });
  observer.observe(list);
  return () => {
    observer.disconnect();
    stopBuild();
    stopPaint();
    lines?.dispose();
    if (asked) cancelAnimationFrame(asked);
    plot?.destroy();
    render(null, legend);
    section.remove();
  };
}

function options(app: App, chart: Chart, width: number, height: number): uPlot.Options {
  const { clock } = app, colours = theme.peek(), axis = { stroke: colours.faint, grid: { stroke: colours.line, width: 1 }, ticks: { stroke: colours.line, width: 1 }, font: "11px system-ui, sans-serif" };
  const step = () => roundStep(clock.span.peek(), Math.max(2, width / 90));
  return {
    width, height,
    legend: { show: false },
    cursor: { drag: { x: false, y: false, setScale: false }, y: false },
    scales: { x: { time: false, range: () => [clock.from.peek() / 1e9, clock.to.peek() / 1e9] }, y: { range: (_plot, least, most) => padded(least, most, chart) } },
    axes: [
      { ...axis, size: 26, splits: () => ticks(clock.from.peek(), clock.to.peek(), step()).map((t) => t / 1e9), values: (_plot, splits) => splits.map((t) => tickLabel(t * 1e9, step(), tickBase(clock.from.peek(), step()))) },
      { ...axis, size: 52, label: chart.unit, labelSize: 16, labelFont: "11px system-ui, sans-serif", space: 28, values: (_plot, splits) => splits.map((value) => quantity(value, "")) },
    ],
    series: [{}, ...chart.curves.map((curve, n): uPlot.Series => ({
      label: curve.name, stroke: curveColour(n), spanGaps: true, points: { show: false }, ...STROKES[n % STROKES.length]!,
      ...(curve.isStepped ? { paths: uPlot.paths.stepped!({ align: 1 }) } : {}),
    }))],
    hooks: { draw: [(plot) => drawLines(app, chart, plot)] },
  };
}

function padded(least: number | null, most: number | null, chart: Chart): [number, number] {
  const marks = chart.curves.map((curve) => curve.mark).filter((mark) => mark !== null);
  const low = Math.min(least ?? 0, ...marks), high = Math.max(most ?? 1, ...marks), edge = (high - low || 1) * 0.06;
  return [low >= 0 && low < (high - low) * 0.3 ? 0 : low - edge, high + edge];
}

/** Marks of the channels and errors of the run, over the curves. */
function drawLines(app: App, chart: Chart, plot: uPlot): void {
  const { clock, store } = app, { ctx, bbox } = plot, colours = theme.peek(), ratio = devicePixelRatio || 1;
  ctx.save();
  ctx.beginPath();
  ctx.rect(bbox.left, bbox.top, bbox.width, bbox.height);
  ctx.clip();
  ctx.setLineDash([]);
  const upright = (t: number, colour: string, width: number) => {
    const x = plot.valToPos(t / 1e9, "x", true);
    ctx.strokeStyle = colour;
    ctx.lineWidth = width * ratio;
    ctx.beginPath();
    ctx.moveTo(x, bbox.top);
    ctx.lineTo(x, bbox.top + bbox.height);
    ctx.stroke();
  };
  for (const channel of store.channels("events")) {
    const frame = store.whole(channel.id);
    if (!frame) continue;
    const severities = numbers(frame, "severity"), xs = numbers(frame, "x_m");
    for (let row = firstFrom(frame.t, clock.from.peek()); row < frame.count && frame.t[row]! <= clock.to.peek(); row++)
      if (severities[row]! >= 2 && Number.isFinite(xs[row]!)) upright(frame.t[row]!, colours.bad, 1);
  }
  for (const [n, curve] of chart.curves.entries()) {
    if (curve.mark === null) continue;
    const y = plot.valToPos(curve.mark, "y", true);
    ctx.strokeStyle = ctx.fillStyle = curveColour(n + 1);
    ctx.lineWidth = 1.3 * ratio;
    ctx.setLineDash([4 * ratio, 4 * ratio]);
    ctx.beginPath();
    ctx.moveTo(bbox.left, y);
    ctx.lineTo(bbox.left + bbox.width, y);
    ctx.stroke();
    ctx.setLineDash([]);
    ctx.font = `${11 * ratio}px system-ui, sans-serif`;
    ctx.fillText(quantity(curve.mark, chart.unit), bbox.left + 4 * ratio, y - 4 * ratio);
  }
  ctx.restore();
}

function listen(app: App, plot: uPlot): void {
  const { clock } = app, { over } = plot, timeAt = (event: MouseEvent) => plot.posToVal(event.offsetX, "x") * 1e9;
  let drag: { x: number; from: number; to: number; moved: boolean } | undefined;
  over.addEventListener("wheel", (event) => {
    if (!event.ctrlKey && !event.shiftKey && Math.abs(event.deltaY) > Math.abs(event.deltaX)) return; // scrolls the list
    event.preventDefault();
    if (Math.abs(event.deltaX) > Math.abs(event.deltaY)) clock.pan(event.deltaX / over.clientWidth);
    else clock.zoom(event.deltaY > 0 ? 1.25 : 0.8, timeAt(event));
  }, { passive: false });
  over.addEventListener("pointerdown", (event) => {
    drag = { x: event.clientX, from: clock.from.peek(), to: clock.to.peek(), moved: false };
    over.setPointerCapture(event.pointerId);
  });
  over.addEventListener("pointermove", (event) => {
    if (!drag) return;
    if (Math.abs(event.clientX - drag.x) > 3) drag.moved = true;
    const by = ((drag.x - event.clientX) / over.clientWidth) * (drag.to - drag.from);
    if (drag.moved) clock.look(drag.from + by, drag.to + by);
  });
  over.addEventListener("pointerup", (event) => {
    if (drag && !drag.moved) {
      if (event.shiftKey) clock.setCursor("a", timeAt(event));
      else if (event.altKey || event.ctrlKey) clock.setCursor("b", timeAt(event));
      else clock.seek(timeAt(event));
    }
    drag = undefined;
  });
  over.addEventListener("dblclick", () => clock.showAll());
}

function Legend({ app, chart, hidden }: { app: App; chart: Chart; hidden: { value: ReadonlySet<string> } }) {
  reads(app.store.version.value);
  const now = app.clock.now.value;
  const toggle = (key: string) => {
    const next = new Set(hidden.value);
    if (!next.delete(key)) next.add(key);
    hidden.value = next;
  };
  return (
    <>
      <h2>{chart.title}<small>{chart.unit || chart.curves[0]!.channel.doc}</small></h2>
      {chart.curves.map((curve, n) => {
        const value = valueAt(app.store, curve, now), stroke = STROKES[n % STROKES.length]!;
        return (
          <button type="button" class="curve" aria-pressed={!hidden.value.has(curve.key)} onClick={() => toggle(curve.key)} title={curve.channel.doc || `Show or hide ${curve.name}`}>
            <svg width="22" height="8" aria-hidden="true"><line x1="0" x2="22" y1="4" y2="4" stroke={curveColour(n)} stroke-width={stroke.width} stroke-dasharray={stroke.dash.join(" ")} /></svg>
            <span>{curve.name}</span><span class="curve-value">{value === undefined ? "" : quantity(value, chart.unit)}</span>
          </button>
        );
      })}
    </>
  );
}
