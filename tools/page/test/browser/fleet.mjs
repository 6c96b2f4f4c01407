// Looks at robots of one world while they run, in Chromium: all of them in the plan, one whose pins and program are shown; says as JSON what came of it.
// Usage: node fleet.mjs CHROMIUM ADDRESS; with P2OS_SHOTS screenshots are put into that folder.
import { axe, complaints, drawnSeldom, launched, SCENES } from "./opened.mjs";

const [executablePath, url] = process.argv.slice(2);
const browser = await launched(executablePath, SCENES);
const found = { errors: [], complaints: [] }, LONG = { timeout: 30_000 };
const page = await (await drawnSeldom(browser, { bypassCSP: true })).newPage();
page.setDefaultTimeout(30_000);
page.on("console", (message) => { if (message.type() === "error") found.errors.push(message.text()); });
page.on("pageerror", (error) => found.errors.push(error.message));
await page.goto(url);
await page.waitForFunction(() => window.p2osPage?.app.store.run.value?.head_ns > 1e8, undefined, LONG);
const channels = (kind) => page.evaluate((kind) => [...new Set(window.p2osPage.app.store.channels(kind).map(({ source }) => source))], kind);
found.poses = await channels("pose");
found.all = await channels("levels");
await page.getByRole("combobox", { name: "Robot whose pins, packets and plots are shown" }).selectOption("east");
found.chosen = await channels("levels");
found.posesThen = await channels("pose");

await page.getByRole("button", { name: "Pause the run" }).click();
await page.waitForFunction(() => !window.p2osPage.app.store.run.value.is_running, undefined, LONG);
const head = () => page.evaluate(() => window.p2osPage.app.store.run.value.head_ns);
const before = await head();
await page.getByRole("button", { name: "On by one millisecond" }).click();
await page.waitForFunction((head) => window.p2osPage.app.store.run.value.head_ns > head, before, LONG);
found.step = (await head()) - before;
found.back = await page.getByRole("button", { name: /^Back by/ }).count() + await page.getByRole("button", { name: /^Futures/ }).count();
await page.getByRole("tab", { name: "Hands" }).click();
const done = await page.evaluate(() => window.p2osPage.app.store.run.value.done);
await page.getByRole("combobox", { name: "Robot that hands are on" }).selectOption("west");
await page.getByRole("button", { name: "Press" }).click();
await page.waitForFunction((done) => window.p2osPage.app.store.run.value.done > done, done, LONG);
found.hands = await page.evaluate(() => window.p2osPage.app.store.run.value.hands.map((one) => one.words));
await page.getByRole("tab", { name: "Program", exact: true }).click();
await page.getByRole("combobox", { name: "Program: what is looked at" }).selectOption("east: what has run");
await page.locator(".view-panel-program table").waitFor();
found.shares = await page.locator(".view-panel-program tbody tr").count();

await page.addScriptTag({ content: axe });
for (const [width, colorScheme, tab] of [[1400, "light", "Program"], [1400, "dark", "Logic analyser"], [420, "light", "Plan"], [420, "dark", "Program"]]) {
  await page.setViewportSize({ width, height: 900 });
  await page.emulateMedia({ colorScheme });
  await page.getByRole("tab", { name: tab, exact: true }).click();
  await page.waitForTimeout(400);
  found.complaints.push(...await complaints(page, `${width} ${colorScheme} ${tab}`));
  if (process.env.P2OS_SHOTS) await page.screenshot({ path: `${process.env.P2OS_SHOTS}/fleet-${tab}-${width}-${colorScheme}.png` });
}
await page.setViewportSize({ width: 1400, height: 900 });
await page.getByRole("combobox", { name: "Speed of the run" }).selectOption("fastest");
await page.getByRole("button", { name: "Let the run go on from here" }).click();
console.log(JSON.stringify(found));
await browser.close();
