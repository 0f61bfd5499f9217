"use strict";
// The robot as estimated, and as it truly is where that is known; world frame, m, z up. Asks for the newest state ten times a second.
const $ = (id) => document.getElementById(id), STATES = ["holds", "rolls", "slips", "free", "unknown"];
const view = { turn: 0.6, tilt: 0.45, zoom: 1 }, ASK_MS = 100, LOST_MS = 1500;
const labels = [];
let about = null, state = null, heard_ms = 0;
const colour = (name) => getComputedStyle(document.documentElement).getPropertyValue(`--${name}`).trim();
const place = (T, p) => [0, 1, 2].map((i) => T[i][0] * p[0] + T[i][1] * p[1] + T[i][2] * p[2] + T[i][3]);

function fitted(canvas) {
  const ratio = window.devicePixelRatio || 1, width = canvas.clientWidth, height = canvas.clientHeight;
  if (canvas.width !== Math.round(width * ratio)) canvas.width = Math.round(width * ratio);
  if (canvas.height !== Math.round(height * ratio)) canvas.height = Math.round(height * ratio);
  const g = canvas.getContext("2d");
  g.setTransform(ratio, 0, 0, ratio, 0, 0); g.clearRect(0, 0, width, height);
  return { g, width, height };
}

function line(g, points, name, width = 1, dash = []) {
  g.strokeStyle = colour(name); g.lineWidth = width; g.setLineDash(dash); g.beginPath();
  points.forEach((p, k) => (k ? g.lineTo(p[0], p[1]) : g.moveTo(p[0], p[1])));
  g.stroke(); g.setLineDash([]);
}

function draw_scene() {
  const { g, width, height } = fitted($("scene")), middle = state.centre_of_mass_m, scale = (Math.min(width, height) / 1.9) * view.zoom;
  const [st, ct, sp, cp] = [Math.sin(view.turn), Math.cos(view.turn), Math.sin(view.tilt), Math.cos(view.tilt)];
  const eye = (p) => {
    const x = p[0] - middle[0], y = p[1] - middle[1], z = p[2] - middle[2], across = ct * x - st * y, deep = st * x + ct * y;
    return [width / 2 + scale * across, height / 2 - scale * (cp * z + sp * deep)];
  };
  const low = state.ground_m, x0 = Math.round(middle[0] * 2) / 2, y0 = Math.round(middle[1] * 2) / 2;
  for (let k = -4; k <= 4; k++) {
    line(g, [eye([x0 + k / 2, y0 - 2, low]), eye([x0 + k / 2, y0 + 2, low])], "grid");
    line(g, [eye([x0 - 2, y0 + k / 2, low]), eye([x0 + 2, y0 + k / 2, low])], "grid");
  }
  if (state.true_path.length) line(g, state.true_path.map((p) => eye([p[0], p[1], low])), "truth", 2, [5, 4]);
  line(g, state.path.map((p) => eye([p[0], p[1], low])), "accent", 2);
  g.fillStyle = colour("band"); g.beginPath();
  state.ellipse.forEach((p, k) => { const q = eye([p[0], p[1], low]); k ? g.lineTo(q[0], q[1]) : g.moveTo(q[0], q[1]); });
  g.fill(); line(g, [...state.ellipse, state.ellipse[0]].map((p) => eye([p[0], p[1], low])), "accent");
  if (state.truth) about.bars.forEach((bar, k) => line(g, bar_ends(state.truth[k], bar).map(eye), "truth", 3, [6, 5]));
  about.cables.forEach((c) => line(g, [0, 1].map((e) => eye(place(state.bars[c.bars[e]].T_world_bar, c.points_m[e]))), "dim", 1));
  about.bars.forEach((bar, k) => line(g, bar_ends(state.bars[k].T_world_bar, bar).map(eye), "text", 4));
  state.endcaps.forEach((endcap, k) => {
    const at = eye(endcap.centre_m), radius = about.radius_m[k] * scale, known = endcap.state !== "unknown";
    g.fillStyle = colour(endcap.state); g.globalAlpha = known && endcap.state !== "free" ? 0.75 : 0.3;
    g.beginPath(); g.arc(at[0], at[1], radius, 0, 7); g.fill(); g.globalAlpha = 1;
    g.strokeStyle = colour(endcap.state); g.lineWidth = 1.5; g.stroke();
    if (endcap.force_n[0] !== null && endcap.contact_m[0] !== null) {
      const from = endcap.contact_m, to = from.map((v, i) => v + endcap.force_n[i] / 200);
      line(g, [eye(from), eye(to)], "force", 3);
    }
  });
  draw_labels(g, state.endcaps.map((endcap) => eye(endcap.centre_m)), about.radius_m.map((r) => r * scale), width, height);
}

