// Drives the robot by keys, the stick on the page, or a pad. It stands unless something is held, here and now: what is held is forgotten when the
// page loses focus, is hidden, left, or hears nothing of the program any more, and has to be pressed anew.
import { effect, signal } from "@preact/signals";
import type { Command } from "../data/store";
import type { App } from "../shell/app";
import { DRIVE_KEYS, FACTOR, FASTER, LEAST_SHARE, padWay, SLOWER, STOP_KEYS, type Way, wayOf } from "./keys";

/** How often what is held is said anew, ms: three times within what the program waits. */
const SAID_MS = 100;
const STILL: Way = [0, 0];

export class Driving {
  /** Whether this page drives. */
  readonly isOn = signal(false);
  /** What it asks for, in shares. */
  readonly way = signal<Way>(STILL);
  /** Of the greatest speeds. */
  readonly share = signal(1);
  readonly hasPad = signal(false);
  private readonly held = new Set<string>();
  private stick: Way = STILL;
  private padIsFree = true;
  private timer: ReturnType<typeof setInterval> | undefined;
  private wasMoving = false;
  /** Whose wheels these are, of several robots. */
  private robot = "";

  constructor(private readonly app: App) {}

  /** Listens until it is ended. */
  begin(): () => void {
    const stop = () => this.stop(), hidden = () => { if (document.hidden) this.stop(); };
    window.addEventListener("blur", stop);
    window.addEventListener("pagehide", stop);
    document.addEventListener("visibilitychange", hidden);
    const lost = effect(() => { if (this.app.store.trouble.value || this.app.stops.value) this.stop(); });
    const other = effect(() => this.turnTo(this.app.store.handsOffer?.robot ?? ""));
    this.timer = setInterval(() => this.turn(), SAID_MS);
    return () => {
      this.stop();
      clearInterval(this.timer);
      lost();
      other();
      window.removeEventListener("blur", stop);
      window.removeEventListener("pagehide", stop);
      document.removeEventListener("visibilitychange", hidden);
    };
  }

  /** Takes the wheels, which stand; or lets them go. */
  turnOn(isOn: boolean): void {
    const isReal = this.app.store.header.peek().hands?.is_real ?? false;
    this.forget();
    this.wasMoving = false; // what is asked for here is the last of what was held
    this.isOn.value = isOn;
    if (isOn || isReal) this.ask({ do: "drive", forward_mps: 0, turn_dps: 0 });
    else this.ask({ do: "hand", words: "let go wheels" });
  }

  /** Takes another robot: the one before drives by itself again. */
  private turnTo(robot: string): void {
    if (robot !== this.robot && this.isOn.peek()) this.turnOn(false);
    this.robot = robot;
  }

  private ask(command: Command): void {
    this.app.ask({ ...command, ...(this.robot ? { robot: this.robot } : {}) });
  }

  /** Forgets what is held: the robot stands. */
  stop(): void {
    this.forget();
    this.say();
  }

  /** Takes a key that went down or up; says whether it has a meaning. */
  key(key: string, isDown: boolean): boolean {
    const known = key.length === 1 ? key.toLowerCase() : key;
    if (STOP_KEYS.includes(known)) this.forget();
    else if (isDown && FASTER.includes(known)) this.share.value = Math.min(1, this.share.value * FACTOR);
    else if (isDown && SLOWER.includes(known)) this.share.value = Math.max(LEAST_SHARE, this.share.value / FACTOR);
    else if (!DRIVE_KEYS[known]) return false;
    else if (isDown) this.held.add(known);
    else this.held.delete(known);
    this.say();
    return true;
  }

  /** Takes where the stick of the page stands, in shares. */
  push(ahead: number, left: number): void {
    this.stick = [ahead, left];
    this.say();
  }

  private forget(): void {
    this.held.clear();
    this.stick = STILL;
    this.padIsFree = false; // a trigger that is still pulled means nothing until it was let go
  }

  private turn(): void {
    const pad = document.hasFocus() ? firstPad() : undefined;
    this.hasPad.value = pad !== undefined;
    if (pad?.buttons[12]?.pressed && !this.isOn.peek()) this.turnOn(true);
    if (pad?.buttons[13]?.pressed && this.isOn.peek()) this.turnOn(false);
    this.say(padWay(pad));
  }

  /** Says what is held: while it is anything again and again, and once that it is nothing. */
  private say(pad = padWay(firstPad())): void {
    const [ahead, left] = wayOf(this.held), isPulled = pad !== undefined && (pad[0] !== 0 || pad[1] !== 0);
    if (!isPulled) this.padIsFree = true;
    const own = ahead || left ? [ahead, left] as const : this.stick, way = isPulled && this.padIsFree && document.hasFocus() ? pad : own;
    this.way.value = this.isOn.peek() ? way : STILL;
    const isMoving = this.way.peek().some((one) => one !== 0), offer = this.app.store.handsOffer;
    if ((isMoving || this.wasMoving) && offer) {
      const [forward, turn] = this.way.peek(), share = this.share.peek();
      this.ask({ do: "drive", forward_mps: forward * share * offer.most_mps, turn_dps: turn * share * offer.most_dps });
    }
    this.wasMoving = isMoving;
  }
}

/** The first pad of this machine; a browser tells of it once one of its buttons was pressed. */
function firstPad(): Gamepad | undefined {
  return "getGamepads" in navigator ? navigator.getGamepads().find((one) => one !== null) ?? undefined : undefined;
}
