// Opens a page in Chromium as a person would, and says as JSON what came of it. Usage: node browser.mjs CHROMIUM FILE-OR-URL
import { axe, COLOURS, complaints, launched, SCENES } from "./opened.mjs";

const [executablePath, url] = process.argv.slice(2);
const browser = await launched(executablePath, SCENES);
const found = { errors: [], dialogs: [], requests: [], complaints: [] };

async function open(fragment, options = {}) {
  const context = await browser.newContext({ viewport: { width: 1400, height: 900 }, ...options }), page = await context.newPage();
  page.on("console", (message) => { if ((message.type() === "error" || message.type() === "warning") && !message.text().includes("GL Driver Message")) found.errors.push(`${fragment}: ${message.text()}`); });
  page.on("pageerror", (error) => found.errors.push(`${fragment}: ${error.message}`));
  page.on("dialog", (dialog) => { found.dialogs.push(dialog.message()); void dialog.dismiss(); });
  page.on("request", (request) => { if (!request.url().startsWith("data:") && request.url().split("#")[0] !== url) found.requests.push(request.url()); });
  await page.goto(`${url}#${fragment}`);
  await page.waitForFunction(() => window.p2osPage?.app.store.version.value > 0);
  return page;
}

const state = (page) => page.evaluate(() => {
  const { clock, wire, selection } = window.p2osPage.app;
  return { now: clock.now.value, from: clock.from.value, to: clock.to.value, a: clock.a.value, b: clock.b.value, playing: clock.playing.value, rate: clock.rate.value, wire: wire.value, selection: selection.value, ran: window.ran ?? 0 };
});

// First paint, and the page as it opens.
const page = await open("layout=student&t=1000000000");
found.firstPaintMs = await page.evaluate(() => performance.getEntriesByName("first-contentful-paint")[0]?.startTime ?? -1);
found.title = await page.locator("h1").textContent();
found.tabs = await page.getByRole("tab").allTextContents();
found.landmarks = await page.evaluate(() => [...document.querySelectorAll("header.head, main, section.timeline")].map((one) => one.tagName.toLowerCase()));
found.opened = await state(page);

// Keys, with nothing focused.
const keys = {};
for (const key of ["ArrowRight", "Shift+ArrowLeft", "End", "Home", "+", "a", "End", "b", "]", "[", ">", "0", "."]) {
  await page.keyboard.press(key);
  await page.waitForTimeout(30);
  keys[`${Object.keys(keys).length} ${key}`] = await state(page);
}
await page.keyboard.press("Home");
await page.keyboard.press(" ");
await page.waitForTimeout(200);
keys.play = await state(page);
await page.keyboard.press(" ");
keys.pause = await state(page);
found.keys = keys;

// Tab reaches what can be used, and the first of it can be seen to be focused.
found.reached = [];
for (let n = 0; n < 14; n++) {
  await page.keyboard.press("Tab");
  found.reached.push(await page.evaluate(() => { const at = document.activeElement; return `${at.getAttribute("role") ?? at.tagName.toLowerCase()} ${at.getAttribute("aria-label") ?? at.textContent.slice(0, 20)}`; }));
}

// A packet is chosen by keys and explained; a filter leaves what holds its words.
await page.getByRole("tab", { name: "Packets" }).click();
const list = page.getByRole("listbox", { name: "Packets" });
await list.focus();
await page.keyboard.press("Home");
found.explained = await page.locator(".explanation .fields tbody tr").count();
found.explanation = await page.locator(".explanation").textContent();
await page.getByRole("searchbox", { name: /Filter packets/ }).fill("nothing has this");
await page.waitForTimeout(100);
found.filtered = await list.getByRole("option").count();
await page.getByRole("searchbox", { name: /Filter packets/ }).fill("");

// Every view, so that every text of the run is shown once; 3D too.
for (const tab of found.tabs) await page.getByRole("tab", { name: tab, exact: true }).click();
await page.getByRole("tab", { name: "3D" }).click();
await page.waitForFunction(() => document.querySelector(".view-scene canvas") !== null, undefined, { timeout: 20000 }).catch(() => found.errors.push(`3D: no canvas`));
// The line that says why leads to the moment that it names.
await page.locator(".why").getByRole("button", { name: "at 0.250 s" }).click();
found.cause = (await state(page)).now;

// Which lines have run by the page's time, before and after the second one has.
found.lines = [];
await page.getByRole("tab", { name: "Program", exact: true }).click();
for (const at of [999_999_999, 1_000_000_000]) {
  await page.evaluate((t) => window.p2osPage.app.clock.seek(t), at);
  await page.waitForTimeout(50);
  found.lines.push(await page.locator(".view-panel-program li").evaluateAll((all) => all.map((one) => one.className).join(" ")));
}

found.help = await (async () => {
  await page.getByRole("button", { name: "Keys and views" }).click();
  const text = await page.getByRole("dialog").textContent();
  await page.keyboard.press("Escape");
  return text;
})();
found.shown = await page.locator("body").evaluate((body) => body.innerText);
found.elements = await page.evaluate(() => [...document.querySelectorAll("img, iframe, object, embed, b[onmouseover], [onerror], [onload]")].map((one) => one.outerHTML.slice(0, 120)));

// The link brings it back.
await page.evaluate(() => { const { clock } = window.p2osPage.app; clock.look(2e8, 9e8); clock.seek(5e8); clock.setCursor("a", 3e8); });
await page.waitForTimeout(700);
found.fragment = await page.evaluate(() => location.hash.slice(1));
found.linked = await state(await open(found.fragment));
found.ran = (await state(page)).ran;
await page.context().close();

// A time and a wire are pointed at: a click near an edge goes to it.
const wires = await open("layout=firmware");
const canvas = wires.getByRole("img", { name: /^Logic analyser/ }), box = await canvas.boundingBox();
await wires.mouse.click(box.x + 150 + (box.width - 158) / 2 + 3, box.y + 32);
found.clicked = await state(wires);
await wires.mouse.move(box.x + 400, box.y + 32);
await wires.mouse.wheel(0, -400);
await wires.waitForTimeout(100);
found.zoomed = await state(wires);
await wires.context().close();

// Accessibility, wide and narrow, light and dark; of a page that was looked at, only the view that another tab shows.
const looked = await open("layout=student", { bypassCSP: true });
await looked.evaluate(axe);
async function complain(where, more) {
  await looked.waitForTimeout(150);
  found.complaints.push(...await complaints(looked, where, more));
}
await complain("1400 light student");
await looked.emulateMedia({ colorScheme: "dark" });
await looked.getByRole("combobox", { name: "Layout" }).selectOption("firmware");
await complain("1400 dark firmware");
await looked.setViewportSize({ width: 420, height: 900 });
for (const colorScheme of ["light", "dark"]) {
  await looked.emulateMedia({ colorScheme });
  for (const [number, tab] of (await looked.getByRole("tab").all()).entries()) {
    await tab.click();
    await complain(`420 ${colorScheme} ${await tab.textContent()}`, { part: number ? "#tab-panel" : "html", rules: colorScheme === "dark" ? COLOURS : {} });
  }
}
await browser.close();
console.log(JSON.stringify(found));
