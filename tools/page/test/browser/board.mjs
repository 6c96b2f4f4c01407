// Controls a board by itself from its page in Chromium, and says as JSON what came of it. Usage: node board.mjs CHROMIUM ADDRESS
import { drawnSeldom, launched } from "./opened.mjs";

const [executablePath, url] = process.argv.slice(2), found = { errors: [] };
const browser = await launched(executablePath);
const page = await (await drawnSeldom(browser)).newPage();
page.setDefaultTimeout(40_000);
page.on("console", (message) => { if (message.type() === "error") found.errors.push(message.text()); });
page.on("pageerror", (error) => found.errors.push(error.message));
await page.goto(url);
await page.waitForFunction(() => window.p2osPage?.app.store.run.value && window.p2osPage.app.store.version.value > 0);
await page.getByRole("tab", { name: "Consoles" }).waitFor();

const run = () => page.evaluate(() => ({ ...window.p2osPage.app.store.run.value }));
async function after(act) {
  const wanted = (await run()).done + 1;
  await act();
  await page.waitForFunction((done) => { const state = window.p2osPage.app.store.run.value; return state.done >= done && !state.is_running; }, wanted);
  return run();
}

await after(() => page.getByRole("button", { name: "Pause the run" }).click());
await page.getByRole("combobox", { name: "A step goes by one" }).selectOption("instruction");
found.stepped = await after(() => page.keyboard.press("s"));
found.back = await after(() => page.keyboard.press("Shift+S"));
found.tabs = await page.getByRole("tab").allTextContents();
await page.getByRole("tab", { name: "Hands" }).click();
const hands = page.getByRole("region", { name: "What hands can do" });
found.hand = await after(() => hands.getByRole("button", { name: "High" }).click());
found.things = await hands.getByRole("heading", { name: "Robot and things" }).count();
found.saves = await hands.getByRole("button", { name: "Save as test" }).count();
await browser.close();
console.log(JSON.stringify(found));
