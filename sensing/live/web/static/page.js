"use strict";
// Asks for the newest state, draws it, asks again: a slow browser only sees fewer of them.
const $ = (id) => document.getElementById(id);
const AXES = ["Fx", "Fy", "Fz", "Tx", "Ty", "Tz"], UNITS = ["N", "N", "N", "N m", "N m", "N m"];
const LEAST = [2, 2, 2, 0.1, 0.1, 0.1], WINDOW_S = 10;
const CHANNEL_PX = 200; // the field's unit: pixels of the 200 x 200 centre crop
const QUIET_MS = 1000; // no answer for so long: what is shown is old
let socket = null, chosen = 0, history = [], bitmap = null, latest = null, answeredAt = -Infinity, unanswered = 0, asked = null, weighed = [];
const declined = new Set(); // endcaps whose refusal was read
window.drawn = 0; window.shown = null; // states drawn, and the last of them, for tests

function connect() {
  socket = new WebSocket((location.protocol === "https:" ? "wss://" : "ws://") + location.host + "/ws");
  socket.binaryType = "blob";
  unanswered = 0;
  socket.onmessage = async (event) => {
    if (typeof event.data !== "string") {
      try { bitmap = await createImageBitmap(event.data); } catch { bitmap = null; } // a damaged picture
      return;
    }
    const news = JSON.parse(event.data);
    if (news.hello) begin(news);
    else { unanswered -= 1; latest = news; answeredAt = performance.now(); remember(news); watch(); requestAnimationFrame(() => draw(news)); }
    if (unanswered <= 0) send("show");
  };
  socket.onclose = () => { watch(); setTimeout(connect, 1000); };
}

function send(word) {
  if (socket.readyState !== 1) return;
  unanswered += 1;
  socket.send(JSON.stringify({ do: word, endcap: chosen, seen: latest ? latest.seen : 0 }));
}

// Whether what is shown is of now: it is not when the run is stopped, or the server or the connection gone.
function live() { return latest !== null && socket.readyState === 1 && performance.now() - answeredAt < QUIET_MS; }

// A button acts now or never: nothing is kept for later.
function press(word) {
  watch();
  if (!live()) return;
  close_question();
  const endcap = latest.endcaps[chosen];
  if (word === "zero" && endcap.contact) question(`${endcap.name} is touched (${endcap.force_norm_n.toFixed(1)} N): a reference taken now makes every later number wrong by that.`);
  else send(word);
}

function question(text) { asked = chosen; $("question").textContent = text; $("ask").classList.add("open"); }
function close_question() { asked = null; $("ask").classList.remove("open"); }

// Greys everything out, with its age, and switches the buttons off while there is no answer.
function watch() {
  const good = live(), age = Math.round((performance.now() - answeredAt) / 1000);
  document.body.classList.toggle("stale", !good);
  $("lost").textContent = latest === null ? "No connection to sensing.live; trying again." : `No answer from sensing.live for ${age} s: everything below is as old as that.`;
  if (!good) close_question();
  const endcap = good ? latest.endcaps[chosen] : null;
  for (const id of ["zero", "zero_all", "record", "confirm"]) $(id).disabled = !good;
  $("undo").disabled = !(endcap && endcap.undoable);
  if (!good && latest) {
    $("robot").textContent = `unknown; touching ${age} s ago: ${latest.touching.join(", ") || "none"}`;
    if ($("health").rows.length) $("health").rows[0].cells[1].textContent = `unknown; ${latest.endcaps[chosen].status} ${age} s ago`;
    [...$("endcaps").children].forEach((card, k) => {
      const force = latest.endcaps[k].force_norm_n;
      card.querySelector(".n").textContent = "–";
      card.querySelector(".h").textContent = (force === null ? latest.endcaps[k].status : force.toFixed(1) + " N") + `, ${age} s ago`;
    });
  }
}

