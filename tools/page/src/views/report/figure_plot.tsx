// A plot that is not over the run's time: lines, steps, points and bars with ticks and units on both axes.
import { effect } from "@preact/signals";
import { render } from "preact";
import type { PageCurve, PagePlot } from "../../generated/view";
import { halo, type Sheet, SMALL_FONT, surface } from "../../shell/surface";
import { curveColour, theme } from "../../shell/theme";
import { quantity, roundStep, ticks, trimmed } from "../../time/format";
import { isLink } from "./links";
import { reads } from "../../time/reads";

const LEFT = 58, RIGHT = 14, TOP = 10, BOTTOM = 40;
const HEIGHT_PX = 240;
const NEAR_PX = 9;

interface Axes {
  readonly x: (value: number) => number;
  readonly y: (value: number) => number;
}

export function mountPlot(host: HTMLElement, block: PagePlot): () => void {
  const figure = document.createElement("figure"), caption = document.createElement("figcaption"), place = document.createElement("div"), legend = document.createElement("div");
  figure.className = "plot-figure";
  caption.textContent = block.title;
  if (block.title) figure.append(caption);
  legend.className = "plot-legend";
  figure.append(legend, place);
  host.append(figure);
  place.style.height = `${HEIGHT_PX}px`;
  let axes: Axes | undefined, hovered: { curve: PageCurve; n: number } | undefined;
  const { canvas, redraw, dispose } = surface(place, described(block), () => undefined, (sheet) => {
    if (block.is_equal) place.style.height = `${Math.min(620, equalHeight(block, sheet.width))}px`;
    axes = draw(block, sheet, hovered);
  });
  const stop = effect(() => {
    reads(theme.value);
    render(<>{block.curves.length > 1 && block.curves.map((curve, n) => <span class="curve"><svg width="14" height="10" aria-hidden="true"><rect width="14" height={curve.style === "bars" ? 10 : 3} y={curve.style === "bars" ? 0 : 4} fill={curveColour(n)} /></svg>{curve.name}</span>)}</>, legend);
  });
  const nearest = (event: MouseEvent) => {
    let best: { curve: PageCurve; n: number } | undefined, near = NEAR_PX;
    if (axes) for (const curve of block.curves) curve.x.forEach((x, n) => {
      const away = Math.hypot(axes!.x(x) - event.offsetX, (curve.style === "bars" ? 0 : axes!.y(curve.y[n]!) - event.offsetY));
      if (away < near) [near, best] = [away, { curve, n }];
    });
    return best;
  };
  canvas.addEventListener("pointermove", (event) => {
    hovered = nearest(event);
    canvas.style.cursor = hovered && isLink(hovered.curve.hrefs[hovered.n] ?? "") ? "pointer" : "";
    redraw();
  });
  canvas.addEventListener("pointerleave", () => {
    hovered = undefined;
    redraw();
  });
  canvas.addEventListener("click", (event) => {
    const found = nearest(event), href = found?.curve.hrefs[found.n] ?? "";
    if (isLink(href)) location.assign(href);
  });
  return () => {
    stop();
    dispose();
    figure.remove();
  };
}

/** What a person who does not see the plot gets: its axes and each curve's range. */
function described(block: PagePlot): string {
  const curves = block.curves.map((curve) => `${curve.name || "values"}: ${curve.y.length} from ${quantity(Math.min(...curve.y), block.y_unit)} to ${quantity(Math.max(...curve.y), block.y_unit)}`);
  return `${block.title || "Plot"}: ${block.y_name || "value"} over ${block.x_name || "x"}. ${curves.slice(0, 6).join("; ")}`;
}

function bounds(block: PagePlot): { x0: number; x1: number; y0: number; y1: number } {
  let [x0, x1, y0, y1] = [Infinity, -Infinity, Infinity, -Infinity];
  for (const curve of block.curves) {
    const half = curve.style === "bars" ? barWidth(curve) / 2 : 0;
    for (const x of curve.x) { x0 = Math.min(x0, x - half); x1 = Math.max(x1, x + half); }
    for (const y of curve.y) if (Number.isFinite(y)) { y0 = Math.min(y0, y); y1 = Math.max(y1, y); }
    if (curve.style === "bars") y0 = Math.min(0, y0);
  }
  for (const mark of block.marks) { x0 = Math.min(x0, mark); x1 = Math.max(x1, mark); }
  if (!(x1 > x0)) [x0, x1] = [(x0 || 0) - 0.5, (x1 || 0) + 0.5];
  if (!(y1 > y0)) [y0, y1] = Number.isFinite(y0) ? [y0 - 0.5, y1 + 0.5] : [0, 1];
  if (block.curves.some((curve) => curve.style === "points")) [x0, x1] = [x0 - (x1 - x0) * 0.03, x1 + (x1 - x0) * 0.03];
  const edge = (y1 - y0) * 0.06;
  return { x0, x1, y0: y0 === 0 ? 0 : y0 - edge, y1: y1 + edge };
}

