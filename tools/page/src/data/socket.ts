// Data that a server sends: text messages are JSON, binary ones frames. The server is the program that showed this page.
import type { Answered, PageHeader } from "../generated/view";
import { frameAt } from "./frames";
import { type Request, type Source, Store } from "./store";

const SUBPROTOCOL = "p2os.view.1";
/** The server closes so where another try is of no use: a wrong token, a request that is none. */
const FINAL = new Set([4400, 4401]);
/** Waits between tries to connect again, ms. */
const WAITS_MS = [250, 500, 1000, 2000, 4000, 8000];

export class Connection implements Source {
  private socket: WebSocket | undefined;
  private store: Store | undefined;
  private tries = 0;
  private number = 0;
  private readonly open = new Map<number, () => void>();

  /**
   * @param started Gets the store when the first header came.
   * @param failed Gets a line when there never was one.
   */
  constructor(private readonly url: string, private readonly token: string, private readonly started: (store: Store) => void, private readonly failed: (why: string) => void) {
    this.connect();
  }

  ask(request: Request, answered: () => void): void {
    const id = ++this.number;
    this.open.set(id, answered);
    if (!this.send({ ...request, id })) this.finish(id);
  }

  private connect(): void {
    const socket = new WebSocket(this.url, [SUBPROTOCOL, `token.${this.token}`]);
    socket.binaryType = "arraybuffer";
    socket.onmessage = (message) => {
      if (typeof message.data === "string") this.said(JSON.parse(message.data) as Answered);
      else this.rows(message.data as ArrayBuffer);
    };
    socket.onclose = (event) => this.closed(event.code, event.reason);
    this.socket = socket;
  }

  private send(message: object): boolean {
    if (this.socket?.readyState !== WebSocket.OPEN) return false;
    this.socket.send(JSON.stringify(message));
    return true;
  }

  private said(message: Answered): void {
    if (message.header) this.begin(message.header);
    if (typeof message.done === "number") this.finish(message.done);
    if (typeof message.now_ns === "number" && this.store) {
      const header = this.store.header.peek();
      if (message.now_ns > header.end_ns) this.store.header.value = { ...header, end_ns: message.now_ns };
    }
    if (message.lost && this.store) this.store.forget();
    if (message.refused && this.store) this.store.trouble.value = `refused: ${message.refused}`;
  }

  private begin(header: PageHeader): void {
    this.tries = 0;
    if (this.store) {
      this.store.header.value = header;
      this.store.trouble.value = "";
    } else this.started((this.store = new Store(header, this)));
  }

  private rows(data: ArrayBuffer): void {
    const [frame] = frameAt(data, 0);
    if (frame) this.store?.receive([frame], this.open.size === 0);
  }

  private finish(id: number): void {
    const answered = this.open.get(id);
    this.open.delete(id);
    answered?.();
    if (this.store) this.store.version.value++;
  }

  private closed(code: number, reason: string): void {
    for (const id of [...this.open.keys()]) this.finish(id);
    const wait = WAITS_MS[this.tries++];
    const why = reason || "the program that shows this run does not answer any more";
    if (wait === undefined || FINAL.has(code) || (!this.store && this.tries > 2)) {
      if (this.store) this.store.trouble.value = `${why}: what is here stays, nothing new comes`;
      else this.failed(why);
      return;
    }
    if (this.store) this.store.trouble.value = `${why}: trying again`;
    setTimeout(() => this.connect(), wait);
  }
}
