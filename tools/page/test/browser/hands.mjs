// Puts hands to a run from its page in Chromium, and says as JSON what came of it. Usage: node hands.mjs CHROMIUM ADDRESS; a line on stdin: another page may drive.
import { axe, COLOURS, complaints, drawnSeldom, launched } from "./opened.mjs";

const [executablePath, url] = process.argv.slice(2);
const browser = await launched(executablePath);
const found = { errors: [], complaints: [] }, LONG = { timeout: 40_000 };

async function open() {
  const page = await (await drawnSeldom(browser, { bypassCSP: true })).newPage();
  page.setDefaultTimeout(40_000);
  await page.addInitScript(() => { navigator.getGamepads = () => [window.pad ?? null]; });
  page.on("console", (message) => { if (message.type() === "error") found.errors.push(message.text()); });
  page.on("pageerror", (error) => found.errors.push(error.message));
  await page.goto(url);
  await page.waitForFunction(() => (window.p2osPage?.app.store.run.value && window.p2osPage.app.store.version.value > 0), undefined, LONG);
  return page;
}

const run = (page) => page.evaluate(() => ({ ...window.p2osPage.app.store.run.value }));
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
const press = (page, name, more = {}) => page.getByRole("button", { name, ...more }).click();
const last = (page, words) => page.waitForFunction((begin) => window.p2osPage.app.store.run.value.hands.at(-1)?.words.startsWith(begin), words, LONG);

const page = await open();
await page.getByRole("tab", { name: "Hands" }).click();
await after(page, () => press(page, "Pause the run"));

// A thing is dragged into the way.
await page.getByRole("combobox", { name: "What dragging in the plan does" }).selectOption("move");
const plan = page.getByRole("img", { name: "Plan of the world with the robot and its path" }), box = await plan.boundingBox();
const extent = await page.evaluate(() => window.p2osPage.app.store.header.value.world.extent_m);
const scale = Math.min((box.width - 52) / (extent[2] - extent[0]), (box.height - 52) / (extent[3] - extent[1]));
const at = (x, y) => [box.x + box.width / 2 + (x - (extent[0] + extent[2]) / 2) * scale, box.y + box.height / 2 - (y - (extent[1] + extent[3]) / 2) * scale];
async function drag(from, to) {
  await page.mouse.move(...at(...from));
  await page.mouse.down();
  await page.mouse.move(...at((from[0] + to[0]) / 2, (from[1] + to[1]) / 2));
  await page.mouse.move(...at(...to));
  await page.mouse.up();
}
found.dragged = await after(page, () => drag([1.6, -1.3], [1.0, 0]));
await page.getByRole("combobox", { name: "What dragging in the plan does" }).selectOption("wall");
found.drawn = await after(page, () => drag([0.5, -2.4], [1.5, -2.4]));
await after(page, () => page.getByRole("combobox", { name: "Speed of the run" }).selectOption("fastest"));
found.over = await after(page, () => press(page, "Let the run go on from here"));
found.saved = (await after(page, () => press(page, "Save as test"))).saved;

// Another future, from before that: a fault from the panel, and nothing in the way.
await page.getByRole("tab", { name: "Hands" }).click(); // the report has come to the front
await page.evaluate(() => window.p2osPage.app.clock.seek(1e7));
await page.getByRole("combobox", { name: "Fault", exact: true }).selectOption("sonar-dead");
found.fault = await after(page, () => press(page, "Inject"));
found.faultOver = await after(page, () => press(page, "Let the run go on from here"));
found.savedFork = (await after(page, () => press(page, "Save as test"))).saved;

// Driven by keys: it stands when the page loses focus, and the key has to be pressed anew.
await page.evaluate(() => window.p2osPage.app.clock.seek(1e9));
await after(page, () => page.getByRole("combobox", { name: "Speed of the run" }).selectOption("0.25")); // so that it is not over before
await after(page, () => press(page, "Let the run go on from here"), { running: true });
found.taken = await after(page, () => press(page, "Drive by hand"), { running: true });
await page.keyboard.down("w");
await last(page, "drive 0.500");
await page.evaluate(() => window.dispatchEvent(new Event("blur")));
await last(page, "drive 0.000");
found.afterBlur = await run(page);
await page.keyboard.up("w");
await page.keyboard.down("a");
await last(page, "drive 0.000 90.0");
await page.keyboard.up("a");
await last(page, "drive 0.000 0.0");

// By the stick, and by a pad that goes away.
const stick = await page.getByRole("application").boundingBox();
await page.mouse.move(stick.x + stick.width / 2, stick.y + stick.height / 2);
await page.mouse.down();
await page.mouse.move(stick.x + stick.width / 2, stick.y);
await last(page, "drive 0.500");
await page.mouse.up();
await last(page, "drive 0.000 0.0");
const buttons = Array.from({ length: 17 }, () => ({ value: 0, pressed: false }));
await page.evaluate((all) => { window.pad = { axes: [0, 0, 0, 0], buttons: all }; }, buttons);
await page.waitForTimeout(250);
await page.evaluate(() => { window.pad.buttons[7] = { value: 0.5, pressed: true }; });
await last(page, "drive 0.250");
await page.evaluate(() => { window.pad = null; });
await last(page, "drive 0.000 0.0");

// A page that is closed while it drives.
const other = await open();
await other.getByRole("tab", { name: "Hands" }).click();
await other.getByRole("button", { name: "Drive by hand" }).click();
await other.keyboard.down("s");
await last(page, "drive -0.500");
await other.close();
await last(page, "drive 0.000 0.0");
await press(page, "Let go of the wheels");
await last(page, "let go wheels");
found.letGo = await after(page, () => press(page, "Pause the run"));

await page.addScriptTag({ content: axe });
for (const [width, colorScheme] of [[1400, "light"], [1400, "dark"], [420, "light"], [420, "dark"]]) {
  await page.setViewportSize({ width, height: 900 });
  await page.emulateMedia({ colorScheme });
  await page.getByRole("tab", { name: "Hands" }).click();
  await page.waitForTimeout(250);
  found.complaints.push(...await complaints(page, `${width} ${colorScheme}`, { rules: colorScheme === "dark" ? COLOURS : {} }));
  if (process.env.P2OS_SHOTS) await page.screenshot({ path: `${process.env.P2OS_SHOTS}/hands-${width}-${colorScheme}.png` });
}
console.log(JSON.stringify(found));
await browser.close();