function begin(shown) {
  Scene.set(shown.hello);
  weighed = shown.hello.map((endcap) => endcap.weighed);
  history = shown.hello.map(() => ({ rows: [], gap: false, behind: 0 }));
  chosen = Math.min(chosen, shown.hello.length - 1);
  $("endcaps").replaceChildren(...shown.hello.map((endcap, k) => {
    const card = document.createElement("button");
    card.className = "endcap";
    card.innerHTML = '<div class="top"><span class="lamp"></span><b></b></div><div class="n"></div><div class="h"></div>';
    card.querySelector("b").textContent = endcap.name;
    card.onclick = () => { chosen = k; bitmap = null; close_question(); };
    return card;
  }));
  $("plots").replaceChildren(...AXES.map(() => Object.assign(document.createElement("canvas"), { width: 420, height: 190, role: "img" })));
}

// Rows of the plots; behind: from the frames' clock to the run's, so that plots move on while no number comes.
function remember(shown) {
  shown.endcaps.forEach((endcap, k) => {
    const kept = history[k], rows = kept.rows, last = rows[rows.length - 1];
    if (!endcap.valid) kept.gap = true;
    else {
      if (last && endcap.time_s < last.t) rows.length = 0;
      if (!last || endcap.time_s > last.t) {
        rows.push({ t: endcap.time_s, w: endcap.force_n.concat(endcap.torque_nm), sd: endcap.sd, first: kept.gap || !last });
        kept.gap = false;
      }
      kept.behind = shown.time_s - endcap.time_s;
    }
    while (rows.length && rows[0].t < shown.time_s - kept.behind - WINDOW_S) rows.shift();
  });
}

function draw(shown) {
  if (!live()) return;
  if (asked !== null && asked !== chosen) close_question();
  const refused = shown.endcaps[chosen];
  if (!refused.confirmable) declined.delete(chosen);
  else if (asked === null && !declined.has(chosen)) question(refused.message || `${refused.name} looked pressed when it was zeroed.`);
  shown.endcaps.forEach((endcap, k) => card($("endcaps").children[k], endcap, k));
  const sum = shown.touching.length ? `; force sum ${shown.force_sum_n} N` : "";
  const judged = shown.consistent === null ? "" : shown.consistent ? ", carries the weight" : ", does NOT carry the weight";
  $("robot").textContent = "touching: " + (shown.touching.join(", ") || "none") + sum + judged;
  $("record").classList.toggle("on", shown.recording);
  $("record").textContent = shown.recording ? "Stop recording" : "Start recording";
  $("record_note").textContent = shown.note;
  image(shown.selected, shown.endcaps[chosen]);
  Scene.draw($("scene"), shown.endcaps, chosen);
  AXES.forEach((_, k) => plot($("plots").children[k], k, shown.time_s, shown.endcaps[chosen]));
  health(shown.endcaps[chosen]);
  window.drawn += 1; window.shown = shown;
}

function card(element, endcap, k) {
  element.classList.toggle("chosen", k === chosen);
  element.querySelector(".lamp").classList.toggle("touch", !!endcap.contact);
  const number = element.querySelector(".n"), line = element.querySelector(".h"), flags = endcap.flags.join(", ");
  number.textContent = endcap.valid ? endcap.force_norm_n.toFixed(1) + " N" : "–";
  number.classList.toggle("none", !endcap.valid);
  line.textContent = endcap.valid ? endcap.message || flags || `${endcap.rate_hz} Hz, ${endcap.p50_ms} ms` : `${endcap.status}: ${endcap.message}`;
  line.title = line.textContent;
  line.classList.toggle("bad", endcap.level > 1);
  line.classList.toggle("warn", endcap.level === 1);
}

