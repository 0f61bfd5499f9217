"use strict";
// Asks for the newest state, draws it, asks again: a slow browser only sees fewer of them.
const $ = (id) => document.getElementById(id);
const AXES = ["Fx", "Fy", "Fz", "Tx", "Ty", "Tz"], UNITS = ["N", "N", "N", "N m", "N m", "N m"];
const LEAST = [2, 2, 2, 0.1, 0.1, 0.1], WINDOW_S = 10;
const CHANNEL_PX = 200; // the field's unit: pixels of the 200 x 200 centre crop
let socket = null, chosen = 0, wish = "show", history = [], bitmap = null, latest = null;
window.drawn = 0; // states drawn, for tests

function connect() {
  socket = new WebSocket((location.protocol === "https:" ? "wss://" : "ws://") + location.host + "/ws");
  socket.binaryType = "blob";
  socket.onmessage = async (event) => {
    if (typeof event.data !== "string") {
      try { bitmap = await createImageBitmap(event.data); } catch { bitmap = null; } // a corrupt frame
      return;
    }
    const told = JSON.parse(event.data);
    if (told.hello) { begin(told); } else { latest = told; remember(told); requestAnimationFrame(() => { draw(told); }); }
    ask();
  };
  socket.onopen = () => ($("lost").style.display = "none");
  socket.onclose = () => { $("lost").style.display = "block"; setTimeout(connect, 1000); };
}

function ask() {
  const message = JSON.stringify({ do: wish, cap: chosen });
  wish = "show";
  if (socket.readyState === 1) socket.send(message);
}

function begin(told) {
  Scene.set(told.hello);
  history = told.hello.map(() => []);
  chosen = Math.min(chosen, told.hello.length - 1);
  $("caps").replaceChildren(...told.hello.map((cap, k) => {
    const card = document.createElement("button");
    card.className = "cap";
    card.innerHTML = '<div class="top"><span class="lamp"></span><b></b></div><div class="n"></div><div class="h"></div>';
    card.querySelector("b").textContent = cap.name;
    card.onclick = () => { chosen = k; bitmap = null; };
    return card;
  }));
  $("plots").replaceChildren(...AXES.map(() => Object.assign(document.createElement("canvas"), { width: 420, height: 190 })));
}

function remember(told) {
  told.caps.forEach((cap, k) => {
    if (!cap.force_n) return;
    const row = history[k], last = row[row.length - 1];
    if (last && cap.time_s < last.t) row.length = 0;
    if (!last || cap.time_s > last.t) row.push({ t: cap.time_s, w: cap.force_n.concat(cap.torque_nm), sd: cap.sd });
    while (row.length && row[0].t < cap.time_s - WINDOW_S) row.shift();
  });
}

function draw(told) {
  told.caps.forEach((cap, k) => card($("caps").children[k], cap, k));
  const sum = told.touching.length ? `; force sum ${told.force_sum_n} N` : "";
  const judged = told.consistent === null ? "" : told.consistent ? ", carries the weight" : ", does NOT carry the weight";
  $("robot").textContent = "touching: " + (told.touching.join(", ") || "none") + sum + judged;
  $("record").classList.toggle("on", told.recording);
  $("record").textContent = told.recording ? "Stop recording" : "Record";
  $("record_note").textContent = told.note;
  image(told.selected, told.caps[chosen]);
  Scene.draw($("scene"), told.caps, chosen);
  AXES.forEach((_, k) => plot($("plots").children[k], k));
  health(told.caps[chosen]);
  window.drawn += 1;
}

function card(element, cap, k) {
  element.classList.toggle("chosen", k === chosen);
  element.querySelector(".lamp").classList.toggle("touch", !!cap.contact);
  element.querySelector(".n").textContent = cap.force_n ? cap.force_norm_n.toFixed(1) + " N" : "–";
  const line = element.querySelector(".h"), flags = (cap.flags || []).join(", ");
  line.textContent = cap.message || flags || `${cap.rate_hz} Hz, ${cap.p50_ms} ms`;
  line.title = cap.message;
  line.classList.toggle("bad", !!(cap.message || flags));
}

function image(detail, cap) {
  const canvas = $("image"), g = canvas.getContext("2d");
  if (!detail || detail.number !== chosen) { g.fillStyle = "#000"; g.fillRect(0, 0, canvas.width, canvas.height); return; }
  const [w, h] = detail.size, s = canvas.width / w;
  if (Math.abs(canvas.height - h * s) > 1) canvas.height = Math.round(h * s);
  if (bitmap) g.drawImage(bitmap, 0, 0, canvas.width, canvas.height);
  g.fillStyle = "rgba(8,14,18,.25)"; g.fillRect(0, 0, canvas.width, canvas.height);
  for (const [x, y, quality] of detail.dots) {
    g.beginPath(); g.lineWidth = 2;
    if (quality < 0) { g.strokeStyle = "#57b6ff"; g.moveTo((x - 5) * s, (y - 5) * s); g.lineTo((x + 5) * s, (y + 5) * s); g.moveTo((x + 5) * s, (y - 5) * s); g.lineTo((x - 5) * s, (y + 5) * s); }
    else { g.strokeStyle = `hsl(${Math.max(0, Math.min(1, (quality - 0.6) / 0.4)) * 140},80%,55%)`; g.arc((x + 0.5) * s, (y + 0.5) * s, 9 * s, 0, 7); }
    g.stroke();
  }
  arrows(g, detail, s);
  $("image_note").textContent = detail.dots.length ? `${cap.dots} of ${cap.dots_known} dots` : "";
}

