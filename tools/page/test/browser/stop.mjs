// Looks at the page of a robot that a terminal drives, and presses STOP and Escape there; says as JSON what came of it.
// Usage: node stop.mjs CHROMIUM ADDRESS LOOKING-ON [FOLDER]; with a folder, screenshots are put there.
import { drawnSeldom, launched } from "./opened.mjs";

const [executablePath, url, watch, folder] = process.argv.slice(2), found = { errors: [], names: {} };
const browser = await launched(executablePath);

async function open(link, width) {
  const page = await (await drawnSeldom(browser, { viewport: { width, height: 900 } })).newPage();
  page.setDefaultTimeout(40_000);
  page.on("console", (message) => { if (message.type() === "error") found.errors.push(message.text()); });
  page.on("pageerror", (error) => found.errors.push(error.message));
  await page.goto(link);
  await page.waitForFunction(() => window.p2osPage?.app.store.run.value);
  return page;
}

const state = (page) => page.evaluate(() => ({ ...window.p2osPage.app.store.run.value }));
const stop = (page) => page.getByRole("button", { name: "STOP", exact: true }).last(); // that of the bar
/** Whether the whole button can be seen, whatever view is looked at. */
const isInSight = async (page) => {
  const box = await stop(page).boundingBox(), { width, height } = page.viewportSize();
  return box !== null && box.x >= 0 && box.y >= 0 && box.x + box.width <= width && box.y + box.height <= height;
};
async function after(page, act) {
  const { done } = await state(page);
  await act();
  await page.waitForFunction((before) => window.p2osPage.app.store.run.value.done > before, done);
  await page.waitForFunction(() => window.p2osPage.app.store.run.value.why.startsWith("stopped"));
  return (await state(page)).why;
}

for (const width of [1400, 420]) {
  const page = await open(url, width);
  found.names[width] = await isInSight(page);
  if (folder) await page.screenshot({ path: `${folder}/stop-${width}.png` });
  if (width === 1400) {
    found.clicked = await after(page, () => stop(page).click());
    found.escaped = await after(page, () => page.keyboard.press("Escape"));
    found.drives = await page.getByRole("button", { name: "Drive by hand" }).count();
  }
  await page.context().close();
}
const watcher = await open(watch, 1400);
found.watcher = await watcher.getByRole("button", { name: "STOP", exact: true }).count();
await browser.close();
console.log(JSON.stringify(found));
