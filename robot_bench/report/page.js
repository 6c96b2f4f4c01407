// Draws a run from the data embedded in the page. No library, no network.
"use strict";
const run = JSON.parse(document.getElementById("data").textContent);
const end = Math.max(run.duration, 0.001);
const nearest = run.sonar.map((row) => [row[0], Math.min(...row.slice(1)) / 1000]);
const view = { from: 0, to: end, at: 0, playing: false };
const css = (name) => getComputedStyle(document.documentElement).getPropertyValue(name).trim();
const byId = (id) => document.getElementById(id);

// --- time ---------------------------------------------------------------
// Index of the last row at or before t; rows are sorted by their first column.
function before(rows, t) {
  let low = 0, high = rows.length;
  while (low < high) { const middle = (low + high) >> 1; if (rows[middle][0] <= t) low = middle + 1; else high = middle; }
  return low - 1;
}
function pose(t) {
  const rows = run.poses, i = Math.max(0, before(rows, t));
  if (!rows.length) return null;
  const a = rows[i], b = rows[Math.min(i + 1, rows.length - 1)];
  const f = b[0] > a[0] ? Math.min(1, Math.max(0, (t - a[0]) / (b[0] - a[0]))) : 0;
  let turn = b[3] - a[3];
  while (turn > Math.PI) turn -= 2 * Math.PI;
  while (turn < -Math.PI) turn += 2 * Math.PI;
  return { x: a[1] + f * (b[1] - a[1]), y: a[2] + f * (b[2] - a[2]), heading: a[3] + f * turn, left: a[4], right: a[5], index: i };
}