function image(detail, endcap) {
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
  if (detail.field.length) arrows(g, detail, s);
  $("image_note").textContent = detail.preview !== undefined ? detail.preview : detail.dots.length ? `${endcap.dots} of ${endcap.dots_known} dots` : "";
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

function plot(canvas, axis, now_s, endcap) {
  const g = canvas.getContext("2d"), W = canvas.width, H = canvas.height, { rows, behind } = history[chosen];
  g.fillStyle = "#11181d"; g.fillRect(0, 0, W, H);
  let top = LEAST[axis];
  rows.forEach((r) => (top = Math.max(top, Math.abs(r.w[axis]) * 1.15)));
  const X = (t) => W * (1 - (now_s - behind - t) / WINDOW_S), Y = (v) => H / 2 - (v / top) * (H / 2 - 8);
  g.strokeStyle = "#34424c"; g.beginPath(); g.moveTo(0, H / 2); g.lineTo(W, H / 2); g.stroke();
  const pieces = [];
  rows.forEach((r) => { if (r.first || !pieces.length) pieces.push([]); pieces[pieces.length - 1].push(r); });
  for (const piece of pieces) { // nothing is drawn where there was no number
    const known = piece.filter((r) => r.sd[axis] !== null);
    g.fillStyle = "rgba(87,182,255,.28)"; g.beginPath();
    known.forEach((r, k) => g[k ? "lineTo" : "moveTo"](X(r.t), Y(r.w[axis] + 2 * r.sd[axis])));
    known.slice().reverse().forEach((r) => g.lineTo(X(r.t), Y(r.w[axis] - 2 * r.sd[axis])));
    g.closePath(); g.fill();
    g.strokeStyle = "#57b6ff"; g.lineWidth = 2; g.beginPath();
    piece.forEach((r, k) => g[k ? "lineTo" : "moveTo"](X(r.t), Y(r.w[axis])));
    g.stroke();
  }
  const digits = axis < 3 ? 1 : 2, value = endcap.valid ? endcap.force_n.concat(endcap.torque_nm)[axis] : null;
  const text = `${AXES[axis]} ${value === null ? "–" : value.toFixed(digits)} ${UNITS[axis]}`;
  canvas.setAttribute("aria-label", text);
  g.fillStyle = "#e4ebef"; g.font = "22px system-ui,sans-serif"; g.textAlign = "left";
  g.fillText(text, 8, 24);
  g.fillStyle = "#8fa1ad"; g.font = "17px system-ui,sans-serif"; g.textAlign = "right";
  g.fillText("±" + top.toFixed(digits), W - 8, 22);
}

function health(endcap) {
  const stages = Object.entries(endcap.stage_ms).map(([name, ms]) => `${name} ${ms}`).join(", ");
  const rows = [
    ["state", endcap.message ? `${endcap.status}: ${endcap.message}` : endcap.status], ["zeroed", zeroed(endcap)], ["stiffness", weighed[chosen] || "not calibrated by weight"], ["rate", `${endcap.rate_hz} Hz`], ["age of the picture", `${endcap.age_ms ?? "–"} ms`],
    ["image to wrench", `${endcap.p50_ms ?? "–"} ms median, ${endcap.p99_ms ?? "–"} ms at 99 %`], ["stages, ms", stages],
    ["dropped, unusable, reopened", `${endcap.dropped}, ${endcap.faults}, ${endcap.reopened}`], ["dots", endcap.dots_known ? `${endcap.dots} of ${endcap.dots_known}` : "not used"],
    ["drift since zero", endcap.drift || "unknown"], ["warnings", (endcap.flags || []).join(", ") || "none"],
  ];
  $("health").replaceChildren(...rows.map(([name, value]) => {
    const row = document.createElement("tr");
    for (const text of [name, value]) row.appendChild(document.createElement("td")).textContent = text;
    return row;
  }));
}

function zeroed(endcap) {
  if (!endcap.zeroed) return "not yet";
  const when = new Date(endcap.zeroed), minutes = Math.floor((Date.now() - when) / 60000);
  const ago = minutes < 1 ? "less than a minute" : minutes < 120 ? `${minutes} min` : minutes < 2880 ? `${Math.floor(minutes / 60)} h` : `${Math.floor(minutes / 1440)} days`;
  return `${when.toLocaleString()} (${ago} ago)`;
}

for (const id of ["zero", "zero_all", "undo"]) $(id).onclick = () => press(id);
$("record").onclick = () => press(latest && latest.recording ? "record_stop" : "record_start");
$("confirm").onclick = () => press("zero_confirmed");
$("cancel").onclick = () => { declined.add(chosen); close_question(); };
setInterval(watch, 250);
Scene.drag($("scene"));
connect();
