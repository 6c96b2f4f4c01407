// Draws rows of the logic analyser in a window of time: as much as a pixel can show, and where more happens than that, a filled block.
import { type Frame, numbers, texts } from "../../data/frames";
import { firstFrom, lastAt } from "../../data/search";
import type { ChannelHeader } from "../../generated/view";
import { fitted, MONO_FONT, type Sheet, SMALL_FONT } from "../../shell/surface";
import { curveColour, theme } from "../../shell/theme";
import { duration, frequency, hex, quantity, roundStep, ticks, trimmed } from "../../time/format";
import type { Row } from "./rows";

/** A window of time on pixels. */
export interface Scale {
  readonly from: number;
  readonly to: number;
  readonly left: number;
  readonly width: number;
}

export const px = (scale: Scale, t: number) => scale.left + ((t - scale.from) / (scale.to - scale.from)) * scale.width;
export const timeAt = (scale: Scale, x: number) => scale.from + ((x - scale.left) / scale.width) * (scale.to - scale.from);

/** Pieces of a wire's line: a level from x to x, or more changes than can be seen. */
export interface Piece {
  readonly x0: number;
  readonly x1: number;
  /** The value that stands; undefined where it changes within. */
  readonly value: number | undefined;
}

/** A wire's line in a window: at most some pieces a pixel, however many rows there are. */
export function pieces(frame: Frame, scale: Scale): Piece[] {
  const found: Piece[] = [], { t } = frame, values = numbers(frame, "level"), edges = numbers(frame, "edges");
  const right = scale.left + scale.width, end = Math.min(right, px(scale, Math.max(frame.to, frame.count ? t[frame.count - 1]! : 0)));
  let row = lastAt(t, scale.from);
  if (row < 0) row = 0;
  while (row < frame.count) {
    const x = Math.max(scale.left, px(scale, t[row]!));
    if (x >= right) break;
    const next = row + 1 < frame.count ? px(scale, t[row + 1]!) : end;
    if (edges[row]! > 1) {
      add(found, x, Math.min(right, Math.max(next, x + 1)), undefined);
      row++;
    } else if (next - x >= 1 || row + 1 >= frame.count) {
      if (next > x) add(found, x, Math.min(right, next), values[row]);
      row++;
    } else {
      const after = firstFrom(t, timeAt(scale, x + 1));
      add(found, x, Math.min(right, x + 1), undefined);
      // The value behind the block is that of the last row in it.
      const last = Math.max(row, after - 1), behind = after < frame.count ? px(scale, t[after]!) : end;
      if (behind - (x + 1) >= 1 && edges[last]! <= 1) add(found, x + 1, Math.min(right, behind), values[last]);
      row = Math.max(after, row + 1);
    }
  }
  return found;
}

function add(found: Piece[], x0: number, x1: number, value: number | undefined): void {
  const last = found.at(-1);
  if (last && last.value === value && Math.abs(last.x1 - x0) < 0.01) found[found.length - 1] = { x0: last.x0, x1, value };
  else found.push({ x0, x1, value });
}

export function wire({ g }: Sheet, row: Row, frame: Frame, scale: Scale, top: number, place: number): void {
  const high = top + 4, low = top + row.height - 5, isBus = (row.channel?.width ?? 1) > 1, found = pieces(frame, scale);
  g.save();
  g.strokeStyle = g.fillStyle = place % 2 ? theme.value.right : theme.value.left;
  g.lineWidth = 1.4;
  const y = (value: number) => (value ? high : low);
  if (isBus) bus(g, found, high, low);
  else {
    g.beginPath();
    let last: Piece | undefined;
    for (const piece of found) {
      if (piece.value !== undefined) {
        if (last?.value === undefined) g.moveTo(piece.x0, y(piece.value));
        else g.lineTo(piece.x0, y(piece.value));
        g.lineTo(piece.x1, y(piece.value));
      }
      last = piece;
    }
    g.stroke();
  }
  g.globalAlpha = 0.5;
  for (const piece of found) if (piece.value === undefined) g.fillRect(piece.x0, high, Math.max(1, piece.x1 - piece.x0), low - high);
  g.restore();
}

