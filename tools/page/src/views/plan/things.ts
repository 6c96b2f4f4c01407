// The things of the world at a time, and which of them lies under a point.
import type { Store } from "../../data/store";
import { numbers } from "../../data/frames";
import { lastAt } from "../../data/search";
import type { WorldThing } from "../../generated/view";

/** Things as they stand at a time: those that are there then. */
export function thingsAt(store: Store, t: number): WorldThing[] {
  const world = store.header.value.world;
  if (!world) return [];
  const changes = store.channels("things").map((channel) => store.whole(channel.id)).filter((frame) => frame !== undefined);
  if (!changes.length) return world.things.filter((thing) => thing.is_there);
  const now = [...world.things];
  for (const frame of changes) {
    const last = lastAt(frame.t, t), seen = new Set<number>(), which = numbers(frame, "thing");
    for (let row = last; row >= 0; row--) {
      const place = which[row]!;
      if (seen.has(place) || !now[place]) continue;
      seen.add(place);
      const value = (name: string) => numbers(frame, name)[row]!;
      now[place] = { ...now[place], is_there: value("is_there") !== 0, x_m: value("x_m"), y_m: value("y_m"), heading_rad: value("heading_rad") };
    }
  }
  return now.filter((thing) => thing.is_there);
}

export const isFloor = (thing: WorldThing) => thing.kind === "floor" || thing.kind === "ramp";
export const isWall = (thing: WorldThing) => thing.kind === "wall" || thing.kind === "rail";

/** The corners of a thing around its middle, counter-clockwise; empty for a cylinder. */
export function corners(thing: WorldThing): readonly (readonly [number, number])[] {
  if (thing.shape === "polygon") return thing.points;
  if (thing.shape === "cylinder") return [];
  const l = thing.length_m / 2, w = thing.width_m / 2;
  return [[-l, -w], [l, -w], [l, w], [-l, w]];
}

/** Whether a point of the world lies on a thing. */
export function covers(thing: WorldThing, x: number, y: number): boolean {
  const c = Math.cos(thing.heading_rad), s = Math.sin(thing.heading_rad), dx = x - thing.x_m, dy = y - thing.y_m;
  const u = c * dx + s * dy, v = -s * dx + c * dy;
  if (thing.shape === "cylinder") return Math.hypot(u, v) <= thing.radius_m;
  const points = corners(thing);
  let isIn = false;
  for (let n = 0, m = points.length - 1; n < points.length; m = n++) {
    const [ax, ay] = points[n]!, [bx, by] = points[m]!;
    if (ay > v !== by > v && u < ((bx - ax) * (v - ay)) / (by - ay) + ax) isIn = !isIn;
  }
  return isIn;
}
