// Draws a run from the data embedded in the page. No library, no network.
"use strict";
const run = JSON.parse(document.getElementById("data").textContent);
const end = Math.max(run.duration, 0.001);
const nearest = run.sonar.map((row) => [row[0], Math.min(...row.slice(1))]);
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
function canvas(id) {
  const c = byId(id), ratio = window.devicePixelRatio || 1, box = c.getBoundingClientRect();
  const height = id === "map" ? box.width : Number(c.dataset.height || (c.dataset.height = c.getAttribute("height")));
  c.style.height = height + "px";
  if (c.width !== Math.round(box.width * ratio)) c.width = Math.round(box.width * ratio);
  if (c.height !== Math.round(height * ratio)) c.height = Math.round(height * ratio);
  const g = c.getContext("2d");
  g.setTransform(ratio, 0, 0, ratio, 0, 0);
  g.clearRect(0, 0, box.width, height);
  g.font = "12px system-ui, sans-serif";
  return { g, width: box.width, height };
}
function obstaclesAt(t) {
  const now = new Map(run.world.obstacles.map((o) => [o.name, o]));
  for (const change of run.changes) {
    if (change.t > t) break;
    if (change.op === "remove") now.delete(change.name);
    else now.set(change.name, { ...now.get(change.name), ...change });
  }
  return [...now.values()];
}
function drawMap() {
  const { g, width } = canvas("map"), [x0, y0, x1, y1] = run.world.extent;
  const margin = 14, scale = (width - 2 * margin) / Math.max(x1 - x0, y1 - y0);
  const ox = (width - scale * (x1 - x0)) / 2, oy = (width - scale * (y1 - y0)) / 2;
  const X = (x) => ox + (x - x0) * scale, Y = (y) => width - oy - (y - y0) * scale;
  g.strokeStyle = css("--line"); g.lineWidth = 0.5;
  for (let x = Math.ceil(x0); x <= x1; x++) { g.beginPath(); g.moveTo(X(x), Y(y0)); g.lineTo(X(x), Y(y1)); g.stroke(); }
  for (let y = Math.ceil(y0); y <= y1; y++) { g.beginPath(); g.moveTo(X(x0), Y(y)); g.lineTo(X(x1), Y(y)); g.stroke(); }
  for (const o of obstaclesAt(view.at)) {
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
  g.globalAlpha = 1; g.strokeStyle = g.fillStyle = css("--right"); g.lineWidth = 2.4; g.textAlign = "left";
  for (const [t, x, y, what] of run.hits) {
    if (t > view.at) break;
    g.beginPath(); g.moveTo(X(x) - 6, Y(y) - 6); g.lineTo(X(x) + 6, Y(y) + 6); g.moveTo(X(x) + 6, Y(y) - 6); g.lineTo(X(x) - 6, Y(y) + 6); g.stroke();
    if (run.hits.length <= 8 || view.at - t < 2) g.fillText(`${what}, ${t.toFixed(1)} s`, X(x) + 9, Y(y) - 7);
  }
  const p = pose(view.at);
  if (!p) return;
  const robot = run.robot, echo = run.sonar[before(run.sonar, view.at)];
  g.save(); g.translate(X(p.x), Y(p.y)); g.rotate(-p.heading);
  robot.sonar.forEach(([sx, sy, heading], n) => {
    const range = Math.min(echo ? echo[1 + n] : 0, 2.0), near = echo && echo[1 + n] < run.threshold;
    if (!range) return;
    g.fillStyle = css(near ? "--near" : "--sonar");
    g.beginPath(); g.moveTo(sx * scale, -sy * scale);
    g.arc(sx * scale, -sy * scale, range * scale, -heading - robot.cone / 2, -heading + robot.cone / 2); g.fill();
  });
  g.fillStyle = css("--panel"); g.strokeStyle = css("--ink"); g.lineWidth = 1.4;
  g.beginPath(); g.rect(-robot.rear * scale, -robot.width / 2 * scale, (robot.front + robot.rear) * scale, robot.width * scale); g.fill(); g.stroke();
  g.fillStyle = css("--ink");
  g.beginPath(); g.moveTo(robot.front * scale, 0); g.lineTo(robot.front * .35 * scale, -robot.width * .22 * scale); g.lineTo(robot.front * .35 * scale, robot.width * .22 * scale); g.fill();
  g.restore();
  const state = run.usart[before(run.usart, view.at)];
  byId("now").textContent = `${view.at.toFixed(2)} s   x ${p.x.toFixed(3)} m   y ${p.y.toFixed(3)} m   heading ${(p.heading * 180 / Math.PI).toFixed(1)}°   `
    + `wheels ${(p.left * 1000).toFixed(0)} / ${(p.right * 1000).toFixed(0)} mm/s` + (state ? `   “${state[1]}”` : "");
}

// --- charts -------------------------------------------------------------
const LEFT = 92;
function axis(id, low, high, unit) {
  const { g, width, height } = canvas(id), foot = 20;
  const X = (t) => LEFT + (t - view.from) / (view.to - view.from) * (width - LEFT - 10);
  const Y = (v) => 8 + (high - v) / (high - low) * (height - foot - 12);
  g.fillStyle = css("--faint"); g.strokeStyle = css("--line"); g.lineWidth = 1;
  const span = view.to - view.from, raw = span / 10, power = 10 ** Math.floor(Math.log10(raw));
  const step = [1, 2, 5, 10].map((k) => k * power).find((s) => s >= raw);
  g.textAlign = "center";
  for (let t = Math.ceil(view.from / step) * step; t <= view.to; t += step) {
    g.beginPath(); g.moveTo(X(t), 4); g.lineTo(X(t), height - foot); g.stroke();
    g.fillText(`${Number(t.toFixed(6))} s`, X(t), height - 5);
  }
  if (unit) {
    g.textAlign = "right";
    for (const v of [low, (low + high) / 2, high]) { g.beginPath(); g.moveTo(LEFT, Y(v)); g.lineTo(width - 10, Y(v)); g.stroke(); g.fillText(`${v.toFixed(2)} ${unit}`, LEFT - 8, Y(v) + 4); }
  }
  g.save(); g.beginPath(); g.rect(LEFT, 0, width - LEFT - 10, height - foot); g.clip();
  return { g, X, Y, width, height: height - foot };
}
function cursor({ g, X, height }) {
  g.restore(); g.strokeStyle = css("--ink"); g.lineWidth = 1; g.beginPath(); g.moveTo(X(view.at), 2); g.lineTo(X(view.at), height); g.stroke();
}
function visible(rows) { return rows.slice(Math.max(0, before(rows, view.from)), before(rows, view.to) + 2); }
function line(plot, rows, column, colour, stepped) {
  const { g, X, Y } = plot; let last = null;
  g.strokeStyle = colour; g.lineWidth = 1.4; g.beginPath();
  for (const row of visible(rows)) { if (stepped && last !== null) g.lineTo(X(row[0]), Y(last)); g.lineTo(X(row[0]), Y(row[column])); last = row[column]; }
  if (stepped && last !== null) g.lineTo(X(end), Y(last));
  g.stroke();
}
function drawSpeeds() {
  const top = Math.max(0.1, ...run.poses.map((p) => Math.max(Math.abs(p[4]), Math.abs(p[5]))), ...run.motors.flat().map((m) => Math.abs(m[1])));
  const plot = axis("speeds", -top * 1.08, top * 1.08, "m/s");
  plot.g.setLineDash([5, 4]); plot.g.globalAlpha = 0.6;
  line(plot, run.motors[0], 1, css("--left"), true); line(plot, run.motors[1], 1, css("--right"), true);
  plot.g.setLineDash([]); plot.g.globalAlpha = 1;
  line(plot, run.poses, 4, css("--left")); line(plot, run.poses, 5, css("--right"));
  plot.g.fillStyle = css("--left"); plot.g.textAlign = "left"; plot.g.fillText("left", LEFT + 8, 18);
  plot.g.fillStyle = css("--right"); plot.g.fillText("right", LEFT + 40, 18);
  cursor(plot);
}
function drawSonar() {
  const plot = axis("sonar", 0, 3, "m");
  line(plot, nearest, 1, css("--left"), true);
  plot.g.setLineDash([4, 4]); plot.g.strokeStyle = css("--right"); plot.g.beginPath();
  plot.g.moveTo(LEFT, plot.Y(run.threshold)); plot.g.lineTo(plot.width, plot.Y(run.threshold)); plot.g.stroke(); plot.g.setLineDash([]);
  cursor(plot);
}
function drawPins() {
  const plot = axis("pins", 0, 1, ""), { g, X } = plot; let y = 6;
  for (const [title, nets] of run.pins) {
    g.restore(); g.fillStyle = css("--faint"); g.textAlign = "left"; g.fillText(title, 6, y + 11); y += 16;
    for (const [name, edges] of nets) {
      g.fillStyle = css("--ink"); g.textAlign = "right"; g.fillText(name.replace(/^(motor|encoder)\d_/, ""), LEFT - 8, y + 12);
      g.save(); g.beginPath(); g.rect(LEFT, 0, plot.width - LEFT - 10, plot.height); g.clip();
      g.strokeStyle = css(title.includes("right") ? "--right" : "--left"); g.lineWidth = 1.3; g.beginPath();
      let last = 0, levelY = (v) => y + (v ? 2 : 13), started = false;
      for (const [t, v] of visible(edges)) { g.lineTo(X(started ? t : Math.max(t, view.from)), levelY(last)); g.lineTo(X(Math.max(t, view.from)), levelY(v)); last = v; started = true; }
      g.lineTo(X(end), levelY(last)); g.stroke(); g.restore(); y += 17;
    }
    y += 6; g.save();
  }
  cursor(plot);
}

// --- lists --------------------------------------------------------------
function fill(id, rows, text) {
  const box = byId(id); box.replaceChildren();
  for (const row of rows) {
    const item = document.createElement("div"), time = document.createElement("time");
    time.textContent = row[0].toFixed(3); item.append(time, ...text(row));
    item.addEventListener("click", () => { view.at = row[0]; draw(); });
    box.append(item);
  }
}
const tag = (name, text) => { const e = document.createElement(name); e.textContent = text; return e; };
function packets() {
  const wanted = byId("filter").value.toLowerCase(), limit = 2000;
  const rows = run.packets.filter((p) => !wanted || p.slice(1).join(" ").toLowerCase().includes(wanted));
  byId("packet-count").textContent = rows.length > limit ? `first ${limit} of ${rows.length}` : `${rows.length}`;
  fill("packets", rows.slice(0, limit), (p) => [tag("i", p[1] === "c2r" ? "→ " : "← "), tag("b", p[2]), document.createTextNode(" " + p[3] + " "), tag("i", p[4])]);
}

// --- page ---------------------------------------------------------------
function draw() { byId("time").value = 1000 * view.at / end; drawMap(); drawSpeeds(); drawSonar(); drawPins(); }
byId("time").addEventListener("input", (e) => { view.at = end * e.target.value / 1000; draw(); });
byId("play").addEventListener("click", () => {
  view.playing = !view.playing; byId("play").textContent = view.playing ? "⏸" : "▶";
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
fill("log", run.events, (e) => [tag("i", e[1] + " "), tag("b", e[2]), document.createTextNode(" " + e[3])]);
fill("usart", run.usart, (u) => [document.createTextNode(u[1])]);
byId("filter").addEventListener("input", packets);
packets();
view.at = run.poses.length ? Math.min(end, run.poses[run.poses.length - 1][0]) : 0;
window.addEventListener("resize", draw);
draw();