// --- plan ---------------------------------------------------------------
const MAP = { left: 46, right: 14, top: 16, bottom: 62 };
function canvas(id) {
  const c = byId(id), ratio = window.devicePixelRatio || 1, box = c.getBoundingClientRect();
  const [x0, y0, x1, y1] = run.plan.bounds;
  const height = id === "map" ? Math.max(120, (box.width - MAP.left - MAP.right) * (y1 - y0) / (x1 - x0)) + MAP.top + MAP.bottom
    : id === "pins" ? PINS_HEIGHT : Number(c.dataset.height || (c.dataset.height = c.getAttribute("height")));
  c.style.height = height + "px";
  if (c.width !== Math.round(box.width * ratio)) c.width = Math.round(box.width * ratio);
  if (c.height !== Math.round(height * ratio)) c.height = Math.round(height * ratio);
  const g = c.getContext("2d");
  g.setTransform(ratio, 0, 0, ratio, 0, 0);
  g.clearRect(0, 0, box.width, height);
  g.font = "12px system-ui, sans-serif";
  return { g, width: box.width, height };
}
function thingsAt(t) {
  const now = new Map(run.obstacles.map((o) => [o.name, o]));
  for (const change of run.changes) {
    if (change.t > t) break;
    if (change.op === "remove") now.delete(change.name);
    else now.set(change.name, { ...now.get(change.name), ...change });
  }
  return now;
}
function halo(g, text, x, y) {
  g.save(); g.strokeStyle = css("--panel"); g.lineWidth = 3; g.lineJoin = "round"; g.strokeText(text, x, y); g.restore();
  g.fillText(text, x, y);
}
function cross(g, x, y, half) { g.beginPath(); g.moveTo(x - half, y - half); g.lineTo(x + half, y + half); g.moveTo(x + half, y - half); g.lineTo(x - half, y + half); g.stroke(); }
function arrowhead(g, x, y, heading, size) {
  g.save(); g.translate(x, y); g.rotate(-heading); g.beginPath();
  for (const [u, v] of [[1, 0], [-0.7, 0.7], [-0.3, 0], [-0.7, -0.7]]) g.lineTo(u * size, -v * size);
  g.closePath(); g.fill(); g.stroke(); g.restore();
}
function drawMap() {
  const { g, width, height } = canvas("map"), [x0, y0, x1, y1] = run.plan.bounds;
  const scale = (width - MAP.left - MAP.right) / (x1 - x0), top = MAP.top, bottom = top + (y1 - y0) * scale;
  const X = (x) => MAP.left + (x - x0) * scale, Y = (y) => bottom - (y - y0) * scale;
  // Axes, their names and directions, and a scale bar.
  g.strokeStyle = css("--line"); g.fillStyle = css("--faint"); g.lineWidth = 1;
  for (const x of ticks(x0, x1, run.plan.step)) { g.beginPath(); g.moveTo(X(x), top); g.lineTo(X(x), bottom); g.stroke(); g.textAlign = "center"; g.fillText(x, X(x), bottom + 16); }
  for (const y of ticks(y0, y1, run.plan.step)) { g.beginPath(); g.moveTo(X(x0), Y(y)); g.lineTo(X(x1), Y(y)); g.stroke(); g.textAlign = "right"; g.fillText(y, MAP.left - 6, Y(y) + 4); }
  g.strokeRect(X(x0), top, X(x1) - X(x0), bottom - top);
  g.textAlign = "left"; g.fillText("x, m →  (heading 0°)", MAP.left, bottom + 36);
  g.save(); g.translate(13, bottom); g.rotate(-Math.PI / 2); g.fillText("y, m →  (heading 90°)", 0, 0); g.restore();
  const bar = run.plan.step * scale; g.fillStyle = css("--ink"); g.fillRect(X(x1) - bar, bottom + 28, bar, 3);
  g.textAlign = "center"; g.fillText(`${run.plan.step} m`, X(x1) - bar / 2, bottom + 46);
  const things = thingsAt(view.at);
  g.save(); g.beginPath(); g.rect(X(x0), top, X(x1) - X(x0), bottom - top); g.clip();
  for (const floor of [true, false]) for (const o of things.values()) {
    if (o.floor !== floor) continue;
    g.save(); g.translate(X(o.x), Y(o.y)); g.rotate(-(o.heading || 0));
    g.fillStyle = css(o.wall ? "--wall" : "--box"); g.globalAlpha = o.floor ? 0.18 : 1;
    g.beginPath();
    if (o.shape === "cylinder") g.arc(0, 0, o.radius * scale, 0, 7);
    else g.rect(-o.length * scale / 2, -o.width * scale / 2, o.length * scale, o.width * scale);
    g.fill(); g.restore();
  }
  g.lineWidth = 1.6; g.lineJoin = "round";
  for (const [style, alpha, limit] of [["--path", 0.25, end], ["--path", 1, view.at]]) {
    g.strokeStyle = css(style); g.globalAlpha = alpha; g.beginPath();
    for (const p of run.poses) { if (p[0] > limit) break; g.lineTo(X(p[1]), Y(p[2])); }
    g.stroke();
  }
  g.globalAlpha = 1; g.fillStyle = g.strokeStyle = css("--path"); g.lineWidth = 1;
  const size = (X(x1) - X(x0)) / 90;
  for (const [t, x, y, heading] of run.plan.times) { g.globalAlpha = t <= view.at ? 1 : 0.35; arrowhead(g, X(x), Y(y), heading, Math.max(5, size)); }
  g.globalAlpha = 1;
  if (run.poses.length) { const s = run.poses[0]; g.fillStyle = css("--panel"); g.lineWidth = 1.6; arrowhead(g, X(s[1]), Y(s[2]), s[3], Math.max(8, size * 1.6)); }
  drawRobot(g, X, Y, scale);
  g.restore(); g.strokeStyle = css("--bad"); g.lineWidth = 2.4;
  for (const [t, x, y] of run.hits) { if (t > view.at) break; cross(g, X(x), Y(y), 5); }
  const colours = { hit: "--bad", time: "--path", start: "--path", thing: "--ink" };
  for (const label of run.plan.labels[width > 520 ? "wide" : "narrow"]) {
    const at = label.kind === "thing" ? things.get(label.name) : label;
    if (!at || (label.kind === "hit" && label.t > view.at)) continue;
    g.fillStyle = css(colours[label.kind]); g.textAlign = label.align;
    halo(g, label.text, X(at.x) + label.dx, Y(at.y) + label.dy + 4);
  }
}
function drawRobot(g, X, Y, scale) {
  const p = pose(view.at);
  if (!p) return;
  const robot = run.robot, echo = run.sonar[before(run.sonar, view.at)];
  g.save(); g.translate(X(p.x), Y(p.y)); g.rotate(-p.heading);
  robot.sonar.forEach(([sx, sy, heading], n) => {
    const range_m = echo ? echo[1 + n] / 1000 : 0, range = Math.min(range_m, 2.0);
    if (!range) return;
    g.fillStyle = css(range_m < run.threshold ? "--near" : "--sonar");
    g.beginPath(); g.moveTo(sx * scale, -sy * scale);
    g.arc(sx * scale, -sy * scale, range * scale, -heading - robot.cone / 2, -heading + robot.cone / 2); g.fill();
  });
  // The path and its marks are seen through the hull.
  g.fillStyle = css("--panel"); g.strokeStyle = css("--ink"); g.lineWidth = 1.4; g.globalAlpha = 0.5;
  g.beginPath(); g.rect(-robot.rear * scale, -robot.width / 2 * scale, (robot.front + robot.rear) * scale, robot.width * scale); g.fill();
  g.globalAlpha = 1; g.stroke();
  g.fillStyle = css("--ink");
  g.beginPath(); g.moveTo(robot.front * scale, 0); g.lineTo(robot.front * .35 * scale, -robot.width * .22 * scale); g.lineTo(robot.front * .35 * scale, robot.width * .22 * scale); g.fill();
  g.restore();
  const state = run.usart[before(run.usart, view.at)];
  byId("now").textContent = `${view.at.toFixed(2)} s   x ${p.x.toFixed(3)} m   y ${p.y.toFixed(3)} m   heading ${(p.heading * 180 / Math.PI).toFixed(1)}°   `
    + `wheels ${(p.left * 1000).toFixed(0)} / ${(p.right * 1000).toFixed(0)} mm/s` + (state ? `   “${state[1]}”` : "");
}

