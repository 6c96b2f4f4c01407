// The logic analyser: wires, buses and analog pins over time, two cursors, search, and what is decoded of them.
import { signal } from "@preact/signals";
import { render } from "preact";
import { lastAt } from "../../data/search";
import type { Store } from "../../data/store";
import type { App, ViewKind } from "../../shell/app";
import { Icon, IconButton } from "../../shell/icons";
import { timeLines } from "../../shell/lines";
import { fitted, FONT, type Sheet, SMALL_FONT, surface } from "../../shell/surface";
import { theme } from "../../shell/theme";
import { duration, frequency, moment, roundStep, tickBase, tickLabel, ticks } from "../../time/format";
import * as drawing from "./drawing";
import { find, parsedDuration, parsedValue, pulseAt, type Sought } from "./find";
import { DECODED, isAnalog, type Row, rowsOf } from "./rows";
import { reads } from "../../time/reads";

const SNAP_PX = 6;

export const logic: ViewKind = {
  id: "logic", title: "Logic analyser", doc: "Wires, buses, analog pins and what is decoded of them, to the nanosecond; two cursors, search.",
  has: (store) => store.channels("levels").length > 0 || store.header.value.channels.some(isAnalog),
  mount: (app, host) => new LogicView(app, host).dispose,
};

type What = Sought["what"];
const WHATS: readonly (readonly [What, string])[] = [
  ["rising", "rising edge"], ["falling", "falling edge"], ["change", "any change"], ["value", "value is"], ["shorter", "pulse shorter than"], ["text", "text contains"],
];

class LogicView {
  readonly dispose: () => void;
  readonly what = signal<What>("rising");
  readonly input = signal("");
  readonly said = signal("");
  private readonly reading = signal("");
  private pointer: { x: number; y: number } | undefined;
  private readonly scroller: HTMLElement;
  private scale: drawing.Scale = { from: 0, to: 1, left: 0, width: 1 };

  constructor(readonly app: App, host: HTMLElement) {
    const bar = part("view-bar"), readout = part("view-caption"), axis = part("logic-axis");
    this.scroller = part("logic-rows");
    const inner = part("logic-inner");
    this.scroller.append(inner);
    host.append(bar, axis, this.scroller, readout);
    const ruler = surface(axis, "Time axis", () => this.watch(), (sheet) => this.drawAxis(sheet));
    ruler.canvas.tabIndex = -1;
    ruler.canvas.setAttribute("aria-hidden", "true");
    const wires = surface(inner, "Logic analyser: levels of the wires over time", () => {
      this.watch();
      const rows = rowsOf(this.app.store), last = rows.at(-1);
      inner.style.height = `${last ? last.top + last.height + 4 : 40}px`;
    }, (sheet) => this.drawRows(sheet));
    this.scroller.addEventListener("scroll", wires.redraw);
    this.scroller.tabIndex = -1;
    const leftOf = (t: number) => {
      const { from, to } = app.clock, scale = this.scaleOf(wires.canvas.clientWidth);
      return t < from.value || t > to.value ? undefined : `${drawing.px(scale, t)}px`;
    };
    const lines = [timeLines(inner, app.clock, leftOf), timeLines(axis, app.clock, leftOf)], placed = new ResizeObserver(() => { for (const line of lines) line.place(); });
    placed.observe(inner);
    render(<Bar view={this} />, bar);
    render(<Readout view={this} />, readout);
    this.listen(wires.canvas, () => {
      wires.redraw();
      ruler.redraw();
    });
    this.listen(ruler.canvas, ruler.redraw);
    this.dispose = () => {
      placed.disconnect();
      for (const line of lines) line.dispose();
      wires.dispose();
      ruler.dispose();
      render(null, bar);
      render(null, readout);
    };
  }

  get readingText() { return this.reading; }

  /** Goes to the next or last place of the chosen wire that is sought, and says where none is. */
  async go(way: 1 | -1): Promise<void> {
    const { app } = this, wire = this.wire(), sought = this.sought();
    if (!wire || !sought) {
      this.said.value = wire ? "write what to look for" : "choose a wire";
      return;
    }
    const t = await find(app.store, wire.id, app.clock.now.peek(), way, sought);
    if (t === undefined) this.said.value = `${wire.name}: none ${way === 1 ? "after" : "before"} this time`;
    else {
      this.said.value = "";
      app.clock.lookAt(t, sought.what === "shorter" ? sought.ns : 1000);
      this.show(wire.id);
    }
  }

