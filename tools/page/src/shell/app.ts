// What every view of the page shares: data, time, and what is selected.
import { signal, type Signal } from "@preact/signals";
import type { Store } from "../data/store";
import { Clock } from "../time/clock";

/** A row of a channel that a person chose. */
export interface Selection {
  readonly channel: number;
  readonly t: number;
  /** Which of the rows of that moment. */
  readonly place: number;
}

export class App {
  readonly clock = new Clock();
  readonly selection: Signal<Selection | null> = signal(null);
  /** The wire that keys and search go along; a channel's id. */
  readonly wire: Signal<number | null> = signal(null);

  constructor(readonly store: Store) {
    const { start_ns, end_ns, is_live } = store.header.peek();
    this.clock.setRun(start_ns, end_ns);
    this.clock.showAll();
    this.clock.seek(end_ns); // what came of it is seen first
    this.clock.atEnd.value = is_live;
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
