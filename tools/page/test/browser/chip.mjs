// Opens the page of `p2os mcu page` in Chromium as a person would, and says as JSON what came of it.
// Usage: node chip.mjs CHROMIUM URL JSON [FOLDER], where the JSON has `programs`: rows of name, file, ns, and inputs
// [ns, pin, level]. With a folder, screenshots are put there.
import { axe, COLOURS, complaints, launched } from "./opened.mjs";
import { readFileSync } from "node:fs";

const [executablePath, url, asked, folder] = process.argv.slice(2), { programs } = JSON.parse(readFileSync(asked, "utf8"));
const browser = await launched(executablePath);
const found = { errors: [], requests: [], complaints: [], runs: {} };

async function open(options = {}) {
  const context = await browser.newContext({ viewport: { width: 1400, height: 900 }, ...options }), page = await context.newPage();
  page.on("console", (message) => { if (["error", "warning"].includes(message.type())) found.errors.push(message.text()); });
  page.on("pageerror", (error) => found.errors.push(error.message));
  page.on("request", (request) => { if (!request.url().startsWith("data:") && request.url() !== url) found.requests.push(request.url()); });
  await page.goto(url);
  await page.waitForFunction(() => globalThis.p2osPage);
  return page;
}

const page = await open();
found.firstPaintMs = await page.evaluate(() => performance.getEntriesByName("first-contentful-paint")[0]?.startTime ?? -1);
found.before = await page.locator("#state").textContent();

// The chip alone: each program with its inputs, its edges, cycles, characters and what was named, and how fast it was.
for (const { name, file, ns, inputs } of programs) {
  found.runs[name] = await page.evaluate(([base64, until, rows]) => {
    const { Chip, segmentsOf, data, module } = globalThis.p2osPage, bytes = Uint8Array.from(atob(base64), (c) => c.charCodeAt(0));
    const began = performance.now(), chip = new Chip(module, data, segmentsOf(bytes)), booted = performance.now(), text = {};
    chip.onWords = (port, words) => { text[port] = (text[port] ?? "") + words.map(({ word }) => String.fromCharCode(word & 0xff)).join(""); };
    const edges = chip.subscribe();
    chip.driveLater(rows);
    const ran = performance.now();
    chip.run(BigInt(until));
    const ms = performance.now() - ran;
    return { ns: String(chip.ns), cycle: String(chip.cycle), edges: chip.edges(edges).map((row) => row.map(Number)), text, named: [...chip.named.keys()], stopped: chip.stopped, bootMs: booted - began, ms };
  }, [readFileSync(file).toString("base64"), ns, inputs]);
}

// A person: a file that is no program, then one that is; keys, a pin, a line to the console.
await page.setInputFiles("#file", { name: "not.elf", mimeType: "application/octet-stream", buffer: Buffer.from("hello") });
await page.waitForFunction(() => document.getElementById("state").classList.contains("wrong"));
found.refused = await page.locator("#state").textContent();
await page.setInputFiles("#file", programs[0].file);
await page.waitForFunction(() => document.getElementById("state").textContent.includes("runs"));
await page.waitForFunction(() => document.getElementById("text").textContent.includes("ready"), undefined, { timeout: 20000 });
await page.waitForFunction(() => document.getElementById("speed").textContent.includes("MHz"), undefined, { timeout: 20000 });
found.console = await page.locator("#text").textContent();
found.speed = await page.locator("#speed").textContent();
found.could = await page.locator("#could").textContent();
await page.evaluate(() => document.activeElement.blur());
await page.keyboard.press(" ");
found.paused = await page.locator("#state").textContent();
await page.keyboard.press(" ");
found.again = await page.locator("#state").textContent();
const pin = page.getByRole("button", { name: /^PA4 / });
found.pins = [await pin.getAttribute("aria-label")];
for (let n = 0; n < 3; n++) {
  await pin.press("Enter");
  found.pins.push(await pin.getAttribute("aria-label"));
}
await page.evaluate(() => { document.activeElement.blur(); globalThis.before = globalThis.p2osPage.app.chip.ns; });
await page.keyboard.press("r");
found.restarted = await page.evaluate(() => globalThis.p2osPage.app.chip.ns < globalThis.before);
await page.getByRole("textbox", { name: "type to it" }).fill("hello");
await page.keyboard.press("Enter");
found.typed = await page.getByRole("textbox", { name: "type to it" }).inputValue();

// What axe says, and pictures: wide and narrow, light and dark.
const seen = await open();
await seen.setInputFiles("#file", programs.at(-1).file);
await seen.waitForFunction(() => document.getElementById("speed").textContent.includes("MHz"), undefined, { timeout: 20000 });
await seen.evaluate(axe);
for (const [width, colorScheme] of [[1400, "light"], [1400, "dark"], [420, "light"], [420, "dark"]]) {
  await seen.setViewportSize({ width, height: 900 });
  await seen.emulateMedia({ colorScheme });
  await seen.waitForTimeout(150);
  found[`wide ${width}`] = await seen.evaluate(() => document.documentElement.scrollWidth - innerWidth);
  found.complaints.push(...await complaints(seen, `${width} ${colorScheme}`, { rules: colorScheme === "dark" ? COLOURS : {} }));
  if (folder) await seen.screenshot({ path: `${folder}/chip-${width}-${colorScheme}.png`, fullPage: true });
}
await browser.close();
console.log(JSON.stringify(found));
