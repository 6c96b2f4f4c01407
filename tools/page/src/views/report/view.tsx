// The report of the run: its figures, goals, measures and parts.
import { render } from "preact";
import type { App, ViewKind } from "../../shell/app";
import { Sections } from "./blocks";

export const report: ViewKind = {
  id: "report", title: "Report", doc: "Figures, goals and measures of the run, and what was plugged in.",
  has: (store) => store.header.value.sections.length > 0,
  mount: (app, host) => {
    render(<Report app={app} />, host);
    return () => render(null, host);
  },
};

function Report({ app }: { app: App }) {
  const { sections, footer } = app.store.header.value;
  return (
    <div class="report">
      <Sections sections={sections} seek={(t) => app.clock.seek(t)} />
      {footer && <footer>{footer}</footer>}
    </div>
  );
}
