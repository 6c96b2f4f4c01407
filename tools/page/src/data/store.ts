// All that the page knows of a run: its header, and of each channel what was sent so far. Views read from here and say what they need.
import { computed, type ReadonlySignal, signal, type Signal } from "@preact/signals";
import { WHOLE_PIXELS, type ChannelHeader, type HandsOffer, type PageHeader, type PanelState, type RunCommand, type RunState, type Wanted } from "../generated/view";
import type { Frame } from "./frames";
import { Lane, LEAST_SHARE, OPEN_END_NS, serves } from "./lane";

export type Request = Omit<Wanted, "id">;

/** Where rows come from: a server; a page that is one file has none. */
export interface Source {
  /** Asks for rows; they come by `Store.receive`, and then it is answered: with whether they came. */
  ask(request: Request, answered: (isThere: boolean) => void): void;
  /** Asks something of the run that is shown. */
  command?(command: Command): void;
  /** Asks which names of variables begin so: they come as `Store.offered`. */
  offer?(begun: string): void;
  /** Says which panels are looked at, each with what of it: what they show comes as `Store.panels`. */
  look?(looks: readonly Look[]): void;
}

/** Which futures are looked at: the sources of their channels, and until when they are known. */
export interface Shown {
  readonly sources: readonly string[];
  readonly end_ns: number;
}

/** A panel's name, and what of it is looked at. */
export type Look = readonly [string, string];

export type Command = Pick<RunCommand, "do"> & Partial<RunCommand>;

/** Kinds that are shown of all robots, whichever is chosen: where they are. */
const OF_ALL: ReadonlySet<string> = new Set(["pose", "ranges", "things"]);
/** How long requests of one moment are gathered, ms. */
const GATHERED_MS = 40;
/** How long rows that come are gathered before they are shown, ms: less than two pictures of a screen. */
const SHOWN_MS = 30;
/** So many times finer than it is shown is asked for: a look a little closer needs no new rows. */
const SPARE = 2.5;
/** The most that the server takes. */
const MOST_PIXELS = 8192;

export class Store {
  /** All that there is. */
  readonly all: Signal<PageHeader>;
  /** What is shown: without the channels and robots of futures that are not looked at. */
  readonly header: ReadonlySignal<PageHeader>;
  /** The futures that are looked at; null: there are none. */
  readonly shown: Signal<Shown | null> = signal(null);
  /** How the run stands, where it can be controlled, and whether this page may. */
  readonly run: Signal<RunState | null> = signal(null);
  readonly mayControl = signal(false);
  /** Of several robots the one whose pins, packets, plots and consoles are shown; empty: all of them. */
  readonly robot = signal("");
  /** Counts up when rows came. */
  readonly version = signal(0);
  /** Names of variables, for what was typed last. */
  readonly offered: Signal<readonly string[]> = signal([]);
  /** What panels show, by name and choice. */
  readonly panels: Signal<ReadonlyMap<string, PanelState>> = signal(new Map());
  private looks: readonly Look[] = [];
  /** What is wrong with the connection, in a line; empty: nothing. */
  readonly trouble = signal("");
  private readonly lanes = new Map<number, Lane>();
  private readonly open: Request[] = [];
  private gathered = new Map<string, { ids: Set<number>; from: number; to: number; pixels: number }>();
  private timer: ReturnType<typeof setTimeout> | undefined;
  private showing: ReturnType<typeof setTimeout> | undefined;

  constructor(header: PageHeader, private readonly source: Source | undefined) {
    this.all = signal(header);
    this.header = computed(() => onlyShown(this.all.value, this.shown.value));
  }

  /** Asks something of the run. */
  command(command: Command): void {
    this.source?.command?.(command);
  }

  offer(begun: string): void {
    this.source?.offer?.(begun);
  }

  /** Looks at a panel until what is returned is called. */
  look(look: Look): () => void {
    this.looks = [...this.looks, look];
    this.lookAgain();
    return () => {
      this.looks = this.looks.filter((one) => one !== look);
      this.lookAgain();
    };
  }

  /** Says what is looked at: to a server that has just been connected to, too. */
  lookAgain(): void {
    this.source?.look?.(this.looks);
  }

  /** Takes what a panel shows. */
  showPanel(panel: PanelState): void {
    this.panels.value = new Map(this.panels.peek()).set(`${panel.name} ${panel.choice}`, panel);
  }

  /** Channels of the robot that is chosen, and what belongs to all of them. */
  get chosen(): readonly ChannelHeader[] {
    const robot = this.robot.value, all = this.header.value.channels;
    return robot ? all.filter(({ source }) => !source || source === robot) : all;
  }

  /** Those of a kind; where robots are is shown of all, whichever is chosen. */
  channels(kind: string): readonly ChannelHeader[] {
    return (OF_ALL.has(kind) ? this.header.value.channels : this.chosen).filter((channel) => channel.kind === kind);
  }

  /** Whether the run can be set back and read: robots that share a world go on, and nobody reads their programs. */
  get canGoBack(): boolean {
    return (this.run.value?.futures.length ?? 0) > 0;
  }

  /** What hands can do here, to the robot that is chosen where there are several; null: nothing. */
  get handsOffer(): HandsOffer | null {
    const { hands, robot_hands } = this.header.value;
    return robot_hands.find((one) => one.robot === this.robot.value) ?? hands;
  }

