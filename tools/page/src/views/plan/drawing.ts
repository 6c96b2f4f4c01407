// Draws the plan: floor with its grid, things, paths, range sensors, robots, contacts and names.
import { type Frame, numbers, texts } from "../../data/frames";
import { lastAt } from "../../data/search";
import type { ChannelHeader, WorldThing } from "../../generated/view";
import { fitted, FONT, halo, type Sheet, SMALL_FONT } from "../../shell/surface";
import { curveColour, scaleColour, theme } from "../../shell/theme";
import { decimals, roundStep, ticks } from "../../time/format";
import type { Camera } from "./camera";
import { type ColouredPath, type Place, placeAt } from "./poses";
import { corners, isFloor, isWall } from "./things";
import type { RobotTrack } from "./tracks";

/** A robot as the plan draws it. */
export interface Track extends RobotTrack {
  readonly path: ColouredPath;
}

export function grid({ g, width, height }: Sheet, camera: Camera): void {
  const step = roundStep(width / camera.scale, Math.max(2, width / 90)), digits = decimals(step);
  g.save();
  g.strokeStyle = theme.value.line;
  g.fillStyle = theme.value.faint;
  g.lineWidth = 1;
  g.font = SMALL_FONT;
  g.beginPath();
  const xs = ticks(camera.wx(0), camera.wx(width), step), ys = ticks(camera.wy(height), camera.wy(0), step);
  for (const x of xs) { g.moveTo(Math.round(camera.px(x)) + 0.5, 0); g.lineTo(Math.round(camera.px(x)) + 0.5, height); }
  for (const y of ys) { g.moveTo(0, Math.round(camera.py(y)) + 0.5); g.lineTo(width, Math.round(camera.py(y)) + 0.5); }
  g.stroke();
  g.textAlign = "center";
  for (const x of xs) if (camera.px(x) > 40 && camera.px(x) < width - 60) halo(g, x.toFixed(digits), camera.px(x), height - 6);
  g.textAlign = "left";
  for (const y of ys) if (camera.py(y) > 20 && camera.py(y) < height - 24) halo(g, y.toFixed(digits), 5, camera.py(y) + 4);
  g.textAlign = "right";
  halo(g, "x, m →", width - 6, height - 6);
  g.textAlign = "left";
  halo(g, "↑ y, m", 5, 14);
  g.restore();
}

export function things({ g }: Sheet, camera: Camera, present: readonly WorldThing[], hovered: string): void {
  for (const onFloor of [true, false]) for (const thing of present) {
    if (isFloor(thing) !== onFloor) continue;
    g.save();
    g.translate(camera.px(thing.x_m), camera.py(thing.y_m));
    g.rotate(-thing.heading_rad);
    outline(g, thing, camera.scale);
    g.fillStyle = onFloor ? theme.value.floor : isWall(thing) ? theme.value.wall : theme.value.box;
    g.fill();
    if (thing.name === hovered) {
      g.strokeStyle = theme.value.ink;
      g.lineWidth = 2;
      g.stroke();
    }
    g.restore();
  }
}

/** Names within the things that are large enough for them. */
export function names({ g }: Sheet, camera: Camera, present: readonly WorldThing[]): void {
  g.save();
  g.font = SMALL_FONT;
  g.textAlign = "center";
  for (const thing of present) {
    if (isWall(thing)) continue;
    const room = 2 * camera.scale * (thing.shape === "cylinder" ? thing.radius_m : Math.max(...corners(thing).map(([x, y]) => Math.hypot(x, y)), 0));
    const text = fitted(g, thing.name, Math.max(room, 0));
    if (room < 24 || text !== thing.name) continue;
    g.fillStyle = theme.value.ink;
    halo(g, text, camera.px(thing.x_m), camera.py(thing.y_m) + 4);
  }
  g.restore();
}

function outline(g: CanvasRenderingContext2D, thing: WorldThing, scale: number): void {
  g.beginPath();
  if (thing.shape === "cylinder") g.arc(0, 0, thing.radius_m * scale, 0, 7);
  else for (const [x, y] of corners(thing)) g.lineTo(x * scale, -y * scale);
  g.closePath();
}

