"use strict";
// The picture of the chosen endcap, with its dots (blue: lost) and its shear field.
const Picture = (() => {
  const CHANNEL_PX = 200; // the field's unit: pixels of the 200 x 200 centre crop
  const LONGEST_PX = 14; // arrow, of these
  const MOST_GAIN = 6; // of arrows where hardly anything moves
  const STILL_PX = 1.5; // an arrow shorter than this on the picture is a point

  function dark(g, colour) {
    g.fillStyle = colour;
    g.fillRect(0, 0, g.canvas.width, g.canvas.height);
  }

  // bitmap: the newest picture, or null. Returns what is said beside it.
  function draw(canvas, bitmap, detail, endcap) {
    const g = canvas.getContext("2d");
    if (!detail) {
      dark(g, "#000");
      return null;
    }
    const [w, h] = detail.size;
    const s = canvas.width / w;
    if (Math.abs(canvas.height - h * s) > 1) canvas.height = Math.round(h * s);
    if (bitmap) g.drawImage(bitmap, 0, 0, canvas.width, canvas.height);
    else dark(g, "#000");
    dark(g, "rgba(8,14,18,.25)");
    detail.dots.forEach(([x, y, quality]) => dot(g, x, y, quality, s));
    if (detail.field.length) arrows(g, detail, s);
    return words(detail, endcap);
  }

  function dot(g, x, y, quality, s) {
    g.beginPath();
    g.lineWidth = 2;
    if (quality < 0) {
      g.strokeStyle = "#57b6ff";
      for (const side of [-5, 5]) {
        g.moveTo((x - 5) * s, (y - side) * s);
        g.lineTo((x + 5) * s, (y + side) * s);
      }
    } else {
      g.strokeStyle = `hsl(${Math.max(0, Math.min(1, (quality - 0.6) / 0.4)) * 140},80%,55%)`;
      g.arc((x + 0.5) * s, (y + 0.5) * s, 9 * s, 0, 7);
    }
    g.stroke();
  }

  function words(detail, endcap) {
    const dots = detail.dots.length ? `${endcap.dots} of ${endcap.dots_known} dots` : "";
    const gone = ["silent", "unplugged"].includes(endcap.status) && endcap.age_ms !== null;
    const old = gone ? `no newer picture for ${Math.round(endcap.age_ms / 1000)} s` : "";
    return [detail.preview ?? dots, old].filter(Boolean).join("; ");
  }

  function arrows(g, detail, s) {
    const [w, h] = detail.size;
    const side = Math.min(w, h);
    const left = (w - side) / 2;
    const top = (h - side) / 2;
    const [rows, columns, step] = detail.cells;
    const most = detail.field.flat().reduce((m, c) => (c ? Math.max(m, Math.hypot(c[0], c[1]) / 100) : m), 0.2);
    const scale = (Math.min(MOST_GAIN, LONGEST_PX / most) * side) / CHANNEL_PX / 100;
    const middle = (k) => k * step + Math.floor(step / 2) + 0.5;
    g.lineWidth = 2.5;
    g.strokeStyle = g.fillStyle = "#ffe14d";
    detail.field.forEach((row, i) =>
      row.forEach((cell, j) => {
        const x = left + (middle(j) * side) / columns;
        const y = top + (middle(i) * side) / rows;
        if (cell) arrow(g, x, y, cell[0] * scale, cell[1] * scale, s);
      }),
    );
  }

  function arrow(g, x, y, u, v, s) {
    const size = Math.hypot(u, v);
    if (size < STILL_PX) {
      g.fillRect(x * s - 1, y * s - 1, 2, 2);
      return;
    }
    const turn = Math.atan2(v, u);
    const head = Math.min(9, 3 + size * 0.4) * s;
    const [X, Y] = [(x + u) * s, (y + v) * s];
    g.beginPath();
    g.moveTo(x * s, y * s);
    g.lineTo(X, Y);
    for (const side of [-0.45, 0.45]) {
      g.moveTo(X, Y);
      g.lineTo(X - head * Math.cos(turn + side), Y - head * Math.sin(turn + side));
    }
    g.stroke();
  }
  return { draw };
})();
