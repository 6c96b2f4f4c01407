// Hands in the plan: a drag puts the robot or a thing elsewhere, or draws a new box or wall; the wheel turns what is dragged.
import { type Signal, signal } from "@preact/signals";
import { freeName, moved, placedBox, type Put, ROBOT } from "../../hands/words";
import type { App } from "../../shell/app";
import type { Sheet } from "../../shell/surface";
import { theme } from "../../shell/theme";
import type { Camera } from "./camera";
import { corners, covers, thingsAt } from "./things";
import { type RobotTrack, tracksAt } from "./tracks";

/** What a drag does. */
export type HandMode = "look" | "move" | "box" | "wall";
const MODES: readonly (readonly [HandMode, string])[] = [["look", "look around"], ["move", "move robot and things"], ["box", "draw a box"], ["wall", "draw a wall"]];
/** A wall is so thick, and nothing that is drawn is smaller, metres. */
const WALL_M = 0.1;
const LEAST_M = 0.05;
/** The wheel turns by so much, radians. */
const TURN = Math.PI / 12;

interface Dragged {
  readonly name: string;
  /** Of several robots the one that is dragged. */
  readonly robot?: string | undefined;
  /** Its outline around its middle; undefined: it is round. */
  readonly points: readonly (readonly [number, number])[];
  readonly radius: number;
  /** From where it was taken hold of to its middle. */
  readonly dx: number;
  readonly dy: number;
  put: Put;
}

export class PlanHands {
  readonly mode: Signal<HandMode> = signal("look");
  private dragged: Dragged | undefined;
  private drawn: { x0: number; y0: number; x1: number; y1: number } | undefined;

  constructor(private readonly app: App, private readonly camera: Camera) {}

  /** Whether hands can do anything here. */
  get isOffered(): boolean {
    const { header, mayControl, run } = this.app.store, offer = header.value.hands;
    return offer !== null && !offer.is_real && mayControl.value && run.value !== null;
  }

  /** Takes a press; says whether a hand has begun something. */
  press(px: number, py: number): boolean {
    const mode = this.isOffered ? this.mode.peek() : "look", x = this.camera.wx(px), y = this.camera.wy(py), { store, clock } = this.app;
    if (mode === "look") return false;
    if (mode !== "move") {
      this.drawn = { x0: x, y0: y, x1: x, y1: y };
      return true;
    }
    const now = clock.now.peek(), thing = thingsAt(store, now).findLast((one) => one.kind !== "robot" && covers(one, x, y));
    const all = tracksAt(store, now), offers = store.header.peek().robot_hands;
    const robot = offers.length ? all.find((one) => isUnder(one, x, y) && offers.some((offer) => offer.robot === one.robot.name)) : all[0];
    if (robot && isUnder(robot, x, y)) this.dragged = { name: ROBOT, robot: offers.length ? robot.robot.name : undefined, points: hull(robot), radius: 0, dx: robot.at.x - x, dy: robot.at.y - y, put: { x: robot.at.x, y: robot.at.y, heading: robot.at.heading } };
    else if (thing) this.dragged = { name: thing.name, points: corners(thing), radius: thing.radius_m, dx: thing.x_m - x, dy: thing.y_m - y, put: { x: thing.x_m, y: thing.y_m, heading: thing.heading_rad } };
    return this.dragged !== undefined;
  }

  move(px: number, py: number): boolean {
    const x = this.camera.wx(px), y = this.camera.wy(py), { dragged, drawn } = this;
    if (dragged) dragged.put = { ...dragged.put, x: x + dragged.dx, y: y + dragged.dy };
    if (drawn) [drawn.x1, drawn.y1] = [x, y];
    return dragged !== undefined || drawn !== undefined;
  }

  /** Takes the wheel; says whether it has turned something. */
  wheel(way: number): boolean {
    if (!this.dragged) return false;
    this.dragged.put = { ...this.dragged.put, heading: this.dragged.put.heading + way * TURN };
    return true;
  }

  /** Takes that the drag ends: it is done. */
  release(): void {
    const { dragged } = this, drawn = this.drawn && this.shape();
    this.dragged = this.drawn = undefined;
    if (dragged) this.app.byHand({ do: "hand", words: moved(dragged.name, dragged.put) }, dragged.robot);
    if (!drawn || drawn.length < LEAST_M) return;
    const mode = this.mode.peek(), { store, clock } = this.app, world = store.header.peek().world?.things ?? [];
    const name = freeName(mode, [...world, ...thingsAt(store, clock.now.peek())].map((thing) => thing.name));
    this.app.byHand({ do: "hand", words: placedBox(name, drawn.length, drawn.width, drawn.put) });
  }

  cancel(): void {
    this.dragged = this.drawn = undefined;
  }

  draw({ g }: Sheet): void {
    const camera = this.camera, { dragged } = this, shape = this.drawn && this.shape();
    if (!dragged && !shape) return;
    const put = dragged?.put ?? shape!.put, l = (shape?.length ?? 0) / 2, w = (shape?.width ?? 0) / 2;
    const points = dragged?.points ?? [[-l, -w], [l, -w], [l, w], [-l, w]];
    g.save();
    g.translate(camera.px(put.x), camera.py(put.y));
    g.rotate(-put.heading);
    g.beginPath();
    if (points.length) points.forEach(([x, y], n) => (n ? g.lineTo(x * camera.scale, -y * camera.scale) : g.moveTo(x * camera.scale, -y * camera.scale)));
    else g.arc(0, 0, (dragged?.radius ?? 0) * camera.scale, 0, 2 * Math.PI);
    g.closePath();
    g.globalAlpha = 0.35;
    g.fillStyle = theme.value.right;
    g.fill();
    g.globalAlpha = 1;
    g.setLineDash([5, 4]);
    g.lineWidth = 2;
    g.strokeStyle = theme.value.right;
    g.stroke();
    g.restore();
  }

  /** What is drawn: a box between two corners, or a wall from one point to another. */
  private shape(): { length: number; width: number; put: Put } {
    const { x0, y0, x1, y1 } = this.drawn!, middle = { x: (x0 + x1) / 2, y: (y0 + y1) / 2 };
    if (this.mode.peek() === "wall") return { length: Math.hypot(x1 - x0, y1 - y0), width: WALL_M, put: { ...middle, heading: Math.atan2(y1 - y0, x1 - x0) } };
    return { length: Math.abs(x1 - x0), width: Math.max(LEAST_M, Math.abs(y1 - y0)), put: { ...middle, heading: 0 } };
  }
}

export function HandModes({ hands }: { hands: PlanHands }) {
  if (!hands.isOffered) return null;
  return (
    <label class="inline-label">drag to <select aria-label="What dragging in the plan does" value={hands.mode.value} onChange={(event) => { hands.mode.value = event.currentTarget.value as HandMode; }}>
      {MODES.map(([mode, says]) => <option value={mode}>{says}</option>)}
    </select></label>
  );
}

function hull({ robot }: RobotTrack): readonly (readonly [number, number])[] {
  const w = robot.width_m / 2;
  return [[-robot.rear_m, -w], [robot.front_m, -w], [robot.front_m, w], [-robot.rear_m, w]];
}

function isUnder({ robot, at }: RobotTrack, x: number, y: number): boolean {
  const c = Math.cos(at.heading), s = Math.sin(at.heading), ahead = c * (x - at.x) + s * (y - at.y), left = -s * (x - at.x) + c * (y - at.y);
  return ahead >= -robot.rear_m && ahead <= robot.front_m && Math.abs(left) <= robot.width_m / 2;
}

