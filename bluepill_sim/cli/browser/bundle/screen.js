// What the page shows of a chip, and what its keys and buttons do.
"use strict";
(() => {
  const { Chip, segmentsOf } = globalThis.p2osChip;
  const at = (id) => document.getElementById(id);
  const fromBase64 = (text) => Uint8Array.from(atob(text), (letter) => letter.charCodeAt(0));
  // chosen: so long of each frame the chip may run, in ms, and slices of it; characters kept; rows shown.
  const BUDGET_MS = 12, SLICE_NS = 2_000_000n, KEPT = 60_000, SHOWN = 60, LATE_MS = 100;
  const data = JSON.parse(at("data").textContent);
  const module = new WebAssembly.Module(fromBase64(at("wasm").textContent));
  const app = { chip: null, running: false, name: "", bytes: null, sent: {}, bootMs: 0 };
  let typed = {}, buttons = [], shownNamed = -1, textChanged = true;
  // Of the last second: wall time, time of the chip, its cycles, and how long it ran for them.
  let since = { wall: 0, ns: 0n, cycles: 0n, busy: 0 }, aheadOf = { wall: 0, ns: 0n };

  function say(text, isWrong = false) {
    at("state").textContent = text;
    at("state").classList.toggle("wrong", isWrong);
  }

  function boot(name, bytes) {
    const began = performance.now();
    try {
      const chip = new Chip(module, data, segmentsOf(bytes));
      Object.assign(app, { chip, name, bytes, running: true, sent: {} });
    } catch (error) {
      say(`${name}: ${error.message}`, true);
      return;
    }
    app.bootMs = performance.now() - began;
    app.chip.onWords = (port, words) => {
      app.sent[port] = ((app.sent[port] ?? "") + words.map(({ word }) => String.fromCharCode(word & 0xff)).join("")).slice(-KEPT);
      textChanged = true;
    };
    typed = {};
    shownNamed = -1;
    textChanged = true;
    at("run").disabled = at("restart").disabled = false;
    restartFigures();
    showPins();
    show();
  }

  function restartFigures() {
    since = { wall: performance.now(), ns: app.chip.ns, cycles: app.chip.cycle, busy: 0 };
    aheadOf = { wall: performance.now(), ns: app.chip.ns };
  }

  function setRunning(running) {
    if (!app.chip || app.chip.stopped) return;
    app.running = running;
    restartFigures();
    show();
  }

  function frame() {
    requestAnimationFrame(frame);
    if (!app.running) return;
    const chip = app.chip, began = performance.now();
    const wanted = at("paced").checked ? aheadOf.ns + BigInt(Math.round((began - aheadOf.wall) * 1e6)) : 1n << 62n;
    send();
    while (chip.ns < wanted && performance.now() - began < BUDGET_MS && !chip.stopped) {
      const next = chip.ns + SLICE_NS;
      chip.run(next < wanted ? next : wanted);
    }
    since.busy += performance.now() - began;
    // A page that cannot follow, or was hidden, does not run after what it has missed.
    if (Number(wanted - chip.ns) > LATE_MS * 1e6) aheadOf = { wall: performance.now(), ns: chip.ns };
    if (chip.stopped) app.running = false;
    show();
  }

  function send() {
    for (const [port, words] of Object.entries(typed)) if (words.length) words.splice(0, app.chip.type(port, words));
  }

  function show() {
    const chip = app.chip, wall = performance.now() - since.wall;
    at("run").textContent = app.running ? "Pause" : "Run";
    say(chip.stopped ? `${app.name}: ${chip.stopped}` : `${app.name} ${app.running ? "runs" : "is paused"}`, Boolean(chip.stopped));
    at("time").textContent = `${(Number(chip.ns) / 1e9).toFixed(3)} s`;
    at("cycles").textContent = chip.cycle.toLocaleString("en");
    if (app.running && wall > 1000) {
      const cycles = Number(chip.cycle - since.cycles), ns = Number(chip.ns - since.ns);
      at("speed").textContent = `${(cycles / wall / 1e3).toFixed(1)} MHz, ${(ns / 1e6 / wall).toFixed(2)} × real time`;
      at("could").textContent = since.busy ? `${(cycles / since.busy / 1e3).toFixed(0)} MHz, ${(ns / 1e6 / since.busy).toFixed(1)} × real time` : "–";
      since = { wall: performance.now(), ns: chip.ns, cycles: chip.cycle, busy: 0 };
    }
    for (let port = 0; port < 5; port++) {
      const masks = chip.port(port);
      for (const pin of buttons.filter((one) => one.pin >> 4 === port)) showPin(pin, masks);
    }
    if (textChanged) {
      const box = at("text"), isAtEnd = box.scrollHeight - box.scrollTop - box.clientHeight < 30;
      box.textContent = app.sent[at("port").value] ?? "";
      if (isAtEnd) box.scrollTop = box.scrollHeight;
      textChanged = false;
    }
    const count = [...chip.named.values()].reduce((sum, { times }) => sum + times, 0);
    if (count !== shownNamed) {
      shownNamed = count;
      at("missing").replaceChildren(...(chip.named.size ? [...chip.named].slice(0, SHOWN).map(([text, first]) => {
        const row = document.createElement("li"), where = document.createElement("small");
        where.textContent = ` (${first.times} ×, first at 0x${first.pc.toString(16).padStart(8, "0")}, ${(Number(first.ns) / 1e6).toFixed(3)} ms)`;
        row.append(text, where);
        return row;
      }) : [Object.assign(document.createElement("li"), { textContent: "nothing so far" })]));
    }
  }

  function showPins() {
    const rows = new Map();
    buttons = [];
    for (let port = 0; port < 5; port++) {
      const { bonded } = app.chip.port(port);
      for (let n = 0; n < 16; n++) if (bonded >> n & 1) {
        const element = document.createElement("button"), name = `P${"ABCDE"[port]}${n}`;
        element.innerHTML = `<b>${name}</b> <span></span>`;
        const pin = { pin: 16 * port + n, name, element, outside: null, shown: "" };
        element.addEventListener("click", () => {
          pin.outside = pin.outside === null ? 1 : pin.outside === 1 ? 0 : null;
          app.chip.drive(pin.pin, pin.outside);
          show();
        });
        buttons.push(pin);
        rows.set(port, [...(rows.get(port) ?? []), element]);
      }
    }
    at("pins").replaceChildren(...[...rows].map(([port, elements]) => {
      const row = Object.assign(document.createElement("div"), { className: "row", role: "group" });
      row.setAttribute("aria-label", `Port ${"ABCDE"[port]}`);
      row.append(...elements);
      return row;
    }));
  }

  function showPin(pin, masks) {
    const has = (name) => Boolean(masks[name] >> (pin.pin & 15) & 1);
    const level = has("shown") ? "wave" : has("floating") ? "open" : has("level") ? "1" : "0";
    const chip = has("low") || has("high") ? " out" : has("up") ? " up" : has("down") ? " down" : "";
    const outside = pin.outside === null ? "" : ` ←${pin.outside}`, text = `${level}${chip}${outside}`;
    const key = `${text}${has("fighting")}`;
    if (key === pin.shown) return;
    pin.shown = key;
    pin.element.lastChild.textContent = text;
    pin.element.className = `pin ${level === "1" || level === "wave" ? "high" : level === "0" ? "low" : "floating"}${outside ? " driven" : ""}${has("fighting") ? " wrong" : ""}`;
    const who = { " out": ", an output of the chip", " up": ", pulled up by the chip", " down": ", pulled down by the chip" }[chip] ?? "";
    pin.element.setAttribute("aria-label", `${pin.name} ${text}: ${{ 0: "low", 1: "high", open: "floating", wave: "a wave" }[level]}${who}${outside ? `, driven ${pin.outside} from outside` : ""}`);
  }

  async function open(file) {
    if (file) boot(file.name, new Uint8Array(await file.arrayBuffer()));
  }

  at("file").addEventListener("change", (event) => void open(event.target.files[0]));
  at("run").addEventListener("click", () => setRunning(!app.running));
  at("restart").addEventListener("click", () => boot(app.name, app.bytes));
  at("paced").addEventListener("change", () => app.chip && restartFigures());
  at("port").addEventListener("change", () => { textChanged = true; if (app.chip) show(); });
  at("clear").addEventListener("click", () => { app.sent[at("port").value] = ""; textChanged = true; if (app.chip) show(); });
  at("typing").addEventListener("submit", (event) => {
    event.preventDefault();
    (typed[at("port").value] ??= []).push(...new TextEncoder().encode(`${at("line").value}\r\n`));
    at("line").value = "";
  });
  document.addEventListener("keydown", (event) => {
    if (event.ctrlKey || event.altKey || event.metaKey || event.target.closest("input, select, button, pre")) return;
    if (event.key === " ") { event.preventDefault(); setRunning(!app.running); }
    if (event.key === "r" && app.chip) boot(app.name, app.bytes);
  });
  for (const kind of ["dragover", "dragleave", "drop"]) document.addEventListener(kind, (event) => {
    event.preventDefault();
    document.body.classList.toggle("over", kind === "dragover");
    if (kind === "drop") void open(event.dataTransfer.files[0]);
  });
  globalThis.p2osPage = { app, boot, Chip, segmentsOf, data, module };
  if (at("program").textContent) boot(at("program").dataset.name, fromBase64(at("program").textContent));
  requestAnimationFrame(frame);
})();