// Each label beside its endcap, where it covers no other label and no other endcap: below where it touches, else above, right, left.
function draw_labels(g, centres, radii, width, height) {
  const boxes = centres.map(([x, y], k) => ({ k, x0: x - radii[k], x1: x + radii[k], y0: y - radii[k], y1: y + radii[k] }));
  const covered = (a, b) => Math.max(0, Math.min(a.x1, b.x1) - Math.max(a.x0, b.x0)) * Math.max(0, Math.min(a.y1, b.y1) - Math.max(a.y0, b.y0));
  const inside = { x0: 0, x1: width, y0: 0, y1: height };
  g.font = "12px system-ui"; g.textAlign = "center"; g.textBaseline = "middle"; g.lineJoin = "round"; g.lineWidth = 4;
  g.strokeStyle = colour("card"); g.fillStyle = colour("text"); labels.length = 0;
  state.endcaps.forEach((endcap, k) => {
    const text = `${endcap.name} ${endcap.state}`, half = g.measureText(text).width / 2 + 2, [x, y] = centres[k], away = radii[k] + 11, side = radii[k] + half + 4;
    const below = [x, y + away], above = [x, y - away], beside = [[x + side, y], [x - side, y], [x + side, y + away], [x - side, y + away], [x + side, y - away], [x - side, y - away], [x, y + away + 17], [x, y - away - 17]];
    const found = [...(endcap.contact_m[0] === null ? [above, below] : [below, above]), ...beside].map(([cx, cy]) => {
      const box = { k, text, x: cx, y: cy, x0: cx - half, x1: cx + half, y0: cy - 8, y1: cy + 8 };
      return [4 * half * 8 - covered(box, inside) + [...boxes, ...labels].reduce((sum, b) => sum + (b.text ? 20 : b.k !== k) * covered(box, b), 0), box];
    });
    labels.push(found.reduce((best, each) => (each[0] < best[0] - 1 ? each : best))[1]);
  });
  for (const each of labels) { g.strokeText(each.text, each.x, each.y); g.fillText(each.text, each.x, each.y); }
  g.textBaseline = "alphabetic";
}

const bar_ends = (T, bar) => [-1, 1].map((side) => place(T, [0, 0, (side * bar.length_m) / 2]));

function draw_drift() {
  const { g, width, height } = fitted($("drift")), rows = state.drift, left = 46, bottom = height - 20;
  g.fillStyle = colour("dim"); g.font = "12px system-ui";
  if (!rows.length) { g.textAlign = "center"; g.fillText("no truth to compare with", width / 2, height / 2); return; }
  const end = rows[rows.length - 1][0], begin = Math.min(rows[0][0], end - 5), most = Math.max(0.02, ...rows.map((r) => Math.max(r[1], 2 * r[2]))) * 1.05;
  const x = (t) => left + ((t - begin) / (end - begin)) * (width - left - 8), y = (d) => bottom - (d / most) * (bottom - 8);
  g.textAlign = "right";
  for (const share of [0, 0.5, 1]) { const d = share * most; line(g, [[left, y(d)], [width - 8, y(d)]], "grid"); g.fillText(d.toFixed(3), left - 6, y(d) + 4); }
  g.fillStyle = colour("band"); g.beginPath(); g.moveTo(x(rows[0][0]), bottom);
  rows.forEach((r) => g.lineTo(x(r[0]), y(2 * r[2]))); g.lineTo(x(end), bottom); g.fill();
  line(g, rows.map((r) => [x(r[0]), y(r[1])]), "accent", 2);
  g.fillStyle = colour("dim"); g.textAlign = "left"; g.fillText(`${begin.toFixed(0)} s`, left, height - 4);
  g.textAlign = "right"; g.fillText(`${end.toFixed(1)} s`, width - 8, height - 4);
}

