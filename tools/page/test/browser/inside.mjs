// Looks into what runs from its page in Chromium: variables as plots, the chip, its program and board; says as JSON what came of it.
// Usage: node inside.mjs CHROMIUM ADDRESS; with P2OS_SHOTS screenshots are put into that folder.
import { axe, complaints, drawnSeldom, launched } from "./opened.mjs";

const [executablePath, url] = process.argv.slice(2);
const browser = await launched(executablePath);
const found = { errors: [], complaints: [] }, LONG = { timeout: 30_000 };
const page = await (await drawnSeldom(browser, { bypassCSP: true })).newPage();
page.setDefaultTimeout(30_000);
page.on("console", (message) => { if (message.type() === "error") found.errors.push(message.text()); });
page.on("pageerror", (error) => found.errors.push(error.message));
await page.goto(url);
await page.waitForFunction(() => window.p2osPage?.app.store.run.value?.head_ns > 1e8, undefined, LONG);
const tab = (name) => page.getByRole("tab", { name, exact: true }).click();

// A variable by a part of its name, out of what is offered.
await tab("Plots");
const input = page.getByRole("combobox", { name: "A variable of the program" });
await input.fill("stat");
await page.waitForFunction(() => window.p2osPage.app.store.offered.value.some((name) => name === "main::dodge.state") && window.p2osPage.app.store.offered.value[0] !== "head", undefined, LONG);
found.offered = await page.locator("#variables option").evaluateAll((all) => all.map((one) => one.value));
for (const name of ["ticks", "no_such", "head"]) {
  await input.fill(name);
  await input.press("Enter");
  if (name === "no_such") {
    await page.waitForFunction(() => window.p2osPage.app.store.run.value.trouble !== "", undefined, LONG);
    found.trouble = await page.locator(".run-why[role=alert]").textContent();
    await page.getByRole("button", { name: "Let the run go on from here" }).click();
  }
}
await page.waitForFunction(() => {
  const { store } = window.p2osPage.app, ticks = store.channels("samples").find(({ name }) => name === "ticks");
  return ticks && (store.whole(ticks.id)?.count ?? 0) > 5;
}, undefined, LONG);
await page.getByRole("region", { name: "head, without unit" }).waitFor(); // it was asked for last
found.plots = await page.getByRole("region").evaluateAll((all) => all.map((one) => one.getAttribute("aria-label")));
await page.getByRole("button", { name: "Do not watch head" }).click();
await page.waitForFunction(() => window.p2osPage.app.store.run.value.variables.length === 1, undefined, LONG);

// The chip: registers of a peripheral by the manual's names, and at a halt where the program is.
await page.getByRole("button", { name: "Pause the run" }).click();
await page.waitForFunction(() => !window.p2osPage.app.store.run.value.is_running, undefined, LONG);
await tab("Chip");
await page.locator(".view-panel-chip .section, .view-panel-chip table").first().waitFor();
found.clocks = await page.locator(".view-panel-chip tbody tr").first().textContent();
await page.getByRole("combobox", { name: "Chip: what is looked at" }).selectOption("USART1");
await page.waitForFunction(() => document.querySelector(".view-panel-chip h2")?.textContent === "USART1", undefined, LONG);
found.registers = await page.locator(".view-panel-chip tbody tr").allTextContents();
await tab("Program");
await page.locator(".view-panel-program .source .next").waitFor();
found.program = await page.locator(".view-panel-program").textContent();
await page.getByRole("combobox", { name: "Program: what is looked at" }).selectOption("what has run");
await page.locator(".view-panel-program table").waitFor();
found.shares = await page.locator(".view-panel-program tbody tr").allTextContents();
found.lines = await page.locator(".view-panel-program .source li").evaluateAll((all) => ["ran", "not", "part"].map((kind) => all.filter((one) => one.classList.contains(kind)).length));
await tab("Board");
found.board = await page.locator(".view-panel-board svg").getAttribute("aria-label");
found.at = await page.evaluate(() => [...window.p2osPage.app.store.panels.value.values()].map(({ at_ns }) => at_ns));

await page.addScriptTag({ content: axe });
for (const [width, colorScheme, names] of [[1400, "light", ["Chip", "Plots"]], [1400, "dark", ["Board", "Program"]], [420, "light", ["Plots", "Chip", "Program", "Board"]], [420, "dark", ["Board", "Plots"]]]) {
  await page.setViewportSize({ width, height: 900 });
  await page.emulateMedia({ colorScheme });
  for (const name of names) {
    await tab(name);
    await page.waitForTimeout(400);
    found.complaints.push(...await complaints(page, `${width} ${colorScheme} ${name}`));
    if (process.env.P2OS_SHOTS) await page.screenshot({ path: `${process.env.P2OS_SHOTS}/inside-${name}-${width}-${colorScheme}.png` });
  }
}
await page.setViewportSize({ width: 1400, height: 900 });
await page.getByRole("combobox", { name: "Speed of the run" }).selectOption("fastest");
await page.getByRole("button", { name: "Let the run go on from here" }).click().catch(() => undefined);
console.log(JSON.stringify(found));
await browser.close();
