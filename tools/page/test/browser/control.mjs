// Controls a run from its page in Chromium, and says as JSON what came of it. Usage: node control.mjs CHROMIUM ADDRESS ADDRESS-TO-LOOK-ON
import { axe, COLOURS, complaints, drawnSeldom, launched } from "./opened.mjs";

const [executablePath, url, watchUrl] = process.argv.slice(2);
const browser = await launched(executablePath);
const found = { errors: [], complaints: [] }, LONG = { timeout: 30_000 };

async function open(address, options = {}) {
  const page = await (await drawnSeldom(browser, { bypassCSP: true, ...options })).newPage();
  page.setDefaultTimeout(60_000);
  page.on("console", (message) => { if (message.type() === "error") found.errors.push(message.text()); });
  page.on("pageerror", (error) => found.errors.push(error.message));
  await page.goto(address);
  await page.waitForFunction(() => (window.p2osPage?.app.store.run.value && window.p2osPage.app.store.version.value > 0), undefined, LONG);
  return page;
}

const run = (page) => page.evaluate(() => ({ ...window.p2osPage.app.store.run.value, now: window.p2osPage.app.clock.now.value, sources: window.p2osPage.app.store.shown.value?.sources }));
/** Does something, and waits until the run has taken so many commands and stands still, or goes on. */
async function after(page, act, { commands = 1, running = false } = {}) {
  const wanted = (await run(page)).done + commands;
  await act();
  await page.waitForFunction(([done, goes]) => {
    const state = window.p2osPage.app.store.run.value;
    return state.done >= done && state.is_running === goes;
  }, [wanted, running], LONG).catch(async () => { throw new Error(`${act}: not command ${wanted}: ${JSON.stringify(await run(page))}`); });
  return run(page);
}
const press = (page, name) => page.getByRole("button", { name }).click();

const page = await open(url);
await page.waitForFunction(() => window.p2osPage.app.store.run.value.head_ns > 5e8, undefined, LONG);

// Still, and a step back over an edge and on again.
found.paused = await after(page, () => press(page, "Pause the run"));
await page.getByRole("combobox", { name: "A step goes by one" }).selectOption("edge");
found.back = await after(page, () => press(page, "Back by one edge"));
found.backAgain = await after(page, () => press(page, "Back by one edge"));
found.on = await after(page, () => press(page, "On by one edge"));

// Elsewhere on the bar, and a step from there.
await page.getByRole("slider", { name: "Time of the run" }).fill("4567");
found.scrubbed = await run(page);
await page.getByRole("combobox", { name: "A step goes by one" }).selectOption("millisecond");
await page.locator("h1").click();
found.stepped = await after(page, () => page.keyboard.press("s"));
found.steppedBack = await after(page, () => page.keyboard.press("Shift+S"));

// A pin and a source line to halt at, by keys alone.
await page.getByRole("button", { name: /^Halts/ }).focus();
await page.keyboard.press("Enter");
await page.waitForFunction(() => document.activeElement?.matches(".bar-panel input"));
for (const [key, words] of [["pin", "pin p2dx_con high"], ["none", "line nothing.c:1"]]) {
  await page.keyboard.type(words);
  found[`${key}Added`] = await after(page, () => page.keyboard.press("Enter"));
}
found.alert = await page.locator(".run-why[role=alert]").textContent();
await page.keyboard.press("Escape");
found.focused = await page.evaluate(() => document.activeElement?.textContent);
await page.getByRole("button", { name: "To where the run stands" }).click();
await page.evaluate(() => window.p2osPage.app.clock.seek(0));
await after(page, () => page.getByRole("combobox", { name: "Speed of the run" }).selectOption("fastest"));
found.atPin = await after(page, () => press(page, "Let the run go on from here"));
await page.getByRole("combobox", { name: "A step goes by one" }).selectOption("line");
const line = await after(page, () => press(page, "On by one source line"));
const place = line.place.split(" ")[0];
await press(page, /^Halts/);
await page.getByRole("combobox", { name: "A place to halt at" }).fill(`line ${place}`);
await after(page, () => press(page, "Add"));
await after(page, () => press(page, "Do not halt at pin p2dx_con high"));
await page.keyboard.press("Escape");
found.line = place;
found.atLine = await after(page, () => press(page, "Let the run go on from here"));
await press(page, /^Halts/);
await after(page, () => press(page, `Do not halt at line ${place}`));
await press(page, /^Futures/);

// A fork where one looks, something done there; both on, and where they part.
await page.getByRole("combobox", { name: "What is done where the fork begins" }).fill("fault link-down");
const begun = Date.now();
found.forked = await after(page, () => press(page, "Fork here"));
found.forkMs = Date.now() - begun;
await page.getByRole("combobox", { name: "A step goes by one" }).selectOption("event");
found.onFork = await after(page, () => press(page, "On by one event"));
found.compared = await after(page, () => page.getByRole("button", { name: "Compare" }).click());
found.parting = await page.locator(".parting").first().textContent();
found.rows = await page.evaluate(() => window.p2osPage.app.store.channels("pose").map((channel) => channel.source));
await page.addScriptTag({ content: axe });
for (const [width, colorScheme] of [[1400, "light"], [1400, "dark"], [420, "light"], [420, "dark"]]) {
  await page.setViewportSize({ width, height: 900 });
  await page.emulateMedia({ colorScheme });
  await page.waitForTimeout(250);
  found.complaints.push(...await complaints(page, `${width} ${colorScheme}`, { rules: colorScheme === "dark" ? COLOURS : {} }));
  if (process.env.P2OS_SHOTS) await page.screenshot({ path: `${process.env.P2OS_SHOTS}/control-${width}-${colorScheme}.png` });
}
await page.setViewportSize({ width: 1400, height: 900 });
found.chosen = await after(page, () => page.getByRole("button", { name: "run", exact: true }).click());

// Who looks on sees the same and has nothing to press.
const watcher = await open(watchUrl);
found.watched = await watcher.getByRole("status").allTextContents();
found.watcherButtons = await watcher.getByRole("region", { name: "Time" }).getByRole("button").allTextContents();
found.watcherNames = await watcher.getByRole("region", { name: "Time" }).getByRole("button").evaluateAll((all) => all.map((one) => one.getAttribute("aria-label")));
await watcher.evaluate(() => window.p2osPage.app.store.command({ do: "run" }));
await watcher.waitForFunction(() => window.p2osPage.app.store.trouble.value !== "", undefined, LONG);
found.refused = await watcher.evaluate(() => window.p2osPage.app.store.trouble.value);
found.after = await run(page);

// On to the end, at which the command ends.
await after(page, () => press(page, "Let the run go on from here"), { running: true }).catch(() => undefined);
console.log(JSON.stringify(found));
await browser.close();