  wire() {
    const { store, wire } = this.app, rows = rowsOf(store).filter((row) => row.channel);
    return (rows.find((row) => row.channel!.id === wire.value) ?? rows[0])?.channel;
  }

  rows(): Row[] {
    return rowsOf(this.app.store);
  }

  private sought(): Sought | undefined {
    const what = this.what.value, text = this.input.value;
    if (what === "value") return Number.isNaN(parsedValue(text)) ? undefined : { what, value: parsedValue(text) };
    if (what === "shorter") return Number.isNaN(parsedDuration(text)) ? undefined : { what, ns: parsedDuration(text) };
    if (what === "text") return text ? { what, text } : undefined;
    return { what };
  }

  private show(id: number): void {
    const row = this.rows().find((one) => one.channel?.id === id), { scrollTop, clientHeight } = this.scroller;
    if (row && (row.top < scrollTop || row.top + row.height > scrollTop + clientHeight)) this.scroller.scrollTop = row.top - clientHeight / 2;
  }

  private watch(): void {
    const { store, clock, wire } = this.app;
    reads(store.version.value, store.header.value, clock.from.value, clock.to.value, wire.value);
  }

  private scaleOf(width: number): drawing.Scale {
    const { clock } = this.app, left = width < 560 ? 92 : 150;
    this.scale = { from: clock.from.value, to: clock.to.value, left, width: Math.max(10, width - left - 8) };
    return this.scale;
  }

  private drawAxis(sheet: Sheet): void {
    const { g, width, height } = sheet, scale = this.scaleOf(width), step = roundStep(scale.to - scale.from, Math.max(2, scale.width / 80)), base = tickBase(scale.from, step);
    g.font = SMALL_FONT;
    g.fillStyle = theme.value.faint;
    g.strokeStyle = theme.value.line;
    g.textAlign = "center";
    for (const t of ticks(scale.from, scale.to, step)) {
      const x = drawing.px(scale, t);
      g.beginPath();
      g.moveTo(x, height - 6);
      g.lineTo(x, height);
      g.stroke();
      if (x < width - 24) g.fillText(tickLabel(t, step, base), x, height - 9);
    }
    if (base || step < 1e6) {
      g.textAlign = "left";
      g.fillStyle = theme.value.ink;
      g.fillText(fitted(g, moment(base, 1), scale.left - 8), 4, height - 9);
    }
  }

  private drawRows(sheet: Sheet): void {
    const { g, width } = sheet, scale = this.scaleOf(width), { store } = this.app, chosen = this.wire()?.id;
    const low = this.scroller.scrollTop - 40, high = low + this.scroller.clientHeight + 80;
    this.drawGrid(sheet, scale);
    let place = 0;
    for (const row of this.rows()) {
      if (row.kind === "group") place++;
      if (row.top + row.height < low || row.top > high) continue;
      this.drawName(g, row, scale, row.channel?.id === chosen, width);
      if (!row.channel) continue;
      const frame = store.rows(row.channel.id, scale.from, scale.to, scale.width);
      if (!frame) continue;
      g.save();
      g.beginPath();
      g.rect(scale.left, row.top, scale.width, row.height);
      g.clip();
      if (row.kind === "wire") {
        drawing.wire(sheet, row, frame, scale, row.top, place);
        const waves = row.waves && store.rows(row.waves.id, scale.from, scale.to, scale.width);
        if (waves) drawing.waves(sheet, row, waves, scale, row.top, place);
      } else if (row.kind === "analog") drawing.analog(sheet, row, frame, scale, row.top, place);
      else drawing.decoded(sheet, row, frame, scale, row.top);
      g.restore();
    }
    if (this.pointer) this.drawPointer(sheet, scale);
  }

  private drawGrid({ g, height }: Sheet, scale: drawing.Scale): void {
    g.strokeStyle = theme.value.line;
    g.lineWidth = 1;
    g.globalAlpha = 0.6;
    g.beginPath();
    for (const t of ticks(scale.from, scale.to, roundStep(scale.to - scale.from, Math.max(2, scale.width / 80)))) {
      const x = Math.round(drawing.px(scale, t)) + 0.5;
      g.moveTo(x, 0);
      g.lineTo(x, height);
    }
    g.stroke();
    g.globalAlpha = 1;
  }

