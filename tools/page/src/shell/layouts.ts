// The layouts: which views stand where, for whom.

/** Views in one place, as tabs; the first one in front. */
export interface Group {
  readonly share: number;
  readonly views: readonly string[];
}

/** Groups above one another. */
export interface Column {
  readonly share: number;
  readonly groups: readonly Group[];
}

export interface Layout {
  readonly id: string;
  readonly title: string;
  readonly columns: readonly Column[];
}

export const LAYOUTS: readonly Layout[] = [
  {
    id: "student", title: "Student",
    columns: [
      { share: 0.58, groups: [{ share: 0.62, views: ["plan", "scene"] }, { share: 0.38, views: ["plots", "logic"] }] },
      { share: 0.42, groups: [{ share: 0.6, views: ["report", "hands", "goals", "states"] }, { share: 0.4, views: ["events", "consoles", "packets"] }] },
    ],
  },
  {
    id: "firmware", title: "Firmware engineer",
    columns: [
      { share: 0.64, groups: [{ share: 0.62, views: ["logic"] }, { share: 0.38, views: ["plots", "packets"] }] },
      { share: 0.36, groups: [{ share: 0.4, views: ["plan", "scene"] }, { share: 0.3, views: ["consoles", "events"] }, { share: 0.3, views: ["states", "goals", "hands", "report"] }] },
    ],
  },
  {
    id: "lab", title: "Robot lab",
    columns: [
      { share: 0.6, groups: [{ share: 0.6, views: ["scene"] }, { share: 0.4, views: ["packets", "consoles"] }] },
      { share: 0.4, groups: [{ share: 0.4, views: ["plan"] }, { share: 0.3, views: ["plots", "logic"] }, { share: 0.3, views: ["hands", "events", "states", "goals", "report"] }] },
    ],
  },
];

/**
 * The columns with the views that a run has; groups and columns that are empty then are none, the others share their room.
 *
 * Views that no layout names, those of panels, stand in its last column's first place, behind what is there.
 */
export function pruned(layout: Layout, views: readonly string[]): readonly Column[] {
  const named = layout.columns.flatMap((column) => column.groups.flatMap((group) => group.views)), others = views.filter((view) => !named.includes(view)), last = layout.columns.at(-1)?.groups[0];
  const there = (group: Group) => [...group.views.filter((view) => views.includes(view)), ...(group === last ? others : [])];
  const columns = layout.columns.map((column) => ({ ...column, groups: shared(column.groups.map((group) => ({ ...group, views: there(group) })).filter((group) => group.views.length)) }));
  return shared(columns.filter((column) => column.groups.length));
}

function shared<T extends { readonly share: number }>(parts: readonly T[]): readonly T[] {
  const sum = parts.reduce((total, part) => total + part.share, 0);
  return parts.map((part) => ({ ...part, share: part.share / sum }));
}
