// Data that a server sends: text messages are JSON, binary ones frames. The server is the program that showed this page.
import type { Answered, PageHeader } from "../generated/view";
import { frameAt } from "./frames";
import { type Command, type Look, type Request, type Source, Store } from "./store";

const SUBPROTOCOL = "p2os.view.1";
/** The server closes so where another try is of no use: a request that is none, a wrong token. */
const FINAL = new Set([4400, 4401]);
/** Waits between tries to connect again, ms. */
const WAITS_MS = [250, 500, 1000, 2000, 4000, 8000];

interface Asked {
  readonly request: Request;
  readonly answered: (isThere: boolean) => void;
}

export class Connection implements Source {
  private socket: WebSocket | undefined;
  private store: Store | undefined;
  private tries = 0;
  private number = 0;
  private readonly open = new Map<number, Asked>();

  /**
   * @param started Gets the store when the first header came.
   * @param failed Gets a line when there never was one.
   */
  constructor(private readonly url: string, private readonly token: string, private readonly started: (store: Store) => void, private readonly failed: (why: string) => void) {
    this.connect();
  }

  ask(request: Request, answered: (isThere: boolean) => void): void {
    const id = ++this.number;
    this.open.set(id, { request, answered });
    if (this.socket?.readyState === WebSocket.OPEN) this.socket.send(JSON.stringify({ ...request, id }));
    else this.finish(id, false);
  }

  command(command: Command): void {
    if (this.socket?.readyState === WebSocket.OPEN) this.socket.send(JSON.stringify(command));
  }

  offer(begun: string): void {
    if (this.socket?.readyState === WebSocket.OPEN) this.socket.send(JSON.stringify({ offer: begun }));
  }

  look(looks: readonly Look[]): void {
    if (this.socket?.readyState === WebSocket.OPEN) this.socket.send(JSON.stringify({ looks }));
  }

  private connect(): void {
    const socket = new WebSocket(this.url, [SUBPROTOCOL, `token.${this.token}`]);
    socket.binaryType = "arraybuffer";
    socket.onmessage = (message) => {
      if (typeof message.data === "string") this.said(JSON.parse(message.data) as Partial<Answered>);
      else this.rows(message.data as ArrayBuffer);
    };
    socket.onclose = (event) => this.closed(event.code, event.reason);
    this.socket = socket;
  }

  private said(message: Partial<Answered>): void {
    if (message.header) this.begin(message.header);
    if (typeof message.done === "number") this.finish(message.done, !message.refused);
    if (!this.store) return;
    const header = this.store.all.peek();
    if (typeof message.now_ns === "number" && message.now_ns > header.end_ns) this.store.all.value = { ...header, end_ns: message.now_ns };
    if (typeof message.may_control === "boolean") this.store.mayControl.value = message.may_control;
    if (message.run) this.store.run.value = message.run;
    if (message.offered) this.store.offered.value = message.offered;
    if (message.panel) this.store.showPanel(message.panel);
    if (message.lost) this.store.forget();
    if (message.refused) this.store.trouble.value = `refused: ${message.refused}`;
  }

  private begin(header: PageHeader): void {
    const isAgain = this.tries > 0;
    this.tries = 0;
    if (!this.store) {
      this.started((this.store = new Store(header, this)));
      return;
    }
    this.store.all.value = header;
    if (!isAgain) return;
    this.store.trouble.value = "";
    this.store.lookAgain();
    this.store.forget(); // another run may be there now
  }

  /** Rows that were asked for have the times of the request; others are new. */
  private rows(data: ArrayBuffer): void {
    const [frame] = frameAt(data, 0);
    if (!frame || !this.store) return;
    const isAnswer = [...this.open.values()].some(({ request }) => request.want.includes(frame.channel) && request.from_ns === frame.from && request.to_ns === frame.to);
    if (isAnswer || frame.replaces) this.store.receive([frame]);
    else this.store.extend(frame);
  }

  private finish(id: number, isThere: boolean): void {
    const asked = this.open.get(id);
    this.open.delete(id);
    asked?.answered(isThere);
  }

  private closed(code: number, reason: string): void {
    for (const id of [...this.open.keys()]) this.finish(id, false);
    const wait = WAITS_MS[this.tries++], why = reason || "the program that shows this run does not answer any more";
    if (wait === undefined || FINAL.has(code) || (!this.store && this.tries > 2)) {
      if (this.store) this.store.trouble.value = `${why}: what is here stays, nothing new comes`;
      else this.failed(why);
      return;
    }
    if (this.store) this.store.trouble.value = `${why}: trying again`;
    setTimeout(() => this.connect(), wait);
  }
}