  private drawName(g: CanvasRenderingContext2D, row: Row, scale: drawing.Scale, isChosen: boolean, width: number): void {
    if (row.kind === "group") {
      g.fillStyle = theme.value.line;
      g.globalAlpha = 0.5;
      g.fillRect(0, row.top + 2, width, row.height - 4);
      g.globalAlpha = 1;
      g.font = `600 ${SMALL_FONT}`;
      g.fillStyle = theme.value.ink;
      g.textAlign = "left";
      g.fillText(row.title, 6, row.top + 14);
      return;
    }
    if (isChosen) {
      g.fillStyle = theme.value.sonar;
      g.fillRect(0, row.top, width, row.height);
    }
    g.font = isChosen ? `600 ${FONT}` : FONT;
    g.fillStyle = theme.value.ink;
    g.textAlign = "right";
    g.fillText(fitted(g, row.title, scale.left - 14), scale.left - 8, row.top + row.height / 2 + 4);
    g.font = FONT;
  }

  private drawPointer({ g, height }: Sheet, scale: drawing.Scale): void {
    const { x, y } = this.pointer!;
    if (x < scale.left) return;
    g.strokeStyle = theme.value.faint;
    g.setLineDash([3, 3]);
    g.beginPath();
    g.moveTo(x, 0);
    g.lineTo(x, height);
    g.stroke();
    g.setLineDash([]);
    const row = this.rows().find((one) => y >= one.top && y < one.top + one.height), t = drawing.timeAt(scale, x);
    let text = moment(t, (scale.to - scale.from) / scale.width);
    if (row?.kind === "wire") {
      const frame = this.app.store.rows(row.channel!.id, scale.from, scale.to), pulse = frame && pulseAt(frame, t, this.app.clock.end.peek());
      if (pulse) {
        text += `   ${drawing.reading(row, pulse)}`;
        const from = Math.max(scale.left, drawing.px(scale, pulse.from)), to = Math.min(scale.left + scale.width, drawing.px(scale, pulse.to));
        g.strokeStyle = theme.value.ink;
        g.beginPath();
        g.moveTo(from, row.top + row.height / 2);
        g.lineTo(to, row.top + row.height / 2);
        g.stroke();
      }
    }
    this.reading.value = text;
  }

  private listen(canvas: HTMLCanvasElement, redraw: () => void): void {
    const { clock } = this.app;
    let drag: { x: number; from: number; to: number; moved: boolean } | undefined;
    canvas.addEventListener("wheel", (event) => {
      if (event.shiftKey || event.offsetX < this.scale.left) return; // scrolls the rows
      event.preventDefault();
      if (Math.abs(event.deltaX) > Math.abs(event.deltaY)) clock.pan(event.deltaX / this.scale.width);
      else clock.zoom(event.deltaY > 0 ? 1.25 : 0.8, drawing.timeAt(this.scale, event.offsetX));
    }, { passive: false });
    canvas.addEventListener("pointerdown", (event) => {
      drag = { x: event.clientX, from: clock.from.peek(), to: clock.to.peek(), moved: false };
      canvas.setPointerCapture(event.pointerId);
    });
    canvas.addEventListener("pointermove", (event) => {
      this.pointer = { x: event.offsetX, y: event.offsetY };
      if (drag && Math.abs(event.clientX - drag.x) > 3) drag.moved = true;
      if (drag?.moved) {
        const by = ((drag.x - event.clientX) / this.scale.width) * (drag.to - drag.from);
        clock.look(drag.from + by, drag.to + by);
      }
      redraw();
    });
    canvas.addEventListener("pointerup", (event) => {
      if (drag && !drag.moved) this.click(event);
      drag = undefined;
    });
    canvas.addEventListener("pointerleave", () => {
      this.pointer = undefined;
      this.reading.value = "";
      redraw();
    });
    canvas.addEventListener("dblclick", () => clock.showAll());
    canvas.addEventListener("keydown", (event) => {
      if ((event.key !== "a" && event.key !== "b") || event.ctrlKey || event.metaKey || !this.pointer) return;
      event.stopPropagation();
      clock.setCursor(event.key, this.snapped(this.pointer.x, this.pointer.y));
    });
  }

  private click(event: PointerEvent): void {
    const { app } = this, row = this.rows().find((one) => event.offsetY >= one.top && event.offsetY < one.top + one.height);
    if (row?.channel && event.currentTarget !== this.scroller) app.wire.value = row.channel.id;
    if (event.offsetX < this.scale.left) return;
    const t = this.snapped(event.offsetX, event.offsetY);
    if (event.shiftKey) app.clock.setCursor("a", t);
    else if (event.altKey || event.ctrlKey) app.clock.setCursor("b", t);
    else app.clock.seek(t);
    if (row?.channel && DECODED.has(row.channel.kind)) app.selection.value = { channel: row.channel.id, t, place: 0 };
  }

