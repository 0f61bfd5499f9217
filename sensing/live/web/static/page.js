"use strict";
// Asks for the newest state, draws it, asks again: a slow browser only sees fewer of them.
const QUIET_MS = 1000; // no answer for so long: what is shown is old
const DEAD_MS = 5000; // no answer for so long: the connection may lead nowhere, and no browser says so for minutes
const RETRY_MS = 1000; // after a connection was refused or closed
const WATCH_MS = 250;
const KEPT = "endcap chosen"; // in the browser's storage, so that a reload shows the same endcap
const ZEROS = ["zero", "zero_all", "confirm"]; // buttons that are off while there is no answer, and in a replay
const SWITCHED = ["record", "play", "seek", "loop", "speed", "note_add"]; // while there is no answer
const declined = new Set(); // endcaps whose refusal was read
let socket = null;
let unanswered = 0; // requests
let answeredAt = -Infinity; // ms, on the page's clock
let retryAt = Infinity;
let begun_s = null; // when the run began: another one begins with an empty page
let about = []; // what stays the same of each endcap
let weight_n = 0; // of the robot, 0 where it is unknown
let chosen = 0;
let latest = null; // newest state
let bitmap = null; // newest picture of the chosen endcap
let asked = null; // endcap of the open question
let focused = null; // button that was switched off while it had the focus
window.shown = null; // last state that was drawn, for tests
window.drawn = 0; // number of states drawn, for tests

function connect() {
  if (socket) {
    socket.onmessage = socket.onclose = null;
    socket.close();
  }
  retryAt = performance.now() + DEAD_MS;
  socket = new WebSocket((location.protocol === "https:" ? "wss://" : "ws://") + location.host + "/ws");
  socket.binaryType = "blob";
  unanswered = 0;
  socket.onmessage = async (event) => {
    retryAt = performance.now() + DEAD_MS;
    if (typeof event.data !== "string") {
      show_picture(await createImageBitmap(event.data).catch(() => null)); // null: a damaged picture
      return;
    }
    const news = JSON.parse(event.data);
    if (news.hello) begin(news);
    else {
      unanswered -= 1;
      latest = news;
      answeredAt = performance.now();
      Plots.remember(news);
      watch();
      requestAnimationFrame(() => draw(news));
    }
    if (unanswered <= 0) send("show");
  };
  socket.onclose = () => {
    retryAt = performance.now() + RETRY_MS;
    watch();
  };
}

function send(word, more = {}) {
  if (socket.readyState !== 1) return;
  unanswered += 1;
  socket.send(JSON.stringify({ do: word, endcap: chosen, seen: latest ? latest.seen : 0, ...more }));
}

// Whether what is shown is of now: it is not when the run is stopped, or the server or the connection gone.
function live() {
  return latest !== null && socket.readyState === 1 && performance.now() - answeredAt < QUIET_MS;
}

// A button acts now or never: nothing is kept for later. Returns whether it could act.
function press(word, more) {
  watch();
  if (!live()) return false;
  close_question();
  const endcap = latest.endcaps[chosen];
  if (word === "zero" && endcap.contact)
    question(
      `${endcap.name} is touched (${endcap.force_norm_n.toFixed(1)} N): ` +
        "a reference taken now makes every later number wrong by that.",
    );
  else send(word, more);
  return true;
}

// The focus goes with the question where the button that leads to it has it, and back.
function question(text) {
  asked = chosen;
  $("question").textContent = text;
  $("ask").classList.add("open");
  if (document.activeElement === $("zero")) $("cancel").focus();
}
function close_question() {
  const within = $("ask").contains(document.activeElement);
  asked = null;
  $("ask").classList.remove("open");
  if (within) $("zero").focus();
}

// Greys everything out, with its age, and switches the buttons off while there is no answer.
function watch() {
  if (performance.now() > retryAt) connect();
  const good = live();
  const age = Math.round((performance.now() - answeredAt) / 1000);
  const silent = latest === null ? "No connection to sensing.live; trying again." : "No answer from sensing.live";
  document.body.classList.toggle("stale", !good);
  write("lost_said", good ? "" : silent);
  // The age is apart: a screen reader says the rest once.
  write("lost_age", good || latest === null ? "" : ` for ${age} s: everything below is as old as that.`);
  if (!good) close_question();
  switch_buttons(good);
  if (!good && latest) grey(age);
}

function switch_buttons(good) {
  const fixed = good && latest.replay !== null; // references of a replay are the recording's
  // A button that is switched off loses the focus, and has it again afterwards.
  if (!good && [...ZEROS, ...SWITCHED].includes(document.activeElement?.id)) focused = document.activeElement;
  for (const id of ZEROS) $(id).disabled = !good || fixed;
  for (const id of SWITCHED) $(id).disabled = !good;
  if (good && focused) {
    if (document.activeElement === document.body) focused.focus();
    focused = null;
  }
  $("undo").disabled = !(good && latest.endcaps[chosen].undoable);
}

function grey(age) {
  write("robot", `unknown; touching ${age} s ago: ${latest.touching.join(", ") || "none"}`);
  const state = $("health").rows[0];
  if (state) state.cells[1].textContent = `unknown; ${latest.endcaps[chosen].status} ${age} s ago`;
  [...$("endcaps").children].forEach((card, k) => {
    const force = latest.endcaps[k].force_norm_n;
    const last = force === null ? latest.endcaps[k].status : `${force.toFixed(1)} N`;
    card.querySelector(".n").textContent = "–";
    card.querySelector(".h").textContent = `${last}, ${age} s ago`;
  });
}

// The picture before gives its memory back, of which the browser's collector knows nothing. It is the one that is there
// now, not when the next began to be decoded: on a slow computer several are decoded at once.
function show_picture(next) {
  if (bitmap) bitmap.close();
  bitmap = next;
}

