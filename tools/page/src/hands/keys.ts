// The keys that drive, as in the terminal (p2os teleop): ahead and to the left, in shares of the chosen speeds.

export type Way = readonly [ahead: number, left: number];

export const DRIVE_KEYS: Readonly<Record<string, Way>> = {
  ArrowUp: [1, 0], ArrowDown: [-1, 0], ArrowLeft: [0, 1], ArrowRight: [0, -1],
  w: [1, 0], s: [-1, 0], a: [0, 1], d: [0, -1],
  i: [1, 0], ",": [-1, 0], j: [0, 1], l: [0, -1],
  u: [1, 1], o: [1, -1], m: [-1, -1], ".": [-1, 1],
};
export const STOP_KEYS: readonly string[] = [" ", "k", "x"];
export const FASTER: readonly string[] = ["+", "="];
export const SLOWER: readonly string[] = ["-", "_"];
/** Each press of + or - changes the speeds by so much. */
export const FACTOR = 1.1;
export const LEAST_SHARE = 0.05;

const within = (value: number) => Math.max(-1, Math.min(1, value));

/** What keys that are held ask for together: opposite ones nothing. */
export function wayOf(held: Iterable<string>): Way {
  let ahead = 0, left = 0;
  for (const key of held) {
    const way = DRIVE_KEYS[key];
    if (way) [ahead, left] = [ahead + way[0], left + way[1]];
  }
  return [within(ahead), within(left)];
}

/** Below it a stick is in its middle. */
const DEAD = 0.12;

/** A stick's share, without what it has in its middle. */
export function stickShare(value: number): number {
  return Math.abs(value) < DEAD ? 0 : within((value - Math.sign(value) * DEAD) / (1 - DEAD));
}

/** What a pad asks for, as `p2os teleop --pad`: R2 ahead, L2 back, the right stick turns; undefined: there is none. */
export function padWay(pad: Pick<Gamepad, "buttons" | "axes"> | null | undefined): Way | undefined {
  if (!pad) return undefined;
  const pulled = (button: number) => pad.buttons[button]?.value ?? 0;
  return [within(pulled(7) - pulled(6)), -stickShare(pad.axes[2] ?? 0) || 0];
}