const number = (value, digits, unit = "") => (value === null ? "-" : value.toFixed(digits) + unit);
function row(endcap) {
  const force = endcap.force_n[0] === null ? null : Math.hypot(...endcap.force_n), likely = endcap[endcap.state];
  const cells = [endcap.name, endcap.state, likely === undefined ? "-" : number(100 * likely, 0, " %"), number(force, 1), number(endcap.friction_ratio, 2)];
  const tr = document.createElement("tr");
  cells.forEach((text, k) => { const td = document.createElement(k ? "td" : "th"); td.textContent = text; if (k === 1) td.style.color = colour(endcap.state); if (!k) td.scope = "row"; tr.append(td); });
  return tr;
}

function draw() {
  if (!state || !about) return;
  draw_scene(); draw_drift();
  $("rows").replaceChildren(...state.endcaps.map(row));
  const share = state.path_m > 0.5 && state.drift_m !== null ? `, ${((100 * state.drift_m) / state.path_m).toFixed(1)} % of the path` : "";
  $("status").textContent = `${state.time_s.toFixed(1)} s, path ${state.path_m.toFixed(2)} m` + (state.drift_m === null ? "" : `, off by ${state.drift_m.toFixed(3)} m${share}`);
  $("numbers").textContent = `friction ${number(state.friction, 2)} ± ${number(state.friction_sd, 2)}; softness ${number(state.softness, 2)} ± ${number(state.softness_sd, 2)}; carried ${number(state.health.weight_ratio, 2)} of the weight`;
  $("notes").replaceChildren(...state.health.notes.map((note) => Object.assign(document.createElement("li"), { textContent: note })));
}

async function ask() {
  try {
    if (!about) about = await (await fetch("about.json")).json();
    const reported = await (await fetch("state.json")).json();
    if (reported) { state = reported; heard_ms = performance.now(); draw(); }
  } catch (error) { /* said below */ }
  const lost = heard_ms > 0 && performance.now() - heard_ms > LOST_MS;
  document.body.classList.toggle("lost", lost);
  if (lost) $("status").textContent = `no answer for ${((performance.now() - heard_ms) / 1000).toFixed(0)} s: has the run ended?`;
  setTimeout(ask, ASK_MS);
}

function moved(turn, tilt, zoom) {
  view.turn += turn; view.tilt = Math.min(1.5, Math.max(0.02, view.tilt + tilt)); view.zoom = Math.min(5, Math.max(0.3, view.zoom * zoom)); draw();
}
let held = null;
$("scene").addEventListener("pointerdown", (e) => { held = [e.clientX, e.clientY]; e.target.setPointerCapture(e.pointerId); });
$("scene").addEventListener("pointermove", (e) => { if (held) { moved((e.clientX - held[0]) / 150, (e.clientY - held[1]) / 150, 1); held = [e.clientX, e.clientY]; } });
$("scene").addEventListener("pointerup", () => { held = null; });
$("scene").addEventListener("wheel", (e) => { e.preventDefault(); moved(0, 0, Math.exp(-e.deltaY / 600)); }, { passive: false });
$("scene").addEventListener("keydown", (e) => {
  const step = { ArrowLeft: [-0.1, 0, 1], ArrowRight: [0.1, 0, 1], ArrowUp: [0, 0.1, 1], ArrowDown: [0, -0.1, 1], "+": [0, 0, 1.15], "-": [0, 0, 1 / 1.15] }[e.key];
  if (e.key === "0") { Object.assign(view, { turn: 0.6, tilt: 0.45, zoom: 1 }); draw(); } else if (step) { e.preventDefault(); moved(...step); }
});
function explain(text, name, sign) {
  const span = document.createElement("span"), mark = document.createElement("b");
  mark.textContent = `${sign} `; mark.style.color = `var(--${name})`; span.append(mark, text); $("legend").append(span, " ");
}
for (const name of STATES) explain(name, name, "\u25cf");
explain("force on the endcap", "force", "\u2014");
explain("path", "accent", "\u2014");
explain("the truth, where it is known", "truth", "- -");
explain("two standard deviations of the centre of mass", "accent", "\u25cb");
ask();