function bus(g: CanvasRenderingContext2D, found: readonly Piece[], high: number, low: number): void {
  g.font = MONO_FONT;
  g.textAlign = "center";
  for (const { x0, x1, value } of found) {
    if (value === undefined) continue;
    box(g, x0, x1, high, low);
    g.stroke();
    const text = fitted(g, `0x${value.toString(16).toUpperCase()}`, x1 - x0 - 8);
    if (text.length > 2) g.fillText(text, (x0 + x1) / 2, (high + low) / 2 + 4);
  }
}

function box(g: CanvasRenderingContext2D, x0: number, x1: number, high: number, low: number): void {
  const slope = Math.min(4, (x1 - x0) / 2), middle = (high + low) / 2;
  g.beginPath();
  for (const [x, y] of [[x0, middle], [x0 + slope, high], [x1 - slope, high], [x1, middle], [x1 - slope, low], [x0 + slope, low]] as const) g.lineTo(x, y);
  g.closePath();
}

/** A wave over the time that it stands for the wire's level: its periods where they can be seen, else its frequency and duty. */
export function waves({ g }: Sheet, row: Row, frame: Frame, scale: Scale, top: number, place: number): void {
  const high = top + 4, low = top + row.height - 5, periods = numbers(frame, "period_ns"), highs = numbers(frame, "high_ns"), phases = numbers(frame, "phase_ns");
  g.save();
  g.strokeStyle = place % 2 ? theme.value.right : theme.value.left;
  g.lineWidth = 1.4;
  g.font = SMALL_FONT;
  for (let n = Math.max(0, lastAt(frame.t, scale.from)); n < frame.count && frame.t[n]! < scale.to; n++) {
    const period = periods[n]!;
    if (!(period > 0)) continue;
    const begin = Math.max(scale.from, frame.t[n]!), stop = Math.min(scale.to, n + 1 < frame.count ? frame.t[n + 1]! : frame.to);
    const x0 = px(scale, begin), x1 = px(scale, stop), wide = (period / (scale.to - scale.from)) * scale.width;
    if (x1 - x0 < 0.5) continue;
    g.fillStyle = theme.value.panel;
    g.fillRect(x0, top + 1, x1 - x0, row.height - 2);
    if (wide < 4) {
      g.fillStyle = g.strokeStyle;
      g.globalAlpha = 0.25;
      g.fillRect(x0, high, x1 - x0, low - high);
      g.globalAlpha = 0.9;
      const duty = low - (low - high) * Math.min(1, Math.max(0, highs[n]! / period));
      g.fillRect(x0, duty - 0.7, x1 - x0, 1.4);
      g.globalAlpha = 1;
      g.fillStyle = theme.value.ink;
      const text = fitted(g, `${frequency(period)}, ${trimmed((100 * highs[n]!) / period, 3)} %`, x1 - x0 - 6);
      if (text.length > 3) g.fillText(text, x0 + 3, top + row.height / 2 + 4);
      continue;
    }
    g.beginPath();
    let rise = frame.t[n]! - phases[n]!;
    rise += Math.floor((begin - rise) / period) * period;
    for (let first = true; rise < stop; rise += period, first = false) {
      const up = px(scale, Math.max(begin, rise)), down = px(scale, Math.min(stop, Math.max(begin, rise + highs[n]!))), end = px(scale, Math.min(stop, rise + period));
      if (first) g.moveTo(up, high); else { g.lineTo(up, low); g.lineTo(up, high); }
      g.lineTo(down, high);
      g.lineTo(down, low);
      g.lineTo(end, low);
    }
    g.stroke();
  }
  g.restore();
}

