"use strict";
// The robot as estimated, and as it truly is where that is known; world frame, m, z up.
// Asks for the newest state ten times a second.
const $ = (id) => document.getElementById(id);
const STATES = ["holds", "rolls", "slips", "free", "unknown"];
const ASK_MS = 100;
const LOST_MS = 1500;
let about = null;
let state = null;
let heard_ms = 0;

function draw_drift() {
  const { g, width, height } = fitted($("drift"));
  const rows = state.drift;
  const left = 46;
  const bottom = height - 20;
  g.fillStyle = colour("dim");
  g.font = "12px system-ui";
  if (!rows.length) {
    g.textAlign = "center";
    g.fillText("no truth to compare with", width / 2, height / 2);
    return;
  }
  const end = rows[rows.length - 1][0];
  const begin = Math.min(rows[0][0], end - 5);
  const most = Math.max(0.02, ...rows.map((r) => Math.max(r[1], 2 * r[2]))) * 1.05;
  const x = (t) => left + ((t - begin) / (end - begin)) * (width - left - 8);
  const y = (d) => bottom - (d / most) * (bottom - 8);
  g.textAlign = "right";
  for (const share of [0, 0.5, 1]) {
    const d = share * most;
    const ends = [left, width - 8].map((across) => [across, y(d)]);
    line(g, ends, "grid");
    g.fillText(d.toFixed(3), left - 6, y(d) + 4);
  }
  g.fillStyle = colour("band");
  g.beginPath();
  g.moveTo(x(rows[0][0]), bottom);
  rows.forEach((r) => g.lineTo(x(r[0]), y(2 * r[2])));
  g.lineTo(x(end), bottom);
  g.fill();
  const drift = rows.map((r) => [x(r[0]), y(r[1])]);
  line(g, drift, "accent", 2);
  g.fillStyle = colour("dim");
  g.textAlign = "left";
  g.fillText(`${begin.toFixed(0)} s`, left, height - 4);
  g.textAlign = "right";
  g.fillText(`${end.toFixed(1)} s`, width - 8, height - 4);
}

const number = (value, digits, unit = "") => (value === null ? "-" : value.toFixed(digits) + unit);
function row(endcap) {
  const force = endcap.force_n[0] === null ? null : Math.hypot(...endcap.force_n);
  const likely = endcap[endcap.state];
  const cells = [
    endcap.name,
    endcap.state,
    likely === undefined ? "-" : number(100 * likely, 0, " %"),
    number(force, 1),
    number(endcap.friction_ratio, 2),
  ];
  const tr = document.createElement("tr");
  cells.forEach((text, k) => {
    const td = document.createElement(k ? "td" : "th");
    td.textContent = text;
    if (k === 1) td.style.color = colour(endcap.state);
    if (!k) td.scope = "row";
    tr.append(td);
  });
  return tr;
}

function draw() {
  if (!state || !about) return;
  draw_scene($("scene"), about, state);
  draw_drift();
  $("rows").replaceChildren(...state.endcaps.map(row));
  const share =
    state.path_m > 0.5 && state.drift_m !== null
      ? `, ${((100 * state.drift_m) / state.path_m).toFixed(1)} % of the path`
      : "";
  $("status").textContent =
    `${state.time_s.toFixed(1)} s, path ${state.path_m.toFixed(2)} m` +
    (state.drift_m === null ? "" : `, off by ${state.drift_m.toFixed(3)} m${share}`);
  const with_sd = (value, sd) => `${number(value, 2)} ± ${number(sd, 2)}`;
  $("numbers").textContent = [
    `friction ${with_sd(state.friction, state.friction_sd)}`,
    `softness ${with_sd(state.softness, state.softness_sd)}`,
    `carried ${number(state.health.weight_ratio, 2)} of the weight`,
  ].join("; ");
  $("notes").replaceChildren(
    ...state.health.notes.map((note) => Object.assign(document.createElement("li"), { textContent: note })),
  );
}

async function ask() {
  try {
    if (!about) about = await (await fetch("about.json")).json();
    const reported = await (await fetch("state.json")).json();
    if (reported) {
      state = reported;
      heard_ms = performance.now();
      draw();
    }
  } catch (error) {
    /* said below */
  }
  const lost = heard_ms > 0 && performance.now() - heard_ms > LOST_MS;
  document.body.classList.toggle("lost", lost);
  if (lost)
    $("status").textContent =
      `no answer for ${((performance.now() - heard_ms) / 1000).toFixed(0)} s: has the run ended?`;
  setTimeout(ask, ASK_MS);
}

function moved(turn, tilt, zoom) {
  view.turn += turn;
  view.tilt = Math.min(1.5, Math.max(0.02, view.tilt + tilt));
  view.zoom = Math.min(5, Math.max(0.3, view.zoom * zoom));
  draw();
}

let held = null; // place of the pointer that turns the robot
$("scene").addEventListener("pointerdown", (e) => {
  held = [e.clientX, e.clientY];
  e.target.setPointerCapture(e.pointerId);
});
$("scene").addEventListener("pointermove", (e) => {
  if (held) {
    moved((e.clientX - held[0]) / 150, (e.clientY - held[1]) / 150, 1);
    held = [e.clientX, e.clientY];
  }
});
$("scene").addEventListener("pointerup", () => {
  held = null;
});
$("scene").addEventListener(
  "wheel",
  (e) => {
    e.preventDefault();
    moved(0, 0, Math.exp(-e.deltaY / 600));
  },
  { passive: false },
);
$("scene").addEventListener("keydown", (e) => {
  const step = {
    ArrowLeft: [-0.1, 0, 1],
    ArrowRight: [0.1, 0, 1],
    ArrowUp: [0, 0.1, 1],
    ArrowDown: [0, -0.1, 1],
    "+": [0, 0, 1.15],
    "-": [0, 0, 1 / 1.15],
  }[e.key];
  if (e.key === "0") {
    Object.assign(view, { turn: 0.6, tilt: 0.45, zoom: 1 });
    draw();
  } else if (step) {
    e.preventDefault();
    moved(...step);
  }
});

function explain(text, name, sign) {
  const span = document.createElement("span");
  const mark = document.createElement("b");
  mark.textContent = `${sign} `;
  mark.style.color = `var(--${name})`;
  span.append(mark, text);
  $("legend").append(span, " ");
}
for (const name of STATES) explain(name, name, "\u25cf");
explain("force on the endcap", "force", "\u2014");
explain("path", "accent", "\u2014");
explain("the truth, where it is known", "truth", "- -");
explain("two standard deviations of the centre of mass", "accent", "\u25cb");
ask();