function arrows(g, detail, s) {
  const [w, h] = detail.size, side = Math.min(w, h), left = (w - side) / 2, top = (h - side) / 2;
  const [rows, columns, step] = detail.cells, unit = side / CHANNEL_PX;
  let most = 0.2;
  detail.field.flat().forEach((c) => { if (c) most = Math.max(most, Math.hypot(c[0], c[1]) / 100); });
  const gain = Math.min(6, 14 / most); // longest arrow: 14 of the 200 px
  g.lineWidth = 2.5; g.strokeStyle = "#ffe14d"; g.fillStyle = "#ffe14d";
  detail.field.forEach((row, i) => row.forEach((cell, j) => {
    if (!cell) return;
    const x = left + ((j * step + Math.floor(step / 2) + 0.5) * side) / columns, y = top + ((i * step + Math.floor(step / 2) + 0.5) * side) / rows;
    const u = (cell[0] / 100) * unit * gain, v = (cell[1] / 100) * unit * gain, size = Math.hypot(u, v);
    if (size < 1.5) { g.fillRect(x * s - 1, y * s - 1, 2, 2); return; }
    const turn = Math.atan2(v, u), X = (x + u) * s, Y = (y + v) * s, head = Math.min(9, 3 + size * 0.4) * s;
    g.beginPath(); g.moveTo(x * s, y * s); g.lineTo(X, Y);
    for (const k of [-1, 1]) { g.moveTo(X, Y); g.lineTo(X - head * Math.cos(turn + k * 0.45), Y - head * Math.sin(turn + k * 0.45)); }
    g.stroke();
  }));
}

function plot(canvas, axis) {
  const g = canvas.getContext("2d"), W = canvas.width, H = canvas.height, rows = history[chosen];
  g.fillStyle = "#11181d"; g.fillRect(0, 0, W, H);
  if (!rows || !rows.length) return;
  const end = rows[rows.length - 1].t;
  let top = LEAST[axis];
  rows.forEach((r) => (top = Math.max(top, Math.abs(r.w[axis]) * 1.15)));
  const X = (t) => W * (1 - (end - t) / WINDOW_S), Y = (v) => H / 2 - (v / top) * (H / 2 - 8);
  g.strokeStyle = "#34424c"; g.beginPath(); g.moveTo(0, H / 2); g.lineTo(W, H / 2); g.stroke();
  const known = rows.filter((r) => r.sd[axis] !== null);
  g.fillStyle = "rgba(87,182,255,.28)"; g.beginPath();
  known.forEach((r, k) => g[k ? "lineTo" : "moveTo"](X(r.t), Y(r.w[axis] + 2 * r.sd[axis])));
  known.slice().reverse().forEach((r) => g.lineTo(X(r.t), Y(r.w[axis] - 2 * r.sd[axis])));
  g.closePath(); g.fill();
  g.strokeStyle = "#57b6ff"; g.lineWidth = 2; g.beginPath();
  rows.forEach((r, k) => g[k ? "lineTo" : "moveTo"](X(r.t), Y(r.w[axis])));
  g.stroke();
  const digits = axis < 3 ? 1 : 2;
  g.fillStyle = "#e4ebef"; g.font = "22px system-ui,sans-serif"; g.textAlign = "left";
  g.fillText(`${AXES[axis]} ${rows[rows.length - 1].w[axis].toFixed(digits)} ${UNITS[axis]}`, 8, 24);
  g.fillStyle = "#8fa1ad"; g.font = "17px system-ui,sans-serif"; g.textAlign = "right";
  g.fillText("±" + top.toFixed(digits), W - 8, 22);
}

function health(cap) {
  const stages = Object.entries(cap.stage_ms).map(([name, ms]) => `${name} ${ms}`).join(", ");
  const rows = [
    ["state", cap.message || cap.status], ["rate", `${cap.rate_hz} Hz`], ["age of the picture", `${cap.age_ms ?? "–"} ms`],
    ["image to wrench", `${cap.p50_ms ?? "–"} ms median, ${cap.p99_ms ?? "–"} ms at 99 %`], ["stages, ms", stages],
    ["dropped, unusable", `${cap.dropped}, ${cap.faults}`], ["dots", cap.dots_known ? `${cap.dots} of ${cap.dots_known}` : "not used"],
    ["drift since zero", cap.drift || "unknown"], ["warnings", (cap.flags || []).join(", ") || "none"],
  ];
  $("health").replaceChildren(...rows.map(([name, value]) => {
    const row = document.createElement("tr");
    for (const text of [name, value]) row.appendChild(document.createElement("td")).textContent = text;
    return row;
  }));
}

for (const id of ["zero", "zero_all", "record"]) $(id).onclick = () => (wish = id);
Scene.drag($("scene"));
connect();