/** A pin as a scope shows it: least and greatest of each pixel, with its scale. */
export function analog({ g }: Sheet, row: Row, frame: Frame, scale: Scale, top: number, place: number): void {
  const values = numbers(frame, "value"), channel = row.channel!, high = top + 6, low = top + row.height - 6;
  const first = Math.max(0, lastAt(frame.t, scale.from)), last = Math.min(frame.count, firstFrom(frame.t, scale.to) + 1);
  let least = Infinity, most = -Infinity;
  for (let n = first; n < last; n++) { if (values[n]! < least) least = values[n]!; if (values[n]! > most) most = values[n]!; }
  if (!(most >= least)) return;
  if (most - least < 1e-9) { least -= 0.5; most += 0.5; }
  const y = (value: number) => low - ((value - least) / (most - least)) * (low - high), step = roundStep(most - least, 3);
  g.save();
  g.font = SMALL_FONT;
  g.strokeStyle = theme.value.line;
  g.fillStyle = theme.value.faint;
  for (const value of ticks(least, most, step)) {
    g.beginPath();
    g.moveTo(scale.left, y(value));
    g.lineTo(scale.left + scale.width, y(value));
    g.stroke();
    g.fillText(quantity(value, channel.unit), scale.left + 3, y(value) - 2);
  }
  g.strokeStyle = curveColour(place);
  g.lineWidth = 1.3;
  g.beginPath();
  for (let n = first; n < last; n++) {
    const x = px(scale, frame.t[n]!);
    if (channel.is_stepped && n > first) g.lineTo(x, y(values[n - 1]!));
    g.lineTo(x, y(values[n]!));
  }
  if (channel.is_stepped && last > first) g.lineTo(Math.min(scale.left + scale.width, px(scale, frame.to)), y(values[last - 1]!));
  g.stroke();
  g.restore();
}

/** Packets, lines and states as boxes with what they say; where they lie too close, marks. */
export function decoded({ g }: Sheet, row: Row, frame: Frame, scale: Scale, top: number): void {
  const channel = row.channel!, high = top + 3, low = top + row.height - 4, right = scale.left + scale.width;
  g.save();
  g.font = MONO_FONT;
  let n = Math.max(0, lastAt(frame.t, scale.from));
  while (n < frame.count && frame.t[n]! < scale.to) {
    const x0 = Math.max(scale.left, px(scale, frame.t[n]!)), next = n + 1 < frame.count ? px(scale, frame.t[n + 1]!) : right;
    if (next - x0 < 3 && n + 1 < frame.count) {
      const after = Math.max(n + 1, firstFrom(frame.t, timeAt(scale, x0 + 3)));
      g.fillStyle = theme.value.decoded;
      g.globalAlpha = 0.55;
      g.fillRect(x0, high, 2.5, low - high);
      g.globalAlpha = 1;
      n = after;
      continue;
    }
    const colour = decodedColour(channel, frame, n), x1 = Math.min(right, channel.kind === "state" ? next : Math.min(next - 1, x0 + 260));
    g.fillStyle = colour;
    g.globalAlpha = 0.18;
    g.fillRect(x0, high, x1 - x0, low - high);
    g.globalAlpha = 1;
    g.fillRect(x0, high, 2, low - high);
    g.fillStyle = theme.value.ink;
    const text = fitted(g, decodedText(channel, frame, n), x1 - x0 - 8);
    if (text.length > 1) g.fillText(text, x0 + 5, top + row.height / 2 + 4);
    n++;
  }
  g.restore();
}

function decodedColour(channel: ChannelHeader, frame: Frame, row: number): string {
  if (channel.kind === "packets") return numbers(frame, "is_bad")[row] ? theme.value.bad : numbers(frame, "to_robot")[row] === 1 ? theme.value.left : theme.value.right;
  if (channel.kind === "state") return curveColour(numbers(frame, "state")[row]!);
  return numbers(frame, "is_sent")[row] ? theme.value.right : theme.value.decoded;
}

/** What a decoded row says, in a line. */
export function decodedText(channel: ChannelHeader, frame: Frame, row: number): string {
  if (channel.kind === "packets") {
    const name = texts(frame, "name").at(row), says = texts(frame, "says").at(row);
    return `${name} ${says}`.trim() || hex((frame.columns.get("data") as unknown as { at(row: number): Uint8Array }).at(row));
  }
  if (channel.kind === "state") return channel.states[numbers(frame, "state")[row]!] ?? "?";
  return texts(frame, "text").at(row);
}

/** What the pointer reads of a wire: its level, how long that stands, and the frequency. */
export function reading(row: Row, pulse: { from: number; to: number; value: number; period: number | undefined }): string {
  const value = (row.channel?.width ?? 1) > 1 ? `0x${pulse.value.toString(16)}` : pulse.value ? "high" : "low";
  return `${row.title}: ${value} for ${duration(pulse.to - pulse.from)}${pulse.period ? `, period ${duration(pulse.period)} = ${frequency(pulse.period)}` : ""}`;
}