  /** The time under a pixel; that of an edge of its wire where one is near. */
  private snapped(x: number, y: number): number {
    const t = drawing.timeAt(this.scale, x), row = this.rows().find((one) => y >= one.top && y < one.top + one.height);
    const frame = row?.channel && row.kind !== "analog" ? this.app.store.rows(row.channel.id, this.scale.from, this.scale.to) : undefined;
    if (!frame) return t;
    let best = t, near = SNAP_PX;
    const at = lastAt(frame.t, t);
    for (const edge of [frame.t[at], frame.t[at + 1]]) {
      if (edge === undefined) continue;
      const away = Math.abs(drawing.px(this.scale, edge) - x);
      if (away < near) [near, best] = [away, edge];
    }
    return best;
  }
}

function part(name: string): HTMLElement {
  const element = document.createElement("div");
  element.className = name;
  return element;
}

function wireOptions(store: Store) {
  return rowsOf(store).filter((row) => row.channel);
}

/** A wire out of its group is told from its like, the s1 of another motor, by what the bench calls it. */
function fullName({ kind, title, channel }: Row): string {
  return kind === "wire" && channel?.doc && !title.includes(channel.doc) ? `${title} (${channel.doc})` : title;
}

function Bar({ view }: { view: LogicView }) {
  const { app } = view, needsInput = view.what.value === "value" || view.what.value === "shorter" || view.what.value === "text";
  const hint = { value: "1 or 0x1F", shorter: "2 us", text: "text" }[view.what.value as "value" | "shorter" | "text"];
  return (
    <>
      <IconButton icon="closer" label="Closer in time" onClick={() => app.clock.zoom(0.5)} />
      <IconButton icon="further" label="Further away in time" onClick={() => app.clock.zoom(2)} />
      <IconButton icon="whole" label="Show the whole run" onClick={() => app.clock.showAll()} />
      <select aria-label="Wire to look along" value={view.wire()?.id ?? ""} onChange={(event) => { app.wire.value = Number(event.currentTarget.value); }}>
        {wireOptions(app.store).map((row) => <option value={row.channel!.id}>{[row.channel!.source, fullName(row)].filter(Boolean).join(" ")}</option>)}
      </select>
      <select aria-label="What to look for" value={view.what.value} onChange={(event) => { view.what.value = event.currentTarget.value as What; }}>
        {WHATS.map(([what, words]) => <option value={what}>{words}</option>)}
      </select>
      {needsInput && <input class="short-input" aria-label="Value, length or text to look for" placeholder={hint} value={view.input.value}
        onInput={(event) => { view.input.value = event.currentTarget.value; }} onKeyDown={(event) => { if (event.key === "Enter") void view.go(event.shiftKey ? -1 : 1); }} />}
      <button type="button" class="icon-button" aria-label="Look back" title="Look back" onClick={() => void view.go(-1)}><Icon name="back" /></button>
      <button type="button" class="icon-button" aria-label="Look forward" title="Look forward" onClick={() => void view.go(1)}><Icon name="forward" /></button>
      <span class="said" role="status">{view.said.value}</span>
    </>
  );
}

function Readout({ view }: { view: LogicView }) {
  const { clock, store } = view.app, a = clock.a.value, b = clock.b.value, parts: string[] = [];
  reads(store.version.value);
  if (a !== null) parts.push(`A ${moment(a, 1)}`);
  if (b !== null) parts.push(`B ${moment(b, 1)}`);
  if (a !== null && b !== null) parts.push(`B − A ${duration(b - a)}`, frequency(b - a));
  const from = clock.from.value, to = clock.to.value;
  const reduced = view.rows().map((row) => row.channel && store.rows(row.channel.id, from, to)).filter((frame) => frame?.isReduced && frame.from <= from && frame.to >= to);
  const count = reduced.reduce((sum, frame) => sum + frame!.count, 0), of = reduced.reduce((sum, frame) => sum + frame!.of, 0);
  return (
    <>
      <span class="cursor-readout">{parts.filter(Boolean).join("   ")}</span>
      <span>{view.readingText.value || (a === null && b === null ? "Shift-click sets cursor A, Ctrl-click B" : "")}</span>
      {reduced.length > 0 && <span class="left-out">{`${reduced.length} rows reduced: ${count} of ${of} changes${store.canAsk ? ", all when closer" : ""}`}</span>}
    </>
  );
}