/** The path: what is to come faint, what was in the colours of the scale or of its robot. */
export function path({ g }: Sheet, camera: Camera, track: Track, now: number): void {
  const { frame, path: { strokes } } = track, xs = numbers(frame, "x_m"), ys = numbers(frame, "y_m");
  g.save();
  g.lineJoin = g.lineCap = "round";
  g.lineWidth = 2.2;
  for (const { first, last, share } of strokes) {
    const isPast = frame.t[last]! <= now;
    g.strokeStyle = track.colour ?? scaleColour(share);
    if (!isPast) {
      g.globalAlpha = 0.25;
      g.lineCap = "butt"; // strokes that meet must not cover one another
      stroke(g, camera, xs, ys, first, last);
      g.globalAlpha = 1;
      g.lineCap = "round";
      if (frame.t[first]! > now) continue;
      const row = Math.max(first, lastAt(frame.t, now));
      g.beginPath();
      for (let n = first; n <= row; n++) g.lineTo(camera.px(xs[n]!), camera.py(ys[n]!));
      g.lineTo(camera.px(track.at.x), camera.py(track.at.y));
      g.stroke();
    } else stroke(g, camera, xs, ys, first, last);
  }
  g.restore();
}

function stroke(g: CanvasRenderingContext2D, camera: Camera, xs: ArrayLike<number>, ys: ArrayLike<number>, first: number, last: number): void {
  g.beginPath();
  for (let n = first; n <= last; n++) g.lineTo(camera.px(xs[n]!), camera.py(ys[n]!));
  g.stroke();
}

/** Arrows along the path at round times, and where it began. */
export function times({ g, width, height }: Sheet, camera: Camera, track: Track, start: number, end: number): void {
  const { frame } = track, taken: [number, number][] = [];
  const step = roundStep((end - start) / 1e9, 12) * 1e9;
  g.save();
  g.font = SMALL_FONT;
  g.textAlign = "left";
  const first = placeAt(frame, frame.t[0]!);
  if (first) {
    arrow(g, camera.px(first.x), camera.py(first.y), first.heading, 9, theme.value.panel, theme.value.path);
    g.fillStyle = theme.value.path;
    halo(g, "start", camera.px(first.x) + 12, camera.py(first.y) - 8);
    taken.push([camera.px(first.x), camera.py(first.y)]);
  }
  for (const t of ticks(start + step, end, step)) {
    const place = placeAt(frame, t);
    if (!place || t < frame.t[0]! || t > frame.t[frame.count - 1]!) continue;
    const x = camera.px(place.x), y = camera.py(place.y);
    if (x < 0 || y < 0 || x > width || y > height || taken.some(([ax, ay]) => Math.abs(ax - x) < 46 && Math.abs(ay - y) < 18)) continue;
    taken.push([x, y]);
    arrow(g, x, y, place.heading, 5.5, theme.value.path, theme.value.panel);
    g.fillStyle = theme.value.ink;
    halo(g, `${(t / 1e9).toFixed(decimals(step / 1e9))} s`, x + 8, y - 6);
  }
  g.restore();
}

function arrow(g: CanvasRenderingContext2D, x: number, y: number, heading: number, size: number, fill: string, edge: string): void {
  g.save();
  g.translate(x, y);
  g.rotate(-heading);
  g.beginPath();
  for (const [u, v] of [[1, 0], [-0.7, 0.7], [-0.3, 0], [-0.7, -0.7]] as const) g.lineTo(u * size, -v * size);
  g.closePath();
  g.fillStyle = fill;
  g.strokeStyle = edge;
  g.lineWidth = 1.2;
  g.fill();
  g.stroke();
  g.restore();
}

/** The range sensors of a robot as cones as long as what they read; short ones in a colour of their own. */
export function ranges({ g }: Sheet, camera: Camera, at: Place, channel: ChannelHeader, frame: Frame, now: number, near: number): void {
  const row = lastAt(frame.t, now), values = numbers(frame, "range_m");
  if (row < 0) return;
  g.save();
  g.translate(camera.px(at.x), camera.py(at.y));
  g.rotate(-at.heading);
  channel.sensors.forEach((sensor, n) => {
    const range = values[row * frame.width + n]!, isSeen = Number.isFinite(range) && range > 0;
    const long = (isSeen ? Math.min(range, channel.range_m || range) : channel.range_m || 3) * camera.scale, half = Math.max(0.02, channel.cone_rad / 2);
    g.fillStyle = isSeen && range < near ? theme.value.near : theme.value.sonar;
    g.globalAlpha = isSeen ? 1 : 0.35;
    g.beginPath();
    g.moveTo(sensor.x_m * camera.scale, -sensor.y_m * camera.scale);
    g.arc(sensor.x_m * camera.scale, -sensor.y_m * camera.scale, long, -sensor.bearing_rad - half, -sensor.bearing_rad + half);
    g.closePath();
    g.fill();
    if (!isSeen) return;
    g.strokeStyle = range < near ? theme.value.bad : theme.value.left;
    g.lineWidth = 1.6;
    g.beginPath();
    g.arc(sensor.x_m * camera.scale, -sensor.y_m * camera.scale, long, -sensor.bearing_rad - half, -sensor.bearing_rad + half);
    g.stroke();
  });
  g.restore();
}