// --- charts -------------------------------------------------------------
// Left of a plot as much as its labels need; above it the legend, so that neither lies on the data.
const LEGEND_PX = 20, FOOT_PX = 20, GROUP_PX = 22, PIN_PX = 17, LEFT = Math.max(64, 20 + Math.max(0, ...run.pins.flatMap(([, nets]) => nets).map(([label]) => textWidth(label))));
const PINS_HEIGHT = LEGEND_PX + FOOT_PX + run.pins.reduce((sum, [, nets]) => sum + GROUP_PX + PIN_PX * nets.length, 0);
function textWidth(text) { const g = document.createElement("canvas").getContext("2d"); g.font = "12px system-ui, sans-serif"; return g.measureText(text).width; }
// A distance of ticks in round numbers: 1, 2 or 5 times a power of ten, for so many or fewer.
function roundStep(span, most) { const raw = span / most, power = 10 ** Math.floor(Math.log10(raw)); return [1, 2, 5, 10].map((k) => k * power).find((s) => s >= raw * 0.999); }
function ticks(low, high, step) {
  const found = [];
  for (let n = Math.ceil(low / step - 1e-9); n * step <= high + step * 1e-9; n++) found.push(Number((n * step).toPrecision(12)));
  return found;
}
// low and high are widened to whole ticks; a legend is [text, colour, width, dashes, offset of dashes].
function axis(id, low, high, unit, legend) {
  const { g, width, height } = canvas(id), foot = height - FOOT_PX, step = roundStep(high - low, 5);
  const bottom = Math.floor(low / step + 1e-9) * step, top = Math.ceil(high / step - 1e-9) * step;
  let x = LEFT + 4, head = LEGEND_PX;
  g.fillStyle = css("--faint"); g.textAlign = "left";
  if (run.hits.length) legend = [...legend, ["collision", css("--bad"), 1.2, []]];
  for (const [text, colour, thick, dashes, offset] of legend) {
    const length = 26 + g.measureText(text).width;
    if (x > LEFT + 4 && x + length > width) { x = LEFT + 4; head += LEGEND_PX - 4; }
    g.strokeStyle = colour; g.lineWidth = thick; g.setLineDash(dashes); g.lineDashOffset = offset || 0;
    g.beginPath(); g.moveTo(x, head - 10); g.lineTo(x + 22, head - 10); g.stroke(); g.setLineDash([]);
    g.fillText(text, x + 26, head - 6); x += length + 10;
  }
  const X = (t) => LEFT + (t - view.from) / (view.to - view.from) * (width - LEFT - 10);
  const Y = (v) => head + 6 + (top - v) / (top - bottom) * (foot - head - 10);
  g.fillStyle = css("--faint"); g.strokeStyle = css("--line"); g.lineWidth = 1;
  g.textAlign = "center";
  for (const t of ticks(view.from, view.to, roundStep(view.to - view.from, Math.max(2, (width - LEFT) / 70)))) {
    g.beginPath(); g.moveTo(X(t), head); g.lineTo(X(t), foot); g.stroke();
    g.fillText(`${t} s`, Math.min(X(t), width - 4 - textWidth(`${t} s`) / 2), height - 5);
  }
  if (unit) {
    const digits = Math.max(0, -Math.floor(Math.log10(step) + 1e-9));
    g.textAlign = "right";
    for (const v of ticks(bottom, top, step)) { g.beginPath(); g.moveTo(LEFT, Y(v)); g.lineTo(width - 10, Y(v)); g.stroke(); g.fillText(v.toFixed(digits), LEFT - 8, Y(v) + 4); }
    g.fillText(unit, LEFT - 8, 14);
  }
  g.save(); g.beginPath(); g.rect(LEFT, head, width - LEFT - 10, foot - head); g.clip();
  return { g, X, Y, width, head, height: foot };
}
function cursor({ g, X, head, height }) {
  g.strokeStyle = css("--bad"); g.lineWidth = 1.2;
  for (const [t] of run.hits) { g.beginPath(); g.moveTo(X(t), head); g.lineTo(X(t), height); g.stroke(); }
  g.restore(); g.strokeStyle = css("--ink"); g.lineWidth = 1; g.beginPath(); g.moveTo(X(view.at), head); g.lineTo(X(view.at), height); g.stroke();
}
function visible(rows) { return rows.slice(Math.max(0, before(rows, view.from)), before(rows, view.to) + 2); }
function line({ g, X, Y }, rows, column, [, colour, thick, dashes, offset], stepped) {
  let last = null;
  g.strokeStyle = colour; g.lineWidth = thick; g.setLineDash(dashes); g.lineDashOffset = offset || 0; g.beginPath();
  for (const row of visible(rows)) { if (stepped && last !== null) g.lineTo(X(row[0]), Y(last)); g.lineTo(X(row[0]), Y(row[column])); last = row[column]; }
  if (stepped && last !== null) g.lineTo(X(end), Y(last));
  g.stroke(); g.setLineDash([]);
}
// Two curves that lie on one another are both seen: one is broad, the other dashed and drawn on it.
function drawSpeeds() {
  const top = Math.max(0.1, ...run.poses.map((p) => Math.max(Math.abs(p[4]), Math.abs(p[5]))), ...run.motors.flat().map((m) => Math.abs(m[1])));
  const left = css("--left"), right = css("--right");
  const legend = [["left", left, 3, []], ["right", right, 1.6, [6, 4]], ["left asked", left, 1.6, [2, 6]], ["right asked", right, 1.6, [2, 6], 4]];
  const plot = axis("speeds", -top, top, "m/s", run.motors.some((steps) => steps.length) ? legend : legend.slice(0, 2));
  run.motors.forEach((steps, n) => { if (steps.length) line(plot, steps, 1, legend[2 + n], true); });
  line(plot, run.poses, 4, legend[0]); line(plot, run.poses, 5, legend[1]);
  cursor(plot);
}
function drawSonar() {
  const legend = [["nearest echo of all", css("--left"), 1.4, []]];
  if (run.threshold) legend.push([`threshold ${run.threshold} m`, css("--right"), 1.4, [4, 4]]);
  const plot = axis("sonar", 0, 3, "m", legend);
  line(plot, nearest, 1, legend[0], true);
  if (run.threshold) line(plot, [[0, run.threshold], [end, run.threshold]], 1, legend[1]);
  cursor(plot);
}
function drawPins() {
  const plot = axis("pins", 0, 1, "", []), { g, X } = plot; let y = LEGEND_PX;
  for (const [title, nets] of run.pins) {
    g.restore(); g.font = "600 12px system-ui, sans-serif"; g.fillStyle = css("--faint"); g.textAlign = "left"; halo(g, title, 6, y + 12); y += 16;
    g.font = "12px system-ui, sans-serif";
    for (const [label, edges] of nets) {
      g.fillStyle = css("--ink"); g.textAlign = "right"; g.fillText(label, LEFT - 8, y + 12);
      g.save(); g.beginPath(); g.rect(LEFT, 0, plot.width - LEFT - 10, plot.height); g.clip();
      g.strokeStyle = css(title.includes("right") ? "--right" : "--left"); g.lineWidth = 1.3; g.beginPath();
      let last = 0, levelY = (v) => y + (v ? 2 : 13), started = false;
      for (const [t, v] of visible(edges)) { g.lineTo(X(started ? t : Math.max(t, view.from)), levelY(last)); g.lineTo(X(Math.max(t, view.from)), levelY(v)); last = v; started = true; }
      g.lineTo(X(end), levelY(last)); g.stroke(); g.restore(); y += PIN_PX;
    }
    y += GROUP_PX - 16; g.save();
  }
  g.beginPath(); g.rect(LEFT, 0, plot.width - LEFT - 10, plot.height); g.clip();
  cursor(plot);
}

