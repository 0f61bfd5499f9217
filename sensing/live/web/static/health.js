"use strict";
// The table of what the chosen endcap's numbers rest on: state, reference, calibrations, times, faults.
const Health = (() => {
  // about: its calibrations in words; now_s: the run's clock, as the page may be on a computer with another.
  function rows(endcap, about, now_s) {
    const stages = Object.entries(endcap.stage_ms).map(([name, ms]) => `${name} ${ms}`);
    return [
      ["state", endcap.message ? `${endcap.status}: ${endcap.message}` : endcap.status],
      ["zeroed", zeroed(endcap, now_s)],
      ["stiffness", about.weighed || "not calibrated by weight"],
      ["rate effects", about.rate_effects || "not corrected"],
      ["rate", `${endcap.rate_hz} Hz`],
      ["age of the picture", `${endcap.age_ms ?? "–"} ms`],
      ["image to wrench", `${endcap.p50_ms ?? "–"} ms median, ${endcap.p99_ms ?? "–"} ms at 99 %`],
      ["stages, ms", stages.join(", ")],
      ["dropped, unusable, reopened", `${endcap.dropped}, ${endcap.faults}, ${endcap.reopened}`],
      ["dots", endcap.dots_known ? `${endcap.dots} of ${endcap.dots_known}` : "not used"],
      ["drift since zero", endcap.drift || "unknown"],
      ["warnings", Words.plain(endcap.flags) || "none"],
    ];
  }

  function zeroed(endcap, now_s) {
    if (!endcap.zeroed) return "not yet";
    const when = new Date(endcap.zeroed);
    return `${when.toLocaleString()} (${ago(Math.floor((1000 * now_s - when) / 60000))} ago)`;
  }

  function ago(minutes) {
    if (minutes < 1) return "less than a minute";
    if (minutes < 120) return `${minutes} min`;
    return minutes < 2880 ? `${Math.floor(minutes / 60)} h` : `${Math.floor(minutes / 1440)} days`;
  }

  function line(name) {
    const row = document.createElement("tr");
    const head = Object.assign(document.createElement("th"), { scope: "row", textContent: name });
    row.append(head, document.createElement("td"));
    return row;
  }

  function draw(table, endcap, about, now_s) {
    const shown = rows(endcap, about, now_s);
    if (table.rows.length !== shown.length) table.replaceChildren(...shown.map(([name]) => line(name)));
    shown.forEach(([, value], k) => {
      const cell = table.rows[k].cells[1];
      if (cell.textContent !== value) cell.textContent = value;
    });
  }
  return { draw, zeroed };
})();
