// The robots of a run as plan and 3D draw them: where each is, its path, its range sensors, and what happened at places.
import { type Frame, numbers } from "../../data/frames";
import { lastAt } from "../../data/search";
import type { Store } from "../../data/store";
import type { ChannelHeader, RobotHeader } from "../../generated/view";
import { curveColour } from "../../shell/theme";
import type { Bounds } from "./camera";
import { type Place, placeAt } from "./poses";

const UNKNOWN_ROBOT: Omit<RobotHeader, "name"> = { model: "", front_m: 0.18, rear_m: 0.26, width_m: 0.38, height_m: 0.22 };
/** How far around now rows are asked for exactly, ns. */
const AROUND_NS = 1e9;
/** chosen: where no channel has a mark for it, nearer than this is near. */
const NEAR_M = 0.6;

export interface RobotTrack {
  readonly robot: RobotHeader;
  /** Over the whole run. */
  readonly frame: Frame;
  readonly at: Place;
  /** Its own, where there are several. */
  readonly colour: string | undefined;
  readonly ranges: readonly { readonly channel: ChannelHeader; readonly frame: Frame }[];
}

export function tracksAt(store: Store, now: number): RobotTrack[] {
  const channels = store.channels("pose");
  return channels.flatMap((channel, n) => {
    const frame = store.whole(channel.id), at = frame && placeAt(around(store, channel.id, now) ?? frame, now);
    if (!frame || !at) return [];
    const robot = store.header.value.robots.find((one) => one.name === channel.source) ?? { ...UNKNOWN_ROBOT, name: channel.source };
    const ranges = store.channels("ranges").filter((one) => one.source === channel.source).flatMap((one) => {
      const found = around(store, one.id, now);
      return found ? [{ channel: one, frame: found }] : [];
    });
    return [{ robot, frame, at, ranges, colour: channels.length > 1 ? curveColour(n) : undefined }];
  });
}

/** Rows around a time, exact where the whole run is not. */
function around(store: Store, id: number, now: number): Frame | undefined {
  const whole = store.whole(id);
  return !whole?.isReduced ? whole : store.rows(id, now - AROUND_NS, now + AROUND_NS, 4000);
}

/** Below how many metres a range is near. */
export function nearest(store: Store): number {
  return store.channels("samples").find((channel) => channel.mark !== null && channel.unit === "m")?.mark ?? NEAR_M;
}

/** The world's extent, widened to where the robots went: a real one's world is not known. */
export function boundsOf(store: Store): Bounds {
  let [x0, y0, x1, y1] = store.header.value.world?.extent_m ?? [Infinity, Infinity, -Infinity, -Infinity];
  for (const channel of store.channels("pose")) {
    const frame = store.whole(channel.id);
    if (!frame) continue;
    const box = boxOf(frame);
    [x0, y0, x1, y1] = [Math.min(x0, box.x0 - 0.3), Math.min(y0, box.y0 - 0.3), Math.max(x1, box.x1 + 0.3), Math.max(y1, box.y1 + 0.3)];
  }
  return x1 > x0 && y1 > y0 ? { x0, y0, x1, y1 } : { x0: -3, y0: -3, x1: 3, y1: 3 };
}

const boxes = new WeakMap<Frame, Bounds>();
function boxOf(frame: Frame): Bounds {
  let box = boxes.get(frame);
  if (!box) {
    const xs = numbers(frame, "x_m"), ys = numbers(frame, "y_m");
    box = { x0: Infinity, y0: Infinity, x1: -Infinity, y1: -Infinity };
    for (let n = 0; n < frame.count; n++) box = { x0: Math.min(box.x0, xs[n]!), y0: Math.min(box.y0, ys[n]!), x1: Math.max(box.x1, xs[n]!), y1: Math.max(box.y1, ys[n]!) };
    boxes.set(frame, box);
  }
  return box;
}

/** Where something bad happened until now. */
export function contactsAt(store: Store, now: number): { x: number; y: number }[] {
  return store.channels("events").flatMap((channel) => {
    const frame = store.whole(channel.id);
    if (!frame) return [];
    const xs = numbers(frame, "x_m"), ys = numbers(frame, "y_m"), severities = numbers(frame, "severity");
    return Array.from({ length: lastAt(frame.t, now) + 1 }, (_, row) => row).filter((row) => severities[row]! >= 2 && Number.isFinite(xs[row]!)).map((row) => ({ x: xs[row]!, y: ys[row]! }));
  });
}
