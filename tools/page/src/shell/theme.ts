// The colours of canvases: those of the style sheet, read again when the scheme changes.
import { computed, signal } from "@preact/signals";
import { reads } from "../time/reads";

const NAMES = [
  "paper", "panel", "ink", "faint", "line", "left", "right", "wall", "box", "floor", "path", "good", "bad", "warn", "sonar", "near", "decoded", "cursor-a", "cursor-b",
] as const;
export type ColourName = (typeof NAMES)[number];
export type Theme = Readonly<Record<ColourName, string>> & { readonly isDark: boolean };

const isDark = typeof matchMedia === "function" ? matchMedia("(prefers-color-scheme: dark)") : undefined;
const turns = signal(0);
isDark?.addEventListener("change", () => turns.value++);

export const theme = computed<Theme>(() => {
  reads(turns.value);
  const style = getComputedStyle(document.documentElement);
  const colours = Object.fromEntries(NAMES.map((name) => [name, style.getPropertyValue(`--${name}`).trim()]));
  return { ...(colours as Record<ColourName, string>), isDark: isDark?.matches ?? false };
});

/** Colours of curves, robots and channels, told apart also by who sees few of them (after Okabe and Ito). */
const LIGHT = ["#1b6ca8", "#c8553d", "#00806a", "#8a5fb0", "#a36a00", "#b0478a", "#4a5560", "#2f8fb5"];
const DARK = ["#6fb3e0", "#ec8d76", "#4fc3a6", "#c3a0e8", "#e0b04c", "#ec94c4", "#aab4bb", "#8fd3ee"];
export function curveColour(place: number): string {
  const colours = theme.value.isDark ? DARK : LIGHT;
  return colours[place % colours.length]!;
}

/** A colour of a scale from 0 to 1, dark blue to yellow in even steps of lightness (after viridis). */
const SCALE_LIGHT = [[68, 1, 84], [65, 68, 135], [42, 120, 142], [28, 148, 116], [92, 158, 38], [176, 132, 8]] as const; // seen on white too
const SCALE_DARK = [[150, 110, 230], [95, 130, 220], [60, 165, 200], [60, 195, 150], [140, 215, 95], [253, 231, 60]] as const;
export function scaleColour(share: number): string {
  const colours = theme.value.isDark ? SCALE_DARK : SCALE_LIGHT;
  const at = Math.min(1, Math.max(0, share)) * (colours.length - 1), low = Math.min(colours.length - 2, Math.floor(at)), part = at - low;
  const [r, g, b] = [0, 1, 2].map((n) => Math.round(colours[low]![n]! + part * (colours[low + 1]![n]! - colours[low]![n]!)));
  return `rgb(${r}, ${g}, ${b})`;
}