function begin(shown) {
  Scene.set(shown.hello);
  Dome.set(shown.hello);
  if (shown.begun_s === begun_s) return; // the same run after a lost connection: plots, cards and choice stay
  begun_s = shown.begun_s;
  latest = window.shown = null;
  show_picture(null);
  declined.clear();
  close_question();
  held(false);
  about = shown.hello;
  weight_n = shown.weight_n;
  chosen = Math.max(0, about.map((endcap) => endcap.name).indexOf(stored()));
  $("endcaps").replaceChildren(...about.map((endcap, k) => new_card(endcap.name, k)));
  Plots.set($("plots"), about.length);
}

function new_card(name, k) {
  const card = document.createElement("button");
  card.className = "endcap";
  card.innerHTML = '<div class="top"><span class="lamp"></span><b></b></div><div class="n"></div><div class="h"></div>';
  card.querySelector("b").textContent = name;
  card.onclick = () => choose(k);
  return card;
}

function choose(k) {
  chosen = k;
  show_picture(null);
  close_question();
  try {
    localStorage.setItem(KEPT, about[k].name);
  } catch {
    /* a browser that keeps nothing */
  }
}
function stored() {
  try {
    return localStorage.getItem(KEPT);
  } catch {
    return null;
  }
}

function draw(shown) {
  if (!live()) return;
  if (asked !== null && asked !== chosen) close_question();
  const endcap = shown.endcaps[chosen];
  if (!endcap.confirmable) declined.delete(chosen);
  else if (asked === null && !declined.has(chosen) && shown.replay === null)
    question(endcap.message || `${endcap.name} looked pressed when it was zeroed.`);
  shown.endcaps.forEach((each, k) => card($("endcaps").children[k], each, k));
  write("robot", `touching: ${shown.touching.join(", ") || "none"}${force_sum(shown)}`);
  Recording.draw(shown.recording);
  Replay.draw(shown.replay);
  picture(shown.selected, endcap);
  Scene.draw($("scene"), shown.endcaps, chosen);
  write("dome_note", Dome.draw($("dome"), endcap, chosen));
  const at = Plots.draw(shown, chosen);
  write("cursor_note", at ? `cursor ${Plots.cursor().toFixed(2)} s ago` : "");
  Health.draw($("health"), endcap, about[chosen], shown.now_s);
  window.drawn += 1;
  window.shown = shown;
}

function force_sum(shown) {
  const unknown = weight_n > 0 ? "; force sum unknown: endcaps.toml lacks T_robot_endcap" : "";
  const sum = shown.force_sum_n === null ? unknown : shown.touching.length ? `; force sum ${shown.force_sum_n} N` : "";
  if (shown.consistent === null) return sum;
  return sum + (shown.consistent ? ", carries the weight" : ", does NOT carry the weight");
}

function picture(detail, endcap) {
  const note = Picture.draw($("image"), bitmap, detail?.number === chosen ? detail : null, endcap);
  if (note === null) return;
  const label = `picture of ${endcap.name}: ${note}`;
  write("image_note", note);
  if ($("image").getAttribute("aria-label") !== label) $("image").setAttribute("aria-label", label);
}

function again() {
  if (window.shown && live()) draw(window.shown);
}

function card(element, endcap, k) {
  element.classList.toggle("chosen", k === chosen);
  element.setAttribute("aria-pressed", k === chosen);
  element.querySelector(".lamp").classList.toggle("touch", !!endcap.contact);
  const number = element.querySelector(".n");
  const line = element.querySelector(".h");
  const flags = endcap.flags.join(", ");
  number.textContent = endcap.valid ? endcap.force_norm_n.toFixed(1) + " N" : "–";
  number.classList.toggle("none", !endcap.valid);
  line.textContent = endcap.valid
    ? endcap.message || flags || `${endcap.rate_hz} Hz, ${endcap.p50_ms} ms`
    : `${endcap.status}: ${endcap.message}`;
  line.title = line.textContent;
  line.classList.toggle("bad", endcap.level > 1);
  line.classList.toggle("warn", endcap.level === 1);
}

function held(on) {
  $("hold").textContent = on ? "Run plots" : "Pause plots";
  $("hold").setAttribute("aria-pressed", on);
}

for (const id of ["zero", "zero_all", "undo"]) $(id).onclick = () => press(id);
$("record").onclick = () =>
  latest && latest.recording.on ? press("record_stop") : press("record_start", { value: +$("pictures").value });
$("confirm").onclick = () => press("zero_confirmed");
$("cancel").onclick = () => {
  declined.add(chosen);
  close_question();
};
$("ask").onkeydown = (event) => {
  if (event.key === "Escape") $("cancel").click();
};
$("note_form").onsubmit = (event) => {
  event.preventDefault();
  if (press("note", { text: $("note").value.trim() })) $("note").value = "";
};
$("play").onclick = () => press("replay_pause", { value: latest.replay.paused ? 0 : 1 });
$("seek").oninput = () => Replay.seek((moment) => press("replay_seek", { value: Math.round(1000 * moment) }));
$("loop").onchange = () => press("replay_loop", { value: $("loop").checked ? 1 : 0 });
$("speed").onchange = () => press("replay_speed", { value: +$("speed").value });
$("window").onchange = () => {
  Plots.length(+$("window").value);
  again();
};
$("hold").onclick = () => {
  held(Plots.hold($("hold").textContent === "Pause plots", chosen, window.shown ? window.shown.time_s : 0));
  again();
};
Plots.listen($("plots"), again);
Draw.hand($("scene"), Scene.view, again);
Draw.hand($("dome"), Dome.view, again);
Words.show($("words"));
setInterval(watch, WATCH_MS);
connect();
