// The plan: the world from above, robots in it, their paths and what their sensors see.
import { effect, signal } from "@preact/signals";
import { render } from "preact";
import { type Frame, numbers } from "../../data/frames";
import { lastAt } from "../../data/search";
import type { Store } from "../../data/store";
import type { ChannelHeader } from "../../generated/view";
import type { App, ViewKind } from "../../shell/app";
import { IconButton } from "../../shell/icons";
import { type Sheet, surface } from "../../shell/surface";
import { moment } from "../../time/format";
import { Camera } from "./camera";
import * as drawing from "./drawing";
import { HandModes, PlanHands } from "./hands";
import { colouredPath, type ColouredPath, placeAt } from "./poses";
import { covers, thingsAt } from "./things";
import { boundsOf, nearest, tracksAt } from "./tracks";
import { reads } from "../../time/reads";

const EDGE_PX = 26;

export const plan: ViewKind = {
  id: "plan", title: "Plan", doc: "The world from above with the robot, its path, what its sensors see and what it touched.",
  has: (store) => store.channels("pose").length > 0 || store.header.value.world !== null,
  mount: (app, host) => new PlanView(app, host).dispose,
};

class PlanView {
  readonly dispose: () => void;
  private readonly camera = new Camera();
  readonly hands: PlanHands;
  private readonly follow = signal(false);
  private readonly by = signal<"time" | "speed">("time");
  private readonly paths = new Map<number, { frame: Frame; by: string; path: ColouredPath }>();
  private pointer: { x: number; y: number } | undefined;
  private readonly canvas: HTMLCanvasElement;
  private readonly redraw: () => void;

  constructor(private readonly app: App, host: HTMLElement) {
    const bar = document.createElement("div"), caption = document.createElement("div");
    this.hands = new PlanHands(app, this.camera);
    bar.className = "view-bar";
    caption.className = "view-caption";
    host.append(bar);
    const { canvas, redraw, dispose } = surface(host, "Plan of the world with the robot and its path", () => this.watch(), (sheet) => this.draw(sheet));
    host.append(caption);
    this.canvas = canvas;
    this.redraw = redraw;
    render(<Bar view={this} />, bar);
    const stop = effect(() => { caption.textContent = this.caption(); });
    this.listen();
    this.dispose = () => {
      stop();
      dispose();
      render(null, bar);
    };
  }

  get isFollowing() { return this.follow; }
  get colouring() { return this.by; }

  whole(): void {
    this.follow.value = false;
    this.camera.isWhole = true;
    this.redraw();
  }

  zoom(factor: number): void {
    this.camera.zoom(factor);
    this.redraw();
  }

  private watch(): void {
    const { store, clock } = this.app;
    reads(store.version.value, store.header.value, clock.now.value, clock.end.value, this.follow.value, this.by.value);
  }

  private draw(sheet: Sheet): void {
    const { store, clock } = this.app, now = clock.now.value, camera = this.camera, tracks = this.tracks(now);
    camera.fit(boundsOf(store), sheet.width, sheet.height, EDGE_PX);
    if (this.follow.value && tracks[0]) {
      if (camera.isWhole) camera.zoom(Math.max(1, 110 / camera.scale));
      camera.lookAt(tracks[0].at.x, tracks[0].at.y);
    }
    const present = thingsAt(store, now), hovered = this.pointer && present.findLast((thing) => covers(thing, camera.wx(this.pointer!.x), camera.wy(this.pointer!.y)));
    drawing.grid(sheet, camera);
    drawing.things(sheet, camera, present, hovered?.name ?? "");
    for (const track of tracks) drawing.path(sheet, camera, track, now);
    if (tracks.length === 1) drawing.times(sheet, camera, tracks[0]!, clock.start.value, clock.end.value);
    tracks.forEach((track, n) => {
      for (const { channel, frame } of track.ranges) drawing.ranges(sheet, camera, track.at, channel, frame, now, nearest(store));
      drawing.robot(sheet, camera, track, n, tracks.length > 1);
    });
    drawing.names(sheet, camera, present);
    this.hands.draw(sheet);
    const marks = store.channels("events").flatMap((channel) => {
      const frame = store.whole(channel.id);
      return frame ? drawing.contacts(sheet, camera, frame, now) : [];
    });
    if (tracks.length === 1 && tracks[0]!.frame.count > 1) drawing.scaleBar(sheet, tracks[0]!.path);
    if (!this.pointer) return;
    const mark = marks.find(({ x, y }) => Math.hypot(x - this.pointer!.x, y - this.pointer!.y) < 9);
    const text = mark?.text ?? (hovered ? hovered.name : `x ${camera.wx(this.pointer.x).toFixed(2)} m, y ${camera.wy(this.pointer.y).toFixed(2)} m`);
    drawing.tip(sheet, text, this.pointer.x, this.pointer.y);
  }