const barWidth = (curve: PageCurve) => (curve.x.length > 1 ? Math.abs(curve.x[1]! - curve.x[0]!) : 1);

function equalHeight(block: PagePlot, width: number): number {
  const { x0, x1, y0, y1 } = bounds(block);
  return ((width - LEFT - RIGHT) * (y1 - y0)) / (x1 - x0) + TOP + BOTTOM;
}

function draw(block: PagePlot, { g, width, height }: Sheet, hovered: { curve: PageCurve; n: number } | undefined): Axes {
  const { x0, x1, y0, y1 } = bounds(block), wide = width - LEFT - RIGHT, high = height - TOP - BOTTOM;
  const axes: Axes = { x: (value) => LEFT + ((value - x0) / (x1 - x0)) * wide, y: (value) => TOP + ((y1 - value) / (y1 - y0)) * high };
  const xStep = roundStep(x1 - x0, Math.max(2, wide / 70)), yStep = roundStep(y1 - y0, Math.max(2, high / 36));
  g.font = SMALL_FONT;
  g.lineWidth = 1;
  g.strokeStyle = theme.value.line;
  g.fillStyle = theme.value.faint;
  g.textAlign = "center";
  for (const x of ticks(x0, x1, xStep)) {
    g.beginPath(); g.moveTo(axes.x(x), TOP); g.lineTo(axes.x(x), TOP + high); g.stroke();
    g.fillText(trimmed(x, 6), axes.x(x), TOP + high + 15);
  }
  g.textAlign = "right";
  for (const y of ticks(y0, y1, yStep)) {
    g.beginPath(); g.moveTo(LEFT, axes.y(y)); g.lineTo(LEFT + wide, axes.y(y)); g.stroke();
    g.fillText(trimmed(y, 6), LEFT - 6, axes.y(y) + 4);
  }
  g.fillStyle = theme.value.ink;
  g.textAlign = "center";
  g.fillText([block.x_name, block.x_unit].filter(Boolean).join(", "), LEFT + wide / 2, height - 6);
  g.save();
  g.translate(12, TOP + high / 2);
  g.rotate(-Math.PI / 2);
  g.fillText([block.y_name, block.y_unit].filter(Boolean).join(", "), 0, 0);
  g.restore();
  g.save();
  g.beginPath(); g.rect(LEFT, 0, wide, TOP + high); g.clip();
  block.curves.forEach((curve, n) => drawCurve(g, curve, axes, curveColour(n)));
  g.restore();
  g.strokeStyle = theme.value.bad;
  g.lineWidth = 1.5;
  for (const mark of block.marks) { g.beginPath(); g.moveTo(axes.x(mark), TOP); g.lineTo(axes.x(mark), TOP + high); g.stroke(); }
  if (hovered) {
    const { curve, n } = hovered, text = [curve.labels[n], `${trimmed(curve.x[n]!, 6)} ${block.x_unit}, ${trimmed(curve.y[n]!, 6)} ${block.y_unit}`].filter(Boolean).join(": ");
    g.fillStyle = theme.value.ink;
    g.textAlign = axes.x(curve.x[n]!) > LEFT + wide / 2 ? "right" : "left";
    halo(g, text, axes.x(curve.x[n]!), Math.max(TOP + 12, axes.y(curve.y[n]!) - 8));
  }
  return axes;
}

function drawCurve(g: CanvasRenderingContext2D, curve: PageCurve, axes: Axes, colour: string): void {
  g.strokeStyle = g.fillStyle = colour;
  g.lineWidth = 1.6;
  if (curve.style === "bars") {
    const half = (axes.x(barWidth(curve)) - axes.x(0)) / 2;
    curve.x.forEach((x, n) => g.fillRect(axes.x(x) - half, Math.min(axes.y(0), axes.y(curve.y[n]!)), Math.max(1, 2 * half - 1), Math.abs(axes.y(0) - axes.y(curve.y[n]!))));
  } else if (curve.style === "points") {
    curve.x.forEach((x, n) => { g.beginPath(); g.arc(axes.x(x), axes.y(curve.y[n]!), 3, 0, 7); g.fill(); });
  } else {
    g.beginPath();
    curve.x.forEach((x, n) => {
      if (!Number.isFinite(curve.y[n]!)) return;
      if (curve.style === "step" && n) g.lineTo(axes.x(x), axes.y(curve.y[n - 1]!));
      g.lineTo(axes.x(x), axes.y(curve.y[n]!));
    });
    g.stroke();
  }
}
