// A panel: the inside of what runs, as it is now, out of tables, listings and drawings that its owner makes.
import { render } from "preact";
import { useEffect, useState } from "preact/hooks";
import type { PanelHeader } from "../generated/view";
import type { App, ViewKind } from "../shell/app";
import { moment } from "../time/format";
import { BY_NOW, Sections } from "./report/blocks";

export function panelView(panel: PanelHeader): ViewKind {
  return {
    id: `panel-${panel.name}`, title: panel.title, doc: `${panel.title}, as it is now.`,
    has: () => true,
    mount: (app, host) => {
      render(<Panel app={app} panel={panel} host={host} />, host);
      return () => render(null, host);
    },
  };
}

function Panel({ app, panel, host }: { app: App; panel: PanelHeader; host: HTMLElement }) {
  const [choice, setChoice] = useState(panel.choices[0] ?? ""), state = app.store.panels.value.get(`${panel.name} ${choice}`);
  const isOver = panel.sections.length > 0, sections = isOver ? panel.sections : state?.sections;
  useEffect(() => (isOver ? undefined : whileSeen(host, () => app.store.look([panel.name, choice]))), [choice]);
  return (
    <>
      {panel.choices.length > 0 && <div class="view-bar">
        <select aria-label={`${panel.title}: what is looked at`} value={choice} onChange={(event) => setChoice(event.currentTarget.value)}>
          {panel.choices.map((one) => <option value={one}>{one}</option>)}
        </select>
        {state && <span class="faint">{`at ${moment(state.at_ns, 1e3)}`}</span>}
      </div>}
      <div class="report panel" tabIndex={0} role="group" aria-label={panel.title}>{sections ? <BY_NOW.Provider value={isOver ? app.clock.now.value : Infinity}><Sections sections={sections} seek={(t) => app.clock.seek(t)} /></BY_NOW.Provider> : <p class="view-note">Nothing has come yet.</p>}</div>
    </>
  );
}

/** Does something while an element is seen: what it returns ends it. */
function whileSeen(host: HTMLElement, begin: () => () => void): () => void {
  let end: (() => void) | undefined;
  const observer = new IntersectionObserver((entries) => {
    if (entries.at(-1)!.isIntersecting) end ??= begin();
    else {
      end?.();
      end = undefined;
    }
  });
  observer.observe(host);
  return () => {
    observer.disconnect();
    end?.();
  };
}
