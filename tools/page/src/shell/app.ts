// What all views share: the data, the one time, what is chosen, and the control of a run that goes on.
import { batch, effect, signal, type Signal } from "@preact/signals";
import type { StepUnit } from "../generated/view";
import type { Command, Store } from "../data/store";
import { Clock, RATES } from "../time/clock";

/** A row of a channel that a person chose. */
export interface Selection {
  readonly channel: number;
  readonly t: number;
  /** Which of the rows of that moment. */
  readonly place: number;
}

/** What a step may go by, in words. */
export const UNITS: readonly (readonly [StepUnit, string])[] = [
  ["instruction", "instruction"], ["line", "source line"], ["edge", "edge"], ["packet", "packet"], ["event", "event"], ["millisecond", "millisecond"],
];

export class App {
  readonly clock = new Clock();
  readonly selection: Signal<Selection | null> = signal(null);
  /** The wire that keys and search go along; a channel's id. */
  readonly wire: Signal<number | null> = signal(null);
  readonly unit: Signal<StepUnit> = signal("event");
  /** The future that is looked at beside the chosen one. */
  readonly beside: Signal<string | null> = signal(null);
  /** Counts up when the robot was stopped. */
  readonly stops = signal(0);
  /** From which answer on now goes with the run again: it was asked to move. */
  private awaited = Infinity;

  constructor(readonly store: Store) {
    const { start_ns, end_ns, is_live } = store.header.peek();
    this.clock.setRun(start_ns, end_ns);
    this.clock.showAll();
    this.clock.seek(end_ns); // what came of it is seen first
    this.clock.atEnd.value = is_live;
    effect(() => this.follow());
  }

  /** Whether this page controls a run. */
  get controls(): boolean {
    return this.store.run.value !== null && this.store.mayControl.value && !this.store.header.value.hands?.is_real;
  }

  /** Whether this page drives a robot that is there. */
  get drives(): boolean {
    return this.store.run.value !== null && this.store.mayControl.value && this.store.header.value.hands?.is_real === true;
  }

  /** Stops a robot that is there; what is held has to be pressed anew. */
  stop(): void {
    this.ask({ do: "stop" });
    this.stops.value++;
  }

  /** Lets time go on, or stand still: the run's, where this page controls it. */
  toggle(): void {
    if (!this.controls) this.clock.toggle();
    else if (this.store.run.peek()!.is_running) this.ask({ do: "pause" });
    else this.move({ do: "run" });
  }

  step(way: 1 | -1): void {
    if (!this.controls) return;
    const unit = this.unit.peek(), words = unit === "edge" ? this.wireName() : "";
    this.move({ do: way === 1 ? "step" : "back", unit, ...(words ? { words } : {}) });
  }

  faster(by: 1 | -1): void {
    if (!this.controls) {
      this.clock.faster(by);
      return;
    }
    const speed = this.store.run.peek()!.speed || Infinity, speeds = [...RATES, Infinity];
    const place = speeds.findIndex((rate) => rate >= speed), next = speeds[Math.min(speeds.length - 1, Math.max(0, place + by))]!;
    this.ask({ do: "speed", speed: Number.isFinite(next) ? next : 0 });
  }

  /** Asks something of the run. */
  ask(command: Command): void {
    this.store.command(command);
  }

  /** Asks something that begins where one looks; then now goes with the run. */
  move(command: Command): void {
    const run = this.store.run.peek(), at = Math.round(this.clock.now.peek());
    if (!run) return;
    this.awaited = run.done + 1;
    const takesTime = !["choose", "compare", "drop"].includes(command.do) && !this.clock.atEnd.peek() && at !== run.head_ns;
    this.ask({ ...command, ...(takesTime ? { at_ns: at } : {}) });
  }

  /** Asks for something that is done by hand; to a robot of several, the chosen one where none is named. */
  byHand(command: Command, robot = this.store.handsOffer?.robot ?? ""): void {
    this.move({ ...command, ...(robot ? { robot } : {}) });
  }

  private follow(): void {
    const run = this.store.run.value, beside = this.beside.value, { start_ns } = this.store.all.value;
    if (!run || this.store.all.value.hands?.is_real) return; // a robot that is there stands nowhere in time
    batch(() => {
      const looked = run.futures.filter(({ name }) => name === run.future || name === beside);
      const sources = looked.map(({ source }) => source), end_ns = looked.length ? Math.max(start_ns, ...looked.map((one) => one.end_ns)) : this.store.all.value.end_ns;
      const was = this.store.shown.peek();
      if (looked.length && (was?.end_ns !== end_ns || was.sources.join("\n") !== sources.join("\n"))) this.store.shown.value = { sources, end_ns };
      this.clock.head.value = run.head_ns;
      this.clock.setRun(start_ns, end_ns);
      if (run.done < this.awaited) return;
      this.awaited = Infinity;
      this.clock.goWithRun();
    });
  }

  /** The chosen wire, as the bench calls it. */
  private wireName(): string {
    return this.store.channel(this.wire.peek() ?? -1)?.doc ?? "";
  }
}

/** A view: what it is called, whether a run has it, and how it begins in its place. */
export interface ViewKind {
  readonly id: string;
  readonly title: string;
  /** One line, for who asks what it is. */
  readonly doc: string;
  readonly has: (store: Store) => boolean;
  /** Begins; returns how it ends. */
  readonly mount: (app: App, host: HTMLElement) => () => void;
}