// --- lists --------------------------------------------------------------
function fill(id, rows, text) {
  const box = byId(id); box.replaceChildren();
  for (const row of rows) {
    const item = document.createElement("div"), time = document.createElement("time");
    time.textContent = row[0].toFixed(3); item.append(time, ...(row[2] === "gap" ? [tag("b", row[1])] : text(row)));
    item.addEventListener("click", () => { view.at = row[0]; draw(); });
    box.append(item);
  }
}
const tag = (name, text) => { const e = document.createElement(name); e.textContent = text; return e; };
// A packet that is said again is held once.
function packets() {
  const wanted = byId("filter").value.toLowerCase(), { rows, kinds } = run.packets;
  const hits = kinds.map((kind) => !wanted || (kind.join(" ") + " " + spaced(kind[3])).toLowerCase().includes(wanted));
  const shown = rows.filter((row) => row[2] || hits[row[1]]), count = rows.filter((row) => !row[2]).length;
  byId("packet-count").textContent = wanted ? `${shown.filter((row) => !row[2]).length} of ${count}` : `${count}`;
  fill("packets", shown, (row) => {
    const [direction, name, text, hex] = kinds[row[1]];
    return [tag("i", direction === "c2r" ? "→ " : "← "), tag("b", name), document.createTextNode(" " + text + " "), tag("i", spaced(hex))];
  });
}
const spaced = (hex) => hex.replace(/..(?=.)/g, "$& ");

