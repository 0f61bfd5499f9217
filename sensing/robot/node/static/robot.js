"use strict";
// The robot as estimated, and as it truly is where that is known; world frame, m, z up.
// Asks for the newest state ten times a second.
const $ = (id) => document.getElementById(id);
const STATES = ["holds", "rolls", "slips", "free", "unknown"];
const ASK_MS = 100;
const LOST_MS = 1500;
const DEAD_MS = 10000; // after which a question is asked anew: its connection leads nowhere
const WATCH_MS = 250;
let about = null;
let state = null;
let heard_ms = 0;

function draw_drift() {
  const [g, width, height] = Draw.begin($("drift"));
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

const number = (value, digits, unit = "") =>
  value === null ? "-" : value.toFixed(digits).replace(/^-(?=[0.]+$)/, "") + unit; // no -0.00
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
    const signal = AbortSignal.timeout(DEAD_MS);
    if (!about) about = await (await fetch("about.json", { signal })).json();
    const reported = await (await fetch("state.json", { signal })).json();
    if (reported) {
      state = reported;
      heard_ms = performance.now();
      draw();
    }
  } catch (error) {
    about = null; // who answers next may be the run of another robot
  }
  watch();
  setTimeout(ask, ASK_MS);
}

// Says that no answer comes, also while a question waits for one: a run that hangs refuses nothing.
function watch() {
  const silent_ms = performance.now() - heard_ms;
  const lost = heard_ms > 0 && silent_ms > LOST_MS;
  document.body.classList.toggle("lost", lost);
  if (lost) $("status").textContent = `no answer for ${(silent_ms / 1000).toFixed(0)} s: has the run ended?`;
}

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
Draw.hand($("scene"), view, () => {
  draw();
  watch();
});
setInterval(watch, WATCH_MS);
ask();
