// The head of the page: what was run, what came of it, the layout, and what is left out.
import { useState } from "preact/hooks";
import type { PageHeader } from "../generated/view";
import type { App } from "./app";
import { Help } from "./help";
import { IconButton } from "./icons";
import { LAYOUTS } from "./layouts";

interface Props {
  readonly header: PageHeader;
  readonly app?: App;
  /** What is wrong with the connection of a page without an app. */
  readonly trouble?: string;
  readonly layout?: string;
  readonly onLayout?: (id: string) => void;
  readonly onLink?: () => Promise<boolean>;
}

export function Head({ header, app, trouble: ofReport, layout, onLayout, onLink }: Props) {
  const [isHelp, setHelp] = useState(false), [said, setSaid] = useState(""), trouble = app?.store.trouble.value ?? ofReport;
  return (
    <header class="head">
      <div class="head-title">
        <h1>{header.title}</h1>
        {header.verdict && <span class={`verdict ${header.standing || "none"}`}>{header.verdict}</span>}
        {header.is_live && <span class="verdict live">live</span>}
        {header.lead && <p class="lead">{header.lead}</p>}
      </div>
      {app && <div class="head-tools">
        {app.store.robots.length > 0 && <label class="inline-label">robot <select aria-label="Robot whose pins, packets and plots are shown" value={app.store.robot.value} onChange={(event) => { app.store.robot.value = event.currentTarget.value; }}>
          <option value="">all</option>
          {app.store.robots.map((name) => <option value={name}>{name}</option>)}
        </select></label>}
        {layout && onLayout && <label class="inline-label">layout <select aria-label="Layout" value={layout} onChange={(event) => onLayout(event.currentTarget.value)}>
          {LAYOUTS.map((one) => <option value={one.id}>{one.title}</option>)}
        </select></label>}
        {onLink && <IconButton icon="link" label="Copy a link to this moment" onClick={() => void onLink().then((done) => setSaid(done ? "the link is copied" : "the link is in the address bar"))} />}
        <IconButton icon="help" label="Keys and views" onClick={() => setHelp(true)} />
        <span class="said" role="status">{said}</span>
        {isHelp && <Help app={app} onClose={() => setHelp(false)} />}
      </div>}
      {header.why && <p class="why">{app ? withMoments(app, header.why) : header.why}</p>}
      {trouble && <p class="trouble" role="alert">{trouble}</p>}
      {header.left_out.length > 0 && <details class="left-out-list"><summary>{`This page shows a part of what was recorded (${header.left_out.length})`}</summary><ul>{header.left_out.map((line) => <li>{line}</li>)}</ul></details>}
    </header>
  );
}

/** A text with each moment in it ("at 0.500 s") as a button that goes there. */
function withMoments(app: App, text: string) {
  return text.split(/(\bat \d+\.\d{3} s\b)/).map((part, n) => {
    const ns = Math.round(Number(part.split(" ")[1]) * 1e9);
    return n % 2 && ns <= app.clock.end.value ? <button type="button" class="link" onClick={() => app.clock.lookAt(ns, app.clock.span.value / 20)}>{part}</button> : part;
  });
}
