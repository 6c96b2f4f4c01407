// Begins the page: with the data in it, or with that of the program that showed it.
import "dockview/dist/styles/dockview.css";
import "uplot/dist/uPlot.min.css";
import "./style/page.css";
import "./style/views.css";
import { render } from "preact";
import { inlineHeader, inlineStore } from "./data/inline";
import { Connection } from "./data/socket";
import type { Store } from "./data/store";
import type { PageHeader } from "./generated/view";
import { token } from "./data/token";
import { App } from "./shell/app";
import { drawTimes, svgOf } from "./shell/surface";
import { frameTimes, ReportPage, RunPage, Waiting, waiting } from "./shell/page";

declare global {
  interface Window {
    /** For tests, measurements and pictures: the page's state. */
    p2osPage?: { app: App; frameTimes: readonly number[]; drawTimes: readonly number[]; svgOf: typeof svgOf };
  }
}

const place = document.getElementById("app")!;

/** Whether a header is that of a report alone, which is read as a document. */
const isReport = (header: PageHeader) => !header.channels.length && !header.world && !header.is_live;

function show(store: Store): void {
  const header = store.header.peek();
  if (isReport(header)) {
    document.title = header.title || document.title;
    render(<ReportPage header={header} store={store} />, place);
    return;
  }
  const app = new App(store);
  window.p2osPage = { app, frameTimes, drawTimes, svgOf };
  document.title = store.header.value.title || document.title;
  render(<RunPage app={app} />, place);
}

const header = inlineHeader();
if (header) {
  if (isReport(header)) render(<ReportPage header={header} />, place);
  else show(inlineStore(header));
} else {
  waiting.value = "Waiting for the program that shows this run …";
  render(<Waiting />, place);
  const scheme = location.protocol === "https:" ? "wss" : "ws";
  new Connection(`${scheme}://${location.host}/stream`, token(), show, (why) => { waiting.value = why; });
}
