// A canvas that fills its place, is sharp on any screen, and is drawn at most once a frame.
import { effect } from "@preact/signals";
import { SvgSheet } from "./svg";
import { theme } from "./theme";
import { reads } from "../time/reads";

export interface Sheet {
  readonly g: CanvasRenderingContext2D;
  readonly width: number;
  readonly height: number;
}

export interface Surface {
  readonly canvas: HTMLCanvasElement;
  /** Draws with the next frame. */
  readonly redraw: () => void;
  readonly dispose: () => void;
}

export const FONT = "12px system-ui, -apple-system, 'Segoe UI', sans-serif";
export const SMALL_FONT = "11px system-ui, -apple-system, 'Segoe UI', sans-serif";
export const MONO_FONT = "11px ui-monospace, 'SF Mono', Menlo, Consolas, monospace";

/** How long drawing took, of the last frames: what `frameTimes()` of the page reports. */
export const drawTimes: number[] = [];

const drawings = new WeakMap<HTMLCanvasElement, (sheet: Sheet) => void>();

/** What a surface shows, as SVG; undefined of a canvas that is none. */
export function svgOf(canvas: HTMLCanvasElement): string | undefined {
  const draw = drawings.get(canvas), { clientWidth: width, clientHeight: height } = canvas, measure = document.createElement("canvas").getContext("2d");
  if (!draw || !measure || !width) return undefined;
  const sheet = new SvgSheet(width, height, theme.peek().panel, measure);
  sheet.font = FONT;
  draw({ g: sheet as unknown as CanvasRenderingContext2D, width, height });
  return sheet.text();
}

/**
 * @param watch Reads every signal that the drawing depends on.
 * @param draw Draws everything, on a cleared sheet.
 */
export function surface(host: HTMLElement, label: string, watch: () => void, draw: (sheet: Sheet) => void): Surface {
  const canvas = document.createElement("canvas");
  canvas.className = "surface";
  canvas.tabIndex = 0;
  canvas.setAttribute("role", "img");
  canvas.setAttribute("aria-label", label);
  host.append(canvas);
  drawings.set(canvas, draw);
  let asked = 0, isGone = false;
  const paint = () => {
    asked = 0;
    const width = canvas.clientWidth, height = canvas.clientHeight, ratio = window.devicePixelRatio || 1;
    if (isGone || !width || !height) return;
    const wide = Math.round(width * ratio), high = Math.round(height * ratio);
    if (canvas.width !== wide) canvas.width = wide;
    if (canvas.height !== high) canvas.height = high;
    const g = canvas.getContext("2d", { willReadFrequently: true }); // drawn by the processor: several times quicker where the graphics are software, too
    if (!g) return;
    const begun = performance.now();
    g.setTransform(ratio, 0, 0, ratio, 0, 0);
    g.clearRect(0, 0, width, height);
    g.font = FONT;
    draw({ g, width, height });
    drawTimes.push(performance.now() - begun);
    if (drawTimes.length > 600) drawTimes.splice(0, 300);
  };
  const redraw = () => {
    if (!asked && !isGone) asked = requestAnimationFrame(paint);
  };
  const stop = effect(() => {
    reads(theme.value);
    watch();
    redraw();
  });
  const observer = new ResizeObserver(redraw);
  observer.observe(canvas);
  return {
    canvas,
    redraw,
    dispose: () => {
      isGone = true;
      stop();
      observer.disconnect();
      canvas.remove();
    },
  };
}

/** Text with an edge of the ground's colour, so that it is read on anything. */
export function halo(g: CanvasRenderingContext2D, text: string, x: number, y: number): void {
  g.save();
  g.strokeStyle = theme.value.panel;
  g.lineWidth = 3;
  g.lineJoin = "round";
  g.strokeText(text, x, y);
  g.restore();
  g.fillText(text, x, y);
}

/** Text cut with an ellipsis where it is wider than it may be. */
export function fitted(g: CanvasRenderingContext2D, text: string, width: number): string {
  if (g.measureText(text).width <= width) return text;
  let low = 0, high = text.length;
  while (low < high) {
    const middle = (low + high + 1) >> 1;
    if (g.measureText(text.slice(0, middle) + "…").width <= width) low = middle;
    else high = middle - 1;
  }
  return low ? text.slice(0, low) + "…" : "";
}
