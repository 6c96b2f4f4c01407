// The views beside one another, moved and sized by who looks, on a wide page.
import { createDockview, type IContentRenderer } from "dockview";
import { viewsOf } from "../views/all";
import type { App } from "./app";
import { type Layout, pruned } from "./layouts";

const THEME = { name: "p2os", className: "dockview-theme-p2os" };

export interface Dock {
  /** Brings a view to the front. */
  readonly show: (view: string) => void;
  readonly dispose: () => void;
}

export function mountDock(app: App, host: HTMLElement, layout: Layout): Dock {
  const kinds = new Map(viewsOf(app.store).map((view) => [view.id, view])), columns = pruned(layout, [...kinds.keys()]);
  const begins: (() => void)[] = [];
  let isLaid = false; // while panels are put in, each is in front for a moment
  const api = createDockview(host, {
    theme: THEME, disableFloatingGroups: true, scrollbars: "native",
    defaultTabComponent: "title",
    createTabComponent: () => {
      const element = document.createElement("span");
      return { element, init: ({ title }) => { element.textContent = title; } };
    },
    createComponent: ({ name }): IContentRenderer => {
      const element = document.createElement("div");
      element.className = `view view-${name}`;
      let end: (() => void) | undefined;
      return {
        element,
        // A view begins when it is seen for the first time: 3D loads its script then.
        init: ({ api: panel }) => {
          const begin = () => { if (isLaid && panel.isVisible) end ??= kinds.get(name)?.mount(app, element); };
          panel.onDidVisibilityChange(begin);
          begins.push(begin);
        },
        dispose: () => end?.(),
      };
    },
  });
  // Every view stays: what were closed had no way back.
  host.addEventListener("keydown", (event) => {
    if ((event.key === "Delete" || event.key === "Backspace") && event.target instanceof Element && event.target.matches("[role=tab]")) event.stopPropagation();
  }, true);
  const add = (views: readonly string[], width: number, height: number, beside: string | undefined, direction: "right" | "below" | "within") => views.forEach((view, n) => {
    const position = n ? { referencePanel: views[0]!, direction: "within" as const } : beside === undefined ? undefined : { referencePanel: beside, direction };
    api.addPanel({
      id: view, component: view, title: kinds.get(view)!.title, inactive: n > 0, minimumWidth: 180, minimumHeight: 90, initialWidth: Math.round(width), initialHeight: Math.round(height), ...(position ? { position } : {}),
    });
  });
  // All columns first, so that what stands below divides its own column alone.
  columns.forEach((column, n) => add(column.groups[0]!.views, host.clientWidth * column.share, host.clientHeight, columns[n - 1]?.groups[0]?.views[0], "right"));
  for (const column of columns) column.groups.slice(1).forEach((group, n) => add(group.views, host.clientWidth * column.share, host.clientHeight * group.share, column.groups[n]!.views[0], "below"));
  const { clientWidth, clientHeight } = host;
  for (const column of columns) {
    api.getPanel(column.groups[0]!.views[0]!)?.api.group.api.setSize({ width: Math.round(clientWidth * column.share) });
    for (const group of column.groups.slice(0, -1)) api.getPanel(group.views[0]!)?.api.group.api.setSize({ height: Math.round(clientHeight * group.share) });
    for (const group of column.groups) api.getPanel(group.views[0]!)?.api.setActive();
  }
  api.getPanel(columns[0]?.groups[0]?.views[0] ?? "")?.api.setActive();
  isLaid = true;
  for (const begin of begins) begin();
  return {
    show: (view) => api.getPanel(view)?.api.setActive(),
    dispose: () => api.dispose(),
  };
}
