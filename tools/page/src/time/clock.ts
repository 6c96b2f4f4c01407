// The one time of the page: where it is, the window that is looked at, two cursors, and playing.
//
// Invariant: start <= from < to <= end, and now lies in the run; times are ns.
import { batch, computed, signal } from "@preact/signals";

/** Virtual seconds a second. */
export const RATES = [0.01, 0.1, 0.25, 0.5, 1, 2, 5, 10, 50] as const;
/** The least that a window spans. */
export const LEAST_SPAN_NS = 20;

export class Clock {
  readonly start = signal(0);
  readonly end = signal(1);
  readonly now = signal(0);
  readonly from = signal(0);
  readonly to = signal(1);
  readonly a = signal<number | null>(null);
  readonly b = signal<number | null>(null);
  readonly playing = signal(false);
  readonly rate = signal(1);
  /** Of a live run: whether now goes with it. */
  readonly atEnd = signal(false);
  /** Where a run stands that can be set back; null: at its end. */
  readonly head = signal<number | null>(null);
  readonly span = computed(() => this.to.value - this.from.value);

  /** Takes the bounds of a run: at first all of it is looked at. */
  setRun(start: number, end: number): void {
    batch(() => {
      const isAll = this.from.peek() <= this.start.peek() && this.to.peek() >= this.end.peek();
      this.start.value = start;
      this.end.value = Math.max(end, start + LEAST_SPAN_NS);
      if (isAll) this.showAll();
      if (this.atEnd.peek()) this.go(this.head.peek() ?? this.end.peek());
      else this.now.value = this.inRun(this.now.peek());
    });
  }

  /** Goes to a time, and not with the run any more. */
  seek(t: number): void {
    batch(() => {
      this.atEnd.value = false;
      this.go(t);
    });
  }

  /** Goes with the run, from where it stands. */
  goWithRun(): void {
    batch(() => {
      this.playing.value = false;
      this.atEnd.value = true;
      this.go(this.head.peek() ?? this.end.peek());
    });
  }

  private go(t: number): void {
    batch(() => {
      const was = this.now.peek(), isSeen = was >= this.from.peek() && was <= this.to.peek();
      this.now.value = this.inRun(t);
      if (isSeen) this.follow();
    });
  }

  /** Brings now into the window, by as little as shows what comes. */
  follow(): void {
    const span = this.span.peek(), now = this.now.peek();
    if (now < this.from.peek()) this.look(now - span * 0.5, now + span * 0.5);
    else if (now > this.to.peek()) this.look(now - span * 0.1, now + span * 0.9);
  }

  /** Looks at a window; it is moved and cut into the run. */
  look(from: number, to: number): void {
    const start = this.start.peek(), end = this.end.peek();
    const span = Math.min(end - start, Math.max(LEAST_SPAN_NS, to - from));
    const middle = (from + to) / 2, low = Math.min(Math.max(start, middle - span / 2), end - span);
    batch(() => {
      this.from.value = low;
      this.to.value = low + span;
    });
  }

  /** Looks closer (factor below 1) or from further away; what is at `about` stays where it is. */
  zoom(factor: number, about = this.isNowSeen() ? this.now.peek() : (this.from.peek() + this.to.peek()) / 2): void {
    const share = (about - this.from.peek()) / this.span.peek();
    const span = Math.min(this.end.peek() - this.start.peek(), Math.max(LEAST_SPAN_NS, this.span.peek() * factor));
    this.look(about - share * span, about + (1 - share) * span);
  }

  pan(share: number): void {
    const by = share * this.span.peek();
    this.look(this.from.peek() + by, this.to.peek() + by);
  }

  showAll(): void {
    this.look(this.start.peek(), this.end.peek());
  }

  /** Goes to a moment and looks at it so closely that `span` is a tenth of what is seen. */
  lookAt(t: number, span: number): void {
    batch(() => {
      this.seek(t);
      if (this.span.peek() > span * 20 || t < this.from.peek() || t > this.to.peek()) this.look(t - span * 5, t + span * 5);
    });
  }

  play(): void {
    this.atEnd.value = false;
    if (this.now.peek() >= this.end.peek()) this.go(this.start.peek());
    this.playing.value = true;
  }

  pause(): void {
    this.playing.value = false;
    this.atEnd.value = false;
  }

  toggle(): void {
    if (this.playing.peek()) this.pause();
    else this.play();
  }

  /** Goes on by so much of real time; at the end it pauses. */
  advance(real_ms: number): void {
    if (!this.playing.peek()) return;
    batch(() => {
      this.go(this.now.peek() + real_ms * 1e6 * this.rate.peek());
      if (this.now.peek() >= this.end.peek()) this.playing.value = false;
    });
  }

  faster(by: 1 | -1): void {
    const place = RATES.findIndex((rate) => rate >= this.rate.peek());
    this.rate.value = RATES[Math.min(RATES.length - 1, Math.max(0, place + by))]!;
  }

  setCursor(name: "a" | "b", t: number | null): void {
    this[name].value = t === null ? null : this.inRun(t);
  }

  private isNowSeen(): boolean {
    return this.now.peek() >= this.from.peek() && this.now.peek() <= this.to.peek();
  }

  private inRun(t: number): number {
    return Math.round(Math.min(this.end.peek(), Math.max(this.start.peek(), t)));
  }
}
