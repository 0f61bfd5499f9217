"use strict";
// Asks for the newest state, draws it, asks again: a slow browser only sees fewer of them.
const $ = (id) => document.getElementById(id);
const CHANNEL_PX = 200; // the field's unit: pixels of the 200 x 200 centre crop
const QUIET_MS = 1000; // no answer for so long: what is shown is old
const DEAD_MS = 5000; // no answer for so long: the connection may lead nowhere, and no browser says so for minutes
const RETRY_MS = 1000; // after a connection was refused or closed
const KEPT = "endcap chosen"; // in the browser's storage, so that a reload shows the same endcap
let socket = null, chosen = 0, names = [], bitmap = null, latest = null, answeredAt = -Infinity, unanswered = 0, asked = null, weighed = [], corrected = [], weight_n = 0, sought = null, kinds = null, begun_s = null, retryAt = Infinity, focused = null;
const SWITCHED = ["zero", "zero_all", "confirm", "record", "play", "seek", "loop", "speed", "note_add"]; // off while there is no answer
const declined = new Set(); // endcaps whose refusal was read
window.drawn = 0; window.shown = null; // states drawn, and the last of them, for tests

function connect() {
  if (socket) { socket.onmessage = socket.onclose = null; socket.close(); }
  retryAt = performance.now() + DEAD_MS;
  socket = new WebSocket((location.protocol === "https:" ? "wss://" : "ws://") + location.host + "/ws");
  socket.binaryType = "blob";
  unanswered = 0;
  socket.onmessage = async (event) => {
    retryAt = performance.now() + DEAD_MS;
    if (typeof event.data !== "string") {
      const last = bitmap;
      try { bitmap = await createImageBitmap(event.data); } catch { bitmap = null; } // a damaged picture
      if (last) last.close(); // its memory, of which the browser's collector knows nothing
      return;
    }
    const news = JSON.parse(event.data);
    if (news.hello) begin(news);
    else { unanswered -= 1; latest = news; answeredAt = performance.now(); Plots.remember(news); watch(); requestAnimationFrame(() => draw(news)); }
    if (unanswered <= 0) send("show");
  };
  socket.onclose = () => { retryAt = performance.now() + RETRY_MS; watch(); };
}

function send(word, more = {}) {
  if (socket.readyState !== 1) return;
  unanswered += 1;
  socket.send(JSON.stringify({ do: word, endcap: chosen, seen: latest ? latest.seen : 0, ...more }));
}

// Whether what is shown is of now: it is not when the run is stopped, or the server or the connection gone.
function live() { return latest !== null && socket.readyState === 1 && performance.now() - answeredAt < QUIET_MS; }

// A button acts now or never: nothing is kept for later. Returns whether it could act.
function press(word, more) {
  watch();
  if (!live()) return false;
  close_question();
  const endcap = latest.endcaps[chosen];
  if (word === "zero" && endcap.contact) question(`${endcap.name} is touched (${endcap.force_norm_n.toFixed(1)} N): a reference taken now makes every later number wrong by that.`);
  else send(word, more);
  return true;
}

// The focus goes with the question where the button that leads to it has it, and back.
function question(text) {
  asked = chosen; $("question").textContent = text; $("ask").classList.add("open");
  if (document.activeElement === $("zero")) $("cancel").focus();
}
function close_question() {
  const within = $("ask").contains(document.activeElement);
  asked = null; $("ask").classList.remove("open");
  if (within) $("zero").focus();
}

