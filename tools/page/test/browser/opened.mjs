// By what the scripts beside it open Chromium and look at a page.
import { chromium } from "playwright-core";
import { readFileSync } from "node:fs";
import { createRequire } from "node:module";

const FLAGS = ["--no-sandbox", "--disable-gpu", "--disable-quic", "--no-first-run", "--disable-background-networking"];
/** For WebGL without a graphics card. */
export const SCENES = "--enable-unsafe-swiftshader";
export const axe = readFileSync(createRequire(import.meta.url).resolve("axe-core/axe.min.js"), "utf8");

export const launched = (executablePath, ...more) => chromium.launch({ executablePath, args: [...FLAGS, ...more] });

/** Returns a context whose pages draw ten times a second: what a run that goes on has them draw is most of what Chromium does. */
export async function drawnSeldom(browser, options = {}) {
  const context = await browser.newContext({ viewport: { width: 1400, height: 900 }, ...options });
  await context.addInitScript(() => {
    window.requestAnimationFrame = (draw) => setTimeout(() => draw(performance.now()), 100);
    window.cancelAnimationFrame = clearTimeout;
  });
  return context;
}

/** The rules of axe that a colour scheme decides: enough for what was judged by all rules in the other one. */
export const COLOURS = { runOnly: ["color-contrast", "link-in-text-block"] };

/** What axe says of a part of a page into which it was put, and whether the page is wider than the screen. */
export async function complaints(page, where, { part = "html", rules = {} } = {}) {
  const violations = await page.evaluate(async ([within, more]) => (await globalThis.axe.run(within, { resultTypes: ["violations"], ...more })).violations.map((one) => `${one.id}: ${one.nodes[0].html.slice(0, 160)}`), [part, rules]);
  const found = violations.map((one) => `${where}: ${one}`);
  return await page.evaluate(() => document.documentElement.scrollWidth > innerWidth) ? [...found, `${where}: wider than the screen`] : found;
}