  private tracks(now: number): drawing.Track[] {
    return tracksAt(this.app.store, now).map((track, n) => ({ ...track, path: this.path(n, track.frame) }));
  }

  private path(id: number, frame: Frame): ColouredPath {
    const known = this.paths.get(id), by = this.by.value;
    if (known?.frame === frame && known.by === by) return known.path;
    const path = colouredPath(frame, by);
    this.paths.set(id, { frame, by, path });
    return path;
  }

  private caption(): string {
    const { store, clock } = this.app, now = clock.now.value;
    reads(store.version.value);
    return store.channels("pose").slice(0, 3).map((channel) => {
      const frame = store.whole(channel.id), at = frame && placeAt(frame, now);
      if (!at) return "";
      const wheels = store.channels("samples").filter((one) => one.group === "wheels" && one.source === channel.source && !one.name.includes("asked"));
      const speeds = wheels.map((one) => valueAt(store, one, now)).filter((value) => value !== undefined).map((value) => (value * 1000).toFixed(0));
      return `${channel.source ? `${channel.source}  ` : ""}${moment(now)}   x ${at.x.toFixed(3)} m   y ${at.y.toFixed(3)} m   heading ${((at.heading * 180) / Math.PI).toFixed(1)}°${speeds.length ? `   wheels ${speeds.join(" / ")} mm/s` : ""}`;
    }).filter(Boolean).join("\n");
  }

  private listen(): void {
    const { canvas } = this;
    let drag: { x: number; y: number } | undefined;
    canvas.addEventListener("wheel", (event) => {
      event.preventDefault();
      if (!this.hands.wheel(event.deltaY > 0 ? -1 : 1)) this.camera.zoom(event.deltaY > 0 ? 0.85 : 1 / 0.85, event.offsetX, event.offsetY);
      this.redraw();
    }, { passive: false });
    canvas.addEventListener("pointerdown", (event) => {
      if (!this.hands.press(event.offsetX, event.offsetY)) drag = { x: event.clientX, y: event.clientY };
      canvas.setPointerCapture(event.pointerId);
    });
    canvas.addEventListener("pointermove", (event) => {
      if (!this.hands.move(event.offsetX, event.offsetY) && drag) {
        this.follow.value = false;
        this.camera.move(event.clientX - drag.x, event.clientY - drag.y);
        drag = { x: event.clientX, y: event.clientY };
      }
      this.pointer = { x: event.offsetX, y: event.offsetY };
      this.redraw();
    });
    canvas.addEventListener("pointerup", () => {
      drag = undefined;
      this.hands.release();
      this.redraw();
    });
    canvas.addEventListener("pointercancel", () => {
      drag = undefined;
      this.hands.cancel();
    });
    canvas.addEventListener("pointerleave", () => {
      this.pointer = undefined;
      this.redraw();
    });
    canvas.addEventListener("dblclick", () => this.whole());
  }
}

function valueAt(store: Store, channel: ChannelHeader, now: number): number | undefined {
  const frame = store.whole(channel.id);
  if (!frame?.count) return undefined;
  return numbers(frame, "value")[Math.max(0, lastAt(frame.t, now))];
}

function Bar({ view }: { view: PlanView }) {
  return (
    <>
      <IconButton icon="whole" label="Show the whole world" onClick={() => view.whole()} />
      <IconButton icon="closer" label="Closer" onClick={() => view.zoom(1.3)} />
      <IconButton icon="further" label="Further away" onClick={() => view.zoom(1 / 1.3)} />
      <IconButton icon="follow" label="Follow the robot" pressed={view.isFollowing.value} onClick={() => { view.isFollowing.value = !view.isFollowing.value; }} />
      <label class="inline-label">path by <select aria-label="Colour the path by" value={view.colouring.value} onChange={(event) => { view.colouring.value = event.currentTarget.value as "time" | "speed"; }}>
        <option value="time">time</option><option value="speed">speed</option>
      </select></label>
      <HandModes hands={view.hands} />
    </>
  );
}