// Greys everything out, with its age, and switches the buttons off while there is no answer.
function watch() {
  if (performance.now() > retryAt) connect();
  const good = live(), age = Math.round((performance.now() - answeredAt) / 1000);
  document.body.classList.toggle("stale", !good);
  write("lost_said", good ? "" : latest === null ? "No connection to sensing.live; trying again." : "No answer from sensing.live");
  write("lost_age", good || latest === null ? "" : ` for ${age} s: everything below is as old as that.`); // apart: a screen reader says the rest once
  if (!good) close_question();
  const endcap = good ? latest.endcaps[chosen] : null, fixed = good && latest.replay !== null; // references of a replay are the recording's
  if (!good && SWITCHED.includes(document.activeElement?.id)) focused = document.activeElement; // a button that is switched off loses it
  for (const id of ["zero", "zero_all", "confirm"]) $(id).disabled = !good || fixed;
  for (const id of SWITCHED.slice(3)) $(id).disabled = !good;
  if (good && focused) { if (document.activeElement === document.body) focused.focus(); focused = null; }
  $("undo").disabled = !(endcap && endcap.undoable);
  if (!good && latest) {
    write("robot", `unknown; touching ${age} s ago: ${latest.touching.join(", ") || "none"}`);
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
  Dome.set(shown.hello);
  if (shown.begun_s === begun_s) return; // the same run after a lost connection: plots, cards and choice stay
  begun_s = shown.begun_s; latest = window.shown = bitmap = null;
  declined.clear(); close_question(); held(false);
  weighed = shown.hello.map((endcap) => endcap.weighed);
  corrected = shown.hello.map((endcap) => endcap.rate_effects);
  weight_n = shown.weight_n;
  names = shown.hello.map((endcap) => endcap.name);
  chosen = Math.max(0, names.indexOf(stored()));
  $("endcaps").replaceChildren(...shown.hello.map((endcap, k) => {
    const card = document.createElement("button");
    card.className = "endcap";
    card.innerHTML = '<div class="top"><span class="lamp"></span><b></b></div><div class="n"></div><div class="h"></div>';
    card.querySelector("b").textContent = endcap.name;
    card.onclick = () => choose(k);
    return card;
  }));
  Plots.set($("plots"), names.length);
}

function choose(k) {
  chosen = k; bitmap = null; close_question();
  try { localStorage.setItem(KEPT, names[k]); } catch { /* a browser that keeps nothing */ }
}
function stored() { try { return localStorage.getItem(KEPT); } catch { return null; } }

// Text is written where it changed: a screen reader does not say the same 25 times a second.
function write(id, text) { if ($(id).textContent !== text) $(id).textContent = text; }

function draw(shown) {
  if (!live()) return;
  if (asked !== null && asked !== chosen) close_question();
  const endcap = shown.endcaps[chosen];
  if (!endcap.confirmable) declined.delete(chosen);
  else if (asked === null && !declined.has(chosen) && shown.replay === null) question(endcap.message || `${endcap.name} looked pressed when it was zeroed.`);
  shown.endcaps.forEach((each, k) => card($("endcaps").children[k], each, k));
  const unknown = weight_n > 0 ? "; force sum unknown: endcaps.toml lacks T_robot_endcap" : "";
  const sum = shown.force_sum_n === null ? unknown : shown.touching.length ? `; force sum ${shown.force_sum_n} N` : "";
  const judged = shown.consistent === null ? "" : shown.consistent ? ", carries the weight" : ", does NOT carry the weight";
  write("robot", "touching: " + (shown.touching.join(", ") || "none") + sum + judged);
  recording(shown.recording);
  replay(shown.replay);
  image(shown.selected, endcap);
  Scene.draw($("scene"), shown.endcaps, chosen);
  write("dome_note", Dome.draw($("dome"), endcap, chosen));
  const at = Plots.draw(shown, chosen);
  write("cursor_note", at ? `cursor ${Plots.cursor().toFixed(2)} s ago` : "");
  health(endcap);
  window.drawn += 1; window.shown = shown;
}

function again() { if (window.shown && live()) draw(window.shown); }

function card(element, endcap, k) {
  element.classList.toggle("chosen", k === chosen);
  element.setAttribute("aria-pressed", k === chosen);
  element.querySelector(".lamp").classList.toggle("touch", !!endcap.contact);
  const number = element.querySelector(".n"), line = element.querySelector(".h"), flags = endcap.flags.join(", ");
  number.textContent = endcap.valid ? endcap.force_norm_n.toFixed(1) + " N" : "–";
  number.classList.toggle("none", !endcap.valid);
  line.textContent = endcap.valid ? endcap.message || flags || `${endcap.rate_hz} Hz, ${endcap.p50_ms} ms` : `${endcap.status}: ${endcap.message}`;
  line.title = line.textContent;
  line.classList.toggle("bad", endcap.level > 1);
  line.classList.toggle("warn", endcap.level === 1);
}

function recording(now) {
  $("record").classList.toggle("on", now.on);
  write("record", now.on ? "Stop recording" : "Start recording");
  $("pictures").disabled = now.on;
  if (kinds !== now.pictures) { kinds = now.pictures; $("pictures").value = ["full", "half", "none"].indexOf(kinds); }
  $("note_form").hidden = !now.on;
  $("record_said").classList.toggle("bad", now.failed);
  const left = now.minutes_left > 120 ? `${Math.round(now.minutes_left / 60)} h` : `${now.minutes_left} min`;
  const size = now.on && now.name ? `${now.name}: ${clock(now.seconds)}, ${now.size_mb} MB, ${now.mb_per_min} MB/min, ${gigabytes(now.free_mb)} free (${left}), ${now.frames} frames${now.lost ? `, ${now.lost} lost to a slow disk` : ""}` : now.note;
  write("record_note", now.on ? size : "");
  write("record_said", now.on ? "" : now.note);
  $("recording").hidden = !now.note && !now.files.length;
  if ($("files").children.length !== now.files.length) $("files").replaceChildren(...now.files.map((name, k) => Object.assign(document.createElement("a"), { href: `recording/${k}`, download: name, textContent: `Download ${name}` })));
}
const gigabytes = (mb) => (mb > 2000 ? `${(mb / 1000).toFixed(0)} GB` : `${mb} MB`);
const clock = (s) => `${Math.floor(s / 60)}:${String(Math.floor(s % 60)).padStart(2, "0")}`;

function replay(now) {
  $("replay").hidden = now === null;
  if (now === null) return;
  write("play", now.paused ? "Play" : "Pause");
  if ($("seek").max !== String(now.span_s)) $("seek").max = now.span_s;
  if (sought === null) $("seek").value = now.position_s;
  $("seek").setAttribute("aria-valuetext", `${now.position_s.toFixed(1)} s of ${now.span_s.toFixed(1)} s`);
  write("moment", `${now.position_s.toFixed(1)} of ${now.span_s.toFixed(1)} s`);
  if (document.activeElement !== $("loop")) $("loop").checked = now.loop;
  write("whole", now.whole ? "from its begin: the recording's own numbers" : "sent here: started anew a second before, not to the bit");
}

// While the slider is drawn along, the newest moment goes out five times a second at most.
function seek() {
  if (sought === null) setTimeout(() => { const moment = sought; sought = null; press("replay_seek", { value: Math.round(1000 * moment) }); }, 200);
  sought = +$("seek").value;
}

function image(detail, endcap) {
  const canvas = $("image"), g = canvas.getContext("2d");
  if (!detail || detail.number !== chosen) { g.fillStyle = "#000"; g.fillRect(0, 0, canvas.width, canvas.height); return; }
  const [w, h] = detail.size, s = canvas.width / w;
  if (Math.abs(canvas.height - h * s) > 1) canvas.height = Math.round(h * s);
  if (bitmap) g.drawImage(bitmap, 0, 0, canvas.width, canvas.height);
  else { g.fillStyle = "#000"; g.fillRect(0, 0, canvas.width, canvas.height); }
  g.fillStyle = "rgba(8,14,18,.25)"; g.fillRect(0, 0, canvas.width, canvas.height);
  for (const [x, y, quality] of detail.dots) {
    g.beginPath(); g.lineWidth = 2;
    if (quality < 0) { g.strokeStyle = "#57b6ff"; g.moveTo((x - 5) * s, (y - 5) * s); g.lineTo((x + 5) * s, (y + 5) * s); g.moveTo((x + 5) * s, (y - 5) * s); g.lineTo((x - 5) * s, (y + 5) * s); }
    else { g.strokeStyle = `hsl(${Math.max(0, Math.min(1, (quality - 0.6) / 0.4)) * 140},80%,55%)`; g.arc((x + 0.5) * s, (y + 0.5) * s, 9 * s, 0, 7); }
    g.stroke();
  }
  if (detail.field.length) arrows(g, detail, s);
  const words = detail.preview !== undefined ? detail.preview : detail.dots.length ? `${endcap.dots} of ${endcap.dots_known} dots` : "";
  const old = ["silent", "unplugged"].includes(endcap.status) && endcap.age_ms !== null ? `no newer picture for ${Math.round(endcap.age_ms / 1000)} s` : "";
  const note = [words, old].filter(Boolean).join("; ");
  write("image_note", note);
  if (canvas.getAttribute("aria-label") !== `picture of ${endcap.name}: ${note}`) canvas.setAttribute("aria-label", `picture of ${endcap.name}: ${note}`);
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

function health(endcap) {
  const stages = Object.entries(endcap.stage_ms).map(([name, ms]) => `${name} ${ms}`).join(", ");
  const rows = [
    ["state", endcap.message ? `${endcap.status}: ${endcap.message}` : endcap.status], ["zeroed", zeroed(endcap)], ["stiffness", weighed[chosen] || "not calibrated by weight"], ["rate effects", corrected[chosen] || "not corrected"], ["rate", `${endcap.rate_hz} Hz`], ["age of the picture", `${endcap.age_ms ?? "–"} ms`],
    ["image to wrench", `${endcap.p50_ms ?? "–"} ms median, ${endcap.p99_ms ?? "–"} ms at 99 %`], ["stages, ms", stages],
    ["dropped, unusable, reopened", `${endcap.dropped}, ${endcap.faults}, ${endcap.reopened}`], ["dots", endcap.dots_known ? `${endcap.dots} of ${endcap.dots_known}` : "not used"],
    ["drift since zero", endcap.drift || "unknown"], ["warnings", Words.plain(endcap.flags) || "none"],
  ];
  if ($("health").rows.length !== rows.length) $("health").replaceChildren(...rows.map(([name]) => {
    const row = document.createElement("tr"), head = document.createElement("th");
    head.scope = "row"; head.textContent = name;
    row.append(head, document.createElement("td"));
    return row;
  }));
  rows.forEach(([, value], k) => { const cell = $("health").rows[k].cells[1]; if (cell.textContent !== value) cell.textContent = value; });
}

function zeroed(endcap) {
  if (!endcap.zeroed) return "not yet";
  const when = new Date(endcap.zeroed), minutes = Math.floor((1000 * latest.now_s - when) / 60000);
  const ago = minutes < 1 ? "less than a minute" : minutes < 120 ? `${minutes} min` : minutes < 2880 ? `${Math.floor(minutes / 60)} h` : `${Math.floor(minutes / 1440)} days`;
  return `${when.toLocaleString()} (${ago} ago)`;
}

function held(on) { $("hold").textContent = on ? "Run plots" : "Pause plots"; $("hold").setAttribute("aria-pressed", on); }

for (const id of ["zero", "zero_all", "undo"]) $(id).onclick = () => press(id);
$("record").onclick = () => (latest && latest.recording.on ? press("record_stop") : press("record_start", { value: +$("pictures").value }));
$("confirm").onclick = () => press("zero_confirmed");
$("cancel").onclick = () => { declined.add(chosen); close_question(); };
$("ask").onkeydown = (event) => { if (event.key === "Escape") $("cancel").click(); };
$("note_form").onsubmit = (event) => { event.preventDefault(); if (press("note", { text: $("note").value.trim() })) $("note").value = ""; };
$("play").onclick = () => press("replay_pause", { value: latest.replay.paused ? 0 : 1 });
$("seek").oninput = seek;
$("loop").onchange = () => press("replay_loop", { value: $("loop").checked ? 1 : 0 });
$("speed").onchange = () => press("replay_speed", { value: +$("speed").value });
$("window").onchange = () => { Plots.length(+$("window").value); again(); };
$("hold").onclick = () => { held(Plots.hold($("hold").textContent === "Pause plots", chosen, window.shown ? window.shown.time_s : 0)); again(); };
Plots.listen($("plots"), again);
Draw.hand($("scene"), Scene.view, again);
Draw.hand($("dome"), Dome.view, again);
Words.show($("words"));
setInterval(watch, 250);
connect();