// --- page ---------------------------------------------------------------
function draw() { byId("time").value = 1000 * view.at / end; drawMap(); drawSpeeds(); drawSonar(); drawPins(); }
byId("time").addEventListener("input", (e) => { view.at = end * e.target.value / 1000; draw(); });
byId("play").addEventListener("click", () => {
  view.playing = !view.playing;
  byId("play").querySelector("path").setAttribute("d", view.playing ? "M2 1h3v10H2zM7 1h3v10H7z" : "M2 1v10l9-5z"); // drawn: fonts lack the pause sign
  if (view.at >= end) view.at = 0;
  let last = performance.now();
  const tick = (now) => {
    if (!view.playing) return;
    view.at = Math.min(end, view.at + (now - last) / 1000 * byId("rate").value); last = now; draw();
    if (view.at >= end) byId("play").click(); else requestAnimationFrame(tick);
  };
  requestAnimationFrame(tick);
});
for (const id of ["speeds", "sonar", "pins"]) {
  const c = byId(id), timeAt = (e) => { const box = c.getBoundingClientRect(); return view.from + (e.clientX - box.left - LEFT) / (box.width - LEFT - 10) * (view.to - view.from); };
  let drag = null;
  c.addEventListener("wheel", (e) => {
    e.preventDefault();
    const t = timeAt(e), k = e.deltaY > 0 ? 1.25 : 0.8, span = Math.min(end, Math.max(1e-6, (view.to - view.from) * k));
    view.from = Math.max(0, Math.min(end - span, t - (t - view.from) * span / (view.to - view.from))); view.to = view.from + span; draw();
  }, { passive: false });
  c.addEventListener("pointerdown", (e) => { drag = { x: e.clientX, from: view.from, to: view.to, moved: false }; c.setPointerCapture(e.pointerId); });
  c.addEventListener("pointermove", (e) => {
    if (!drag) return;
    const shift = (drag.x - e.clientX) / (c.getBoundingClientRect().width - LEFT - 10) * (drag.to - drag.from);
    if (Math.abs(drag.x - e.clientX) > 3) drag.moved = true;
    const move = Math.max(-drag.from, Math.min(end - drag.to, shift)); view.from = drag.from + move; view.to = drag.to + move; draw();
  });
  c.addEventListener("pointerup", (e) => { if (drag && !drag.moved) { view.at = Math.max(0, Math.min(end, timeAt(e))); draw(); } drag = null; });
  c.addEventListener("dblclick", () => { view.from = 0; view.to = end; draw(); });
}
fill("log", run.events, (e) => [tag("i", e[1] + " "), tag(e[2] === "collision" ? "strong" : "b", e[2]), document.createTextNode(" " + e[3])]);
fill("usart", run.usart, (u) => [document.createTextNode(u[1])]);
byId("filter").addEventListener("input", packets);
packets();
view.at = run.poses.length ? Math.min(end, run.poses[run.poses.length - 1][0]) : 0;
window.addEventListener("resize", draw);
draw();
