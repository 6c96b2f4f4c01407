// Data that stands in the page itself: its header as JSON, its frames as base64 of gzip.
import type { PageHeader } from "../generated/view";
import { framesIn } from "./frames";
import { Store } from "./store";

/** The store of a page that is one file; undefined where the page has no data inside. */
export function inlineHeader(): PageHeader | undefined {
  const text = document.getElementById("header")?.textContent;
  return text ? (JSON.parse(text) as PageHeader) : undefined;
}

/** The store at once, its rows when they are unpacked: the page is drawn before. */
export function inlineStore(header: PageHeader): Store {
  const store = new Store(header, undefined);
  const text = document.getElementById("frames")?.textContent.trim();
  if (text) void unpacked(text).then((bytes) => store.receive(framesIn(bytes)), (error: unknown) => {
    store.trouble.value = `the data in this page cannot be read: ${String(error)}`;
  });
  return store;
}

/** What base64 of gzip holds. */
export async function unpacked(text: string): Promise<ArrayBuffer> {
  const packed = bytesOf(text), stream = new DecompressionStream("gzip"), writer = stream.writable.getWriter();
  void writer.write(packed as BufferSource).then(() => writer.close()).catch(() => undefined);
  return new Response(stream.readable).arrayBuffer();
}

function bytesOf(base64: string): Uint8Array {
  const binary = atob(base64), bytes = new Uint8Array(binary.length);
  for (let n = 0; n < binary.length; n++) bytes[n] = binary.charCodeAt(n);
  return bytes;
}
