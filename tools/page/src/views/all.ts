// Every view of the page, in the order of keys and tabs.
import type { Store } from "../data/store";
import type { ViewKind } from "../shell/app";
import { hands } from "../hands/view";
import { consoles } from "./lists/consoles";
import { events } from "./lists/events";
import { goals } from "./lists/goals";
import { packets } from "./lists/packets";
import { logic } from "./logic/view";
import { panelView } from "./panel";
import { plan } from "./plan/view";
import { plots } from "./plots/view";
import { report } from "./report/view";
import { scene } from "./scene/view";
import { states } from "./states";

const VIEWS: readonly ViewKind[] = [plan, report, logic, plots, packets, consoles, events, goals, states, scene, hands];

/** The views that a run has, with the panels of what runs. */
export function viewsOf(store: Store): ViewKind[] {
  return [...VIEWS.filter((view) => view.has(store)), ...store.header.value.panels.map(panelView)];
}
