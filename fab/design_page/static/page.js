// Page with sliders for D and T: each change requests numbers, section and a coarse preview; "Make" runs the command.
"use strict";
const $ = (id) => document.getElementById(id);
const token = document.querySelector("meta[name=endcap-token]").content;
const SLIDERS = ["D", "T", "joint_clearance"];
const LISTS = ["material", "printer", "robot"];
const WORDS = ["dots", "dot_mm", "gyroid"];
const KNOBS = [...SLIDERS, ...LISTS, ...WORDS];
const viewer = new Viewer($("turn"));
const page = { offer: null, answer: null, job: null, asked: 0, shown: 0, asking: false, real: "" };
const GONE = "The page's program has ended: start make design again.";
const say = () => document.dispatchEvent(new Event("shown"));
const svg = (name, values, parent) => {
  const made = document.createElementNS("http://www.w3.org/2000/svg", name);
  for (const [key, value] of Object.entries(values)) made.setAttribute(key, value);
  parent?.append(made);
  return made;
};
const query = () =>
  new URLSearchParams(KNOBS.map((name) => [name, (SLIDERS.includes(name) ? $(name + "_number") : $(name)).value]));

// The last choice of this tab that can be made: for a reload, and the way back from a folder's page.
function kept() {
  try {
    return JSON.parse(sessionStorage.getItem("knobs")) || {};
  } catch {
    return {};
  }
}
function keep(words) {
  try {
    sessionStorage.setItem("knobs", JSON.stringify(Object.fromEntries(words)));
  } catch {
    /* a browser that keeps nothing */
  }
}

async function begin() {
  const reply = await fetch("region.json");
  if (!reply.ok) {
    $("refusal").textContent = await reply.text();
    return;
  }
  const offer = (page.offer = await reply.json());
  const start = { ...offer.start, ...kept() };
  for (const [name, [low, high]] of [
    ["D", offer.diameter],
    ["T", offer.wall],
    ["joint_clearance", offer.clearance],
  ]) {
    const step = Number($(name).step); // the slider stops at round numbers; the field beside it takes any
    $(name).min = step * Math.ceil(low / step - 1e-9);
    $(name).max = step * Math.floor(high / step + 1e-9);
    $(name).value = $(name + "_number").value = start[name];
    $(name).addEventListener("input", () => {
      $(name + "_number").value = $(name).value;
      refresh();
    });
    $(name + "_number").addEventListener("input", () => {
      $(name).value = $(name + "_number").value;
      refresh();
    });
  }
  $("material").append(...offer.silicones.map((name) => new Option(name)));
  $("printer").append(...offer.printers.map(([name, title]) => new Option(title, name)));
  $("robot").append(...offer.robots.map(([name, title]) => new Option(title, name)));
  for (const name of LISTS) {
    if (offer.start[name]) $(name).value = offer.start[name];
    if ([...$(name).options].some((option) => option.value === start[name])) $(name).value = start[name];
    $(name).addEventListener("change", refresh);
  }
  for (const name of WORDS) {
    $(name).placeholder = offer.options[name];
    $(name).value = start[name] ?? ""; // empty: as the released sensor has it
    $(name).addEventListener("input", refresh);
  }
  $("more").open = $("robot").value !== offer.start.robot || WORDS.some((name) => $(name).value);
  $("pull").addEventListener("input", () => viewer.set({ pull: $("pull").value / 100 }));
  $("cut").addEventListener("change", () => viewer.set({ cut: $("cut").checked }));
  $("group").addEventListener("change", () => viewer.set({ group: $("group").value }));
  $("make").addEventListener("click", make);
  $("stop").addEventListener("click", () => post("stop", {}));
  if (!viewer.gl) {
    for (const name of ["group", "pull", "cut"]) $(name).parentElement.style.display = "none";
    $("stage").textContent = "This browser has no WebGL 2: the section alone.";
  }
  draw_region();
  await refresh();
  follow();
}

// One question at a time: a dragged slider asks faster than the server answers. Each answer on the way is shown.
async function refresh() {
  page.asked += 1;
  if (page.asking) return;
  page.asking = true;
  try {
    while (page.shown !== page.asked) await show(page.asked);
  } finally {
    page.asking = false;
  }
}

async function show(number) {
  const words = query();
  const [answer, shape] = await Promise.all([
    fetch("answer.json?" + words).then(async (r) => (r.ok ? r.json() : { refusal: await r.text() })),
    viewer.gl ? fetch("preview.glb?" + words).then((r) => (r.ok ? r.arrayBuffer() : null)) : null,
  ]).catch(() => [{ refusal: GONE }, null]);
  page.answer = answer;
  $("refusal").textContent = answer.refusal || "";
  document.body.classList.toggle("refused", Boolean(answer.refusal)); // what is still shown is of the size before
  $("make").disabled = Boolean(answer.refusal) || Boolean(page.job?.running);
  draw_point();
  if (!answer.refusal) {
    keep(words);
    $("facts").replaceChildren(
      ...answer.facts.map(([name, words]) => {
        const row = document.createElement("tr");
        const head = document.createElement("th");
        const cell = document.createElement("td");
        head.textContent = name;
        cell.textContent = words;
        row.append(head, cell);
        return row;
      }),
    );
    $("commands").textContent = answer.commands.join("\n");
    draw_section(answer.section);
    if (shape && page.real !== answer.label) {
      viewer.load(shape);
      page.real = "";
      $("stage").textContent = "in outline: no holes, screws, dots; the gyroid as its envelope";
      if (page.job?.made && page.job.label === answer.label) show_real(answer.label);
    }
  }
  page.shown = number;
  say();
}

