// What hands do, in the words that a run understands.

const metres = (value: number) => (Math.round(value * 1000) / 1000).toString();
const degrees = (radians: number) => (Math.round((radians * 1800) / Math.PI) / 10).toString();

/** Where something is put: metres and radians. */
export interface Put {
  readonly x: number;
  readonly y: number;
  readonly heading: number;
}

const at = ({ x, y, heading }: Put) => `${metres(x)} ${metres(y)} heading ${degrees(heading)}`;

/** What the robot is called among the things that can be dragged. */
export const ROBOT = "\u0000robot";

export const moved = (name: string, put: Put) => (name === ROBOT ? `carry robot to ${at(put)}` : `move ${name} to ${at(put)}`);

export const placedBox = (name: string, length: number, width: number, put: Put) => `place ${name} box ${metres(length)} ${metres(width)} at ${at(put)}`;

export const placedCylinder = (name: string, radius: number, put: Put) => `place ${name} cylinder ${metres(radius)} at ${at(put)}`;

/** A name that nothing has: box 1, box 2 … */
export function freeName(kind: string, taken: Iterable<string>): string {
  const names = new Set(taken);
  let number = 1;
  while (names.has(`${kind} ${number}`)) number++;
  return `${kind} ${number}`;
}