  /** Names of robots of which one may be chosen: none where they are futures of one. */
  get robots(): readonly string[] {
    const names = this.shown.value ? [] : this.header.value.robots.map(({ name }) => name).filter(Boolean);
    return names.length > 1 ? names : [];
  }

  channel(id: number): ChannelHeader | undefined {
    return this.header.value.channels.find((channel) => channel.id === id);
  }

  /** Whether finer rows than those here can be had. */
  get canAsk(): boolean {
    return this.source !== undefined;
  }

  /** Takes rows that were asked for, or stand in the page. */
  receive(frames: readonly Frame[]): void {
    for (const frame of frames) this.lane(frame.channel).add(frame);
    this.showSoon();
  }

  /** Takes rows that a live run has just made. */
  extend(frame: Frame): void {
    this.lane(frame.channel).extend(frame);
    this.showSoon();
  }

  /** Rows come a channel a message: those of one moment are shown at once, since each showing draws all views anew. */
  private showSoon(): void {
    if (this.version.peek() === 0) this.version.value++;
    else this.showing ??= setTimeout(() => {
      this.showing = undefined;
      this.version.value++;
    }, SHOWN_MS);
  }

  /** Rows of a channel that show a window best, or undefined while there are none; with `pixels`, finer ones are asked for where they are missing. */
  rows(id: number, from: number, to: number, pixels = 0): Frame | undefined {
    const { start_ns, end_ns } = this.header.peek();
    const low = Math.max(start_ns, from), high = Math.max(low, Math.min(end_ns, to));
    if (pixels) this.want(id, low, high, pixels);
    return this.lane(id).best(low, high);
  }

  /** Rows over the whole run, as fine as there are. */
  whole(id: number): Frame | undefined {
    const { start_ns, end_ns } = this.header.peek();
    return this.rows(id, start_ns, end_ns, WHOLE_PIXELS / SPARE);
  }

  /** Rows of a time as they are, when they came; reduced where even so there are too many, undefined where nobody answers. */
  async exact(id: number, from: number, to: number): Promise<Frame | undefined> {
    const here = this.lane(id).best(from, to);
    if (!this.source || (here && !here.isReduced && here.from <= from && here.to >= to)) return here;
    await new Promise<void>((resolve) => this.source!.ask({ want: [id], from_ns: Math.floor(from), to_ns: Math.ceil(to), pixels: MOST_PIXELS }, () => resolve()));
    return this.lane(id).best(from, to);
  }

  /** Forgets rows: what was kept of an earlier connection, or lost on a slow one. */
  forget(): void {
    for (const lane of this.lanes.values()) lane.clear();
    this.version.value++;
  }

  private lane(id: number): Lane {
    let lane = this.lanes.get(id);
    if (!lane) this.lanes.set(id, (lane = new Lane()));
    return lane;
  }

  private want(id: number, from: number, to: number, pixels: number): void {
    const { end_ns } = this.header.peek();
    if (!this.source || this.lane(id).suffices(from, to, pixels, end_ns)) return;
    if (this.open.some((asked) => asked.want.includes(id) && serves({ from: asked.from_ns, to: asked.to_ns, pixels: asked.pixels }, from, to, pixels, end_ns))) return;
    const key = `${from} ${to}`, found = this.gathered.get(key);
    if (found) {
      found.ids.add(id);
      found.pixels = Math.max(found.pixels, pixels);
    } else this.gathered.set(key, { ids: new Set([id]), from, to, pixels });
    this.timer ??= setTimeout(() => this.flush(), this.version.peek() ? GATHERED_MS : 0); // at first all views begin at once
  }

  private flush(): void {
    this.timer = undefined;
    for (const { ids, from, to, pixels } of this.gathered.values()) this.ask([...ids], from, to, pixels);
    this.gathered = new Map();
  }

  private ask(want: readonly number[], from: number, to: number, pixels: number): void {
    const { start_ns, end_ns, is_live } = this.header.peek(), edge = (to - from) * 0.75; // so that a short way to the side needs no new rows
    const end = to + edge >= end_ns && is_live ? OPEN_END_NS : Math.ceil(Math.min(end_ns, to + edge));
    const isWhole = from <= start_ns && to >= end_ns && pixels * LEAST_SHARE <= WHOLE_PIXELS; // that is the one which a server has ready
    const request: Request = { want, from_ns: Math.floor(Math.max(start_ns, from - edge)), to_ns: end, pixels: isWhole ? WHOLE_PIXELS : Math.ceil(Math.min(MOST_PIXELS, SPARE * pixels)) };
    this.open.push(request);
    this.source!.ask(request, (isThere) => {
      const place = this.open.indexOf(request);
      if (place >= 0) this.open.splice(place, 1);
      if (isThere) for (const id of want) this.lane(id).answered({ from: request.from_ns, to: request.to_ns, pixels: request.pixels });
    });
  }
}

/** What the run itself is called beside its forks. */
const RUN = "run";

/** A header with some sources alone; where they are several, each has a name. */
function onlyShown(header: PageHeader, shown: Shown | null): PageHeader {
  if (!shown) return header;
  const { sources, end_ns } = shown, name = (source: string) => (sources.length > 1 ? source || RUN : "");
  return {
    ...header, end_ns,
    channels: header.channels.filter(({ source }) => sources.includes(source)).map((channel) => ({ ...channel, source: name(channel.source) })),
    robots: header.robots.filter((robot) => sources.includes(robot.name)).map((robot) => ({ ...robot, name: name(robot.name) })),
  };
}