const X = (d) => 34 + (268 * (d - page.offer.diameter[0])) / (page.offer.diameter[1] - page.offer.diameter[0]);
const top_wall = () => page.offer.wall[1] * 1.06;
const low_wall = () => page.offer.wall[0] * 0.8;
const Y = (t) => 154 - (140 * (t - low_wall())) / (top_wall() - low_wall());
function draw_region() {
  const box = $("region");
  const rows = page.offer.region;
  const points = [...rows.map(([d, low]) => [d, low]), ...rows.map(([d, , high]) => [d, high]).reverse()];
  svg(
    "polygon",
    { points: points.map(([d, t]) => `${X(d)},${Y(t)}`).join(" "), fill: "#bfe0dc", stroke: "#2f6f6a" },
    box,
  );
  for (const d of [100, 150, 200, 250])
    svg("text", { x: X(d), y: 170, "font-size": 11, "text-anchor": "middle" }, box).textContent = d;
  for (const t of [10, 15, 20, 25])
    svg("text", { x: 30, y: Y(t) + 4, "font-size": 11, "text-anchor": "end" }, box).textContent = t;
  svg("text", { x: 44, y: 18, "font-size": 11 }, box).textContent = "sizes that can be made: T over D, mm";
  svg("circle", { id: "point", r: 5, stroke: "#fff", "stroke-width": 1.5 }, box);
  box.addEventListener("click", (event) => {
    const place = new DOMPoint(event.clientX, event.clientY).matrixTransform(box.getScreenCTM().inverse());
    const [d0, d1] = page.offer.diameter;
    const d = d0 + ((d1 - d0) * (place.x - 34)) / 268;
    const t = low_wall() + ((top_wall() - low_wall()) * (154 - place.y)) / 140;
    $("D").value = $("D_number").value = (Math.round(2 * d) / 2).toString();
    $("T").value = $("T_number").value = t.toFixed(1);
    refresh();
  });
}
function draw_point() {
  const d = Number($("D_number").value);
  const t = Number($("T_number").value);
  $("point").setAttribute("cx", Math.max(34, Math.min(316, X(d))));
  $("point").setAttribute("cy", Math.max(6, Math.min(160, Y(t))));
  $("point").setAttribute("fill", page.answer.refusal ? "#c0391c" : "#2f6f6a");
}
function draw_section(parts) {
  const all = parts.flatMap((part) => part.profiles.flat());
  const reach = Math.max(...all.map(([x]) => x)) + 4;
  const heights = all.map(([, z]) => z);
  const low = Math.min(...heights) - 4;
  const high = Math.max(...heights) + 4;
  $("section").setAttribute("viewBox", `${-reach} ${-high} ${2 * reach} ${high - low}`);
  $("section").replaceChildren();
  for (const part of parts)
    for (const sign of [-1, 1])
      for (const profile of part.profiles) {
        const shape = svg(
          "polygon",
          {
            points: profile.map(([x, z]) => `${sign * x},${-z}`).join(" "),
            fill: `rgb(${part.color.map((c) => 255 * c)})`,
            stroke: "#20242a",
            "stroke-width": 0.25,
          },
          $("section"),
        );
        svg("title", {}, shape).textContent = part.name;
      }
}

const post = (path, body) =>
  fetch(path, {
    method: "POST",
    headers: { "X-Endcap-Token": token, "Content-Type": "application/json" },
    body: JSON.stringify(body),
  });
async function make() {
  $("make").disabled = true;
  const answer = await post("make", { ...Object.fromEntries(query()), whole: $("whole").checked });
  if (!answer.ok) {
    $("status").textContent = await answer.text();
    $("make").disabled = false;
    say();
  }
}
// Long polling: the reply comes when the state has changed.
async function follow() {
  let seen = "";
  for (;;) {
    try {
      const reply = await fetch("job.json?seen=" + seen);
      if (!reply.ok) throw new Error(await reply.text());
      const job = await reply.json();
      if (String(job.number) !== seen) {
        seen = String(job.number);
        show_job(job);
      }
    } catch (error) {
      $("status").textContent = error instanceof TypeError ? GONE : error.message;
      $("make").disabled = true;
      say();
      return;
    }
  }
}
function ended_words(job) {
  if (job.status === 0) return `${job.label} is made.`;
  const end = job.stopped ? "stopped" : `not made (status ${job.status})`;
  if (!job.made) return `${job.label} was ${end}; nothing was left behind.`;
  return `${job.label} is made; of slicer projects and build sheet, what was under way was ${end}.`;
}
function show_job(job) {
  page.job = job;
  $("stop").disabled = !job.running;
  $("make").disabled = job.running || Boolean(page.answer?.refusal);
  $("lines").hidden = !job.lines.length;
  $("lines").textContent = job.lines.join("\n");
  $("lines").scrollTop = $("lines").scrollHeight;
  if (job.running) $("status").textContent = `making ${job.label}: ${job.lines.at(-1)?.trim() ?? "starting"}`;
  else if (job.status !== null) $("status").textContent = ended_words(job);
  $("status").className = job.status ? "failed" : "";
  $("done").replaceChildren();
  if (job.status !== null && job.made) {
    const link = document.createElement("a");
    link.href = `exports/${job.label}/index.html`;
    link.textContent = `open ${job.label}: files, pictures, next steps`;
    $("done").append(link);
    if (page.answer?.label === job.label) show_real(job.label); // at the end of a run, or where it had ended before
  }
  say();
}
async function show_real(label) {
  const answer = await fetch(`exports/${label}/preview.glb`);
  if (!answer.ok) return;
  const shape = await answer.arrayBuffer();
  if (page.answer?.label !== label) return; // another size was chosen meanwhile
  if (viewer.gl) {
    viewer.load(shape);
    $("stage").textContent = "as made: the parts' own meshes, coarse";
  }
  page.real = label;
  say();
}
begin();