export function robot({ g }: Sheet, camera: Camera, track: Track, place: number, isNamed: boolean): void {
  const { robot: { front_m, rear_m, width_m, name }, at } = track, s = camera.scale;
  g.save();
  g.translate(camera.px(at.x), camera.py(at.y));
  g.rotate(-at.heading);
  g.fillStyle = theme.value.panel;
  g.strokeStyle = isNamed ? curveColour(place) : theme.value.ink;
  g.lineWidth = 1.8;
  g.globalAlpha = 0.55; // the path is seen through the hull
  g.beginPath();
  g.rect(-rear_m * s, (-width_m / 2) * s, (front_m + rear_m) * s, width_m * s);
  g.fill();
  g.globalAlpha = 1;
  g.stroke();
  g.fillStyle = g.strokeStyle;
  g.beginPath();
  g.moveTo(front_m * s, 0);
  g.lineTo(front_m * 0.35 * s, -width_m * 0.24 * s);
  g.lineTo(front_m * 0.35 * s, width_m * 0.24 * s);
  g.fill();
  g.restore();
  if (!isNamed) return;
  g.save();
  g.font = FONT;
  g.fillStyle = curveColour(place);
  halo(g, name, camera.px(at.x) + width_m * s * 0.7, camera.py(at.y) - width_m * s * 0.6);
  g.restore();
}

/** What happened at a place until now: a cross where it is an error, a ring elsewhere. */
export function contacts({ g }: Sheet, camera: Camera, events: Frame, now: number): { x: number; y: number; text: string }[] {
  const xs = numbers(events, "x_m"), ys = numbers(events, "y_m"), severities = numbers(events, "severity"), found: { x: number; y: number; text: string }[] = [];
  g.save();
  for (let row = 0, last = lastAt(events.t, now); row <= last; row++) {
    if (!Number.isFinite(xs[row]!)) continue;
    const x = camera.px(xs[row]!), y = camera.py(ys[row]!), isBad = severities[row]! >= 2;
    g.strokeStyle = isBad ? theme.value.bad : theme.value.faint;
    g.lineWidth = 2.4;
    g.beginPath();
    if (isBad) { g.moveTo(x - 5, y - 5); g.lineTo(x + 5, y + 5); g.moveTo(x + 5, y - 5); g.lineTo(x - 5, y + 5); } else g.arc(x, y, 4, 0, 7);
    g.stroke();
    found.push({ x, y, text: `${texts(events, "what").at(row)}: ${texts(events, "detail").at(row)}, ${(events.t[row]! / 1e9).toFixed(3)} s` });
  }
  g.restore();
  return found;
}

/** What the colours of the path mean. */
export function scaleBar({ g, width }: Sheet, path: ColouredPath): void {
  const long = Math.min(140, width / 3), x = width - long - 12, y = 12;
  g.save();
  g.fillStyle = theme.value.panel;
  g.globalAlpha = 0.8;
  g.fillRect(x - 8, 4, long + 16, 34);
  g.globalAlpha = 1;
  for (let n = 0; n < long; n++) { g.fillStyle = scaleColour(n / long); g.fillRect(x + n, y, 1.5, 6); }
  g.fillStyle = theme.value.ink;
  g.font = SMALL_FONT;
  g.textAlign = "left";
  g.fillText(path.least.toFixed(path.unit === "s" ? 0 : 2), x, y + 20);
  g.textAlign = "right";
  g.fillText(`${path.most.toFixed(path.unit === "s" ? 0 : 2)} ${path.unit}`, x + long, y + 20);
  g.restore();
}

/** A text beside the pointer. */
export function tip({ g, width }: Sheet, text: string, x: number, y: number): void {
  g.save();
  g.font = FONT;
  const shown = fitted(g, text, width - 24), wide = g.measureText(shown).width + 12, left = Math.min(x + 12, width - wide - 4), top = Math.max(4, y - 28);
  g.fillStyle = theme.value.ink;
  g.fillRect(left, top, wide, 20);
  g.fillStyle = theme.value.panel;
  g.textAlign = "left";
  g.fillText(shown, left + 6, top + 14);
  g.restore();
}
