// A plan that stands still: a world with ways, contacts and places in it, as in a campaign's failures or a run of several robots.
import { effect } from "@preact/signals";
import { render } from "preact";
import type { PagePlan } from "../../generated/view";
import { halo, surface } from "../../shell/surface";
import { curveColour, theme } from "../../shell/theme";
import { type Bounds, Camera } from "../plan/camera";
import * as drawing from "../plan/drawing";
import { covers } from "../plan/things";
import { reads } from "../../time/reads";

const EDGE_PX = 24, MOST_PX = 640;

export function mountPlan(host: HTMLElement, block: PagePlan): () => void {
  const figure = document.createElement("figure"), caption = document.createElement("figcaption"), place = document.createElement("div"), camera = new Camera(), legend = document.createElement("div");
  figure.className = "plot-figure";
  legend.className = "plot-legend";
  figure.append(...(block.title ? [caption] : []), legend, place);
  caption.textContent = block.title;
  if (block.text) figure.append(Object.assign(document.createElement("p"), { textContent: block.text, className: "prose" }));
  if (block.listing) {
    const listing = Object.assign(document.createElement("pre"), { textContent: block.listing, tabIndex: 0 });
    listing.setAttribute("role", "group");
    listing.setAttribute("aria-label", `Listing of ${block.title || "the plan"}`);
    figure.append(listing);
  }
  host.append(figure);
  const { x0, x1, y0, y1 } = extent(block), things = block.world?.things.filter((thing) => thing.is_there) ?? [];
  const size = () => { place.style.height = `${Math.min(MOST_PX, ((place.clientWidth || 600) * (y1 - y0)) / (x1 - x0) + EDGE_PX)}px`; };
  size();
  let pointer: { x: number; y: number } | undefined;
  const { canvas, redraw, dispose } = surface(place, `Plan${block.world ? ` of ${block.world.name}` : ""}: ${block.title || block.ways.map((way) => way.name).join(", ")}`, () => undefined, (sheet) => {
    const { g } = sheet;
    camera.fit({ x0, x1, y0, y1 }, sheet.width, sheet.height, EDGE_PX);
    drawing.grid(sheet, camera);
    const hovered = pointer && things.findLast((thing) => covers(thing, camera.wx(pointer!.x), camera.wy(pointer!.y)));
    drawing.things(sheet, camera, things, hovered?.name ?? "");
    drawing.names(sheet, camera, things);
    block.ways.forEach((way, n) => {
      g.strokeStyle = g.fillStyle = curveColour(n);
      g.lineWidth = 2;
      g.lineJoin = "round";
      g.setLineDash(n >= 8 ? [5, 4] : []);
      g.beginPath();
      way.x.forEach((x, m) => g.lineTo(camera.px(x), camera.py(way.y[m]!)));
      g.stroke();
      g.setLineDash([]);
      const last = way.x.length - 1;
      if (last < 0) return;
      g.beginPath(); g.arc(camera.px(way.x[0]!), camera.py(way.y[0]!), 4, 0, 7); g.fill();
      g.beginPath(); g.arc(camera.px(way.x[last]!), camera.py(way.y[last]!), 6, 0, 7); g.stroke();
      if (block.ways.length > 1 && block.ways.length <= 12) halo(g, way.name, camera.px(way.x[last]!) + 9, camera.py(way.y[last]!) - 7);
    });
    g.strokeStyle = theme.value.bad;
    g.lineWidth = 2.4;
    for (const [x, y] of block.hits) {
      const px = camera.px(x), py = camera.py(y);
      g.beginPath(); g.moveTo(px - 5, py - 5); g.lineTo(px + 5, py + 5); g.moveTo(px + 5, py - 5); g.lineTo(px - 5, py + 5); g.stroke();
    }
    g.fillStyle = theme.value.ink;
    g.textAlign = "left";
    for (const [x, y, word] of block.places) {
      g.beginPath(); g.arc(camera.px(x), camera.py(y), 3, 0, 7); g.fill();
      halo(g, word, camera.px(x) + 7, camera.py(y) + 4);
    }
    if (pointer) drawing.tip(sheet, hovered?.name ?? `x ${camera.wx(pointer.x).toFixed(2)} m, y ${camera.wy(pointer.y).toFixed(2)} m`, pointer.x, pointer.y);
  });
  const stop = effect(() => {
    reads(theme.value);
    render(<>{block.ways.length > 1 && block.ways.map((way, n) => <span class="curve"><svg width="18" height="6" aria-hidden="true"><line x1="0" x2="18" y1="3" y2="3" stroke={curveColour(n)} stroke-width="3" stroke-dasharray={n >= 8 ? "4 3" : ""} /></svg>{way.name}</span>)}</>, legend);
  });
  const observer = new ResizeObserver(size);
  observer.observe(figure);
  canvas.addEventListener("pointermove", (event) => { pointer = { x: event.offsetX, y: event.offsetY }; redraw(); });
  canvas.addEventListener("pointerleave", () => { pointer = undefined; redraw(); });
  return () => { observer.disconnect(); stop(); dispose(); figure.remove(); };
}

function extent(block: PagePlan): Bounds {
  let [x0, y0, x1, y1] = block.world?.extent_m ?? [Infinity, Infinity, -Infinity, -Infinity];
  const put = (x: number, y: number) => { x0 = Math.min(x0, x - 0.2); x1 = Math.max(x1, x + 0.2); y0 = Math.min(y0, y - 0.2); y1 = Math.max(y1, y + 0.2); };
  for (const way of block.ways) way.x.forEach((x, n) => put(x, way.y[n]!));
  for (const [x, y] of block.hits) put(x, y);
  return x1 > x0 && y1 > y0 ? { x0, y0, x1, y1 } : { x0: -3, y0: -3, x1: 3, y1: 3 };
}
