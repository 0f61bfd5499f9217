"use strict";
// Force and torque over time: axis with ticks, cursor, pause, window of chosen length. Times in s of the frames' clock.
const Plots = (() => {
  const NAMES = ["Fx", "Fy", "Fz", "|F|", "Tx", "Ty", "Tz"];
  const UNITS = ["N", "N", "N", "N", "N m", "N m", "N m"];
  const LEAST = [2, 2, 2, 2, 0.1, 0.1, 0.1];
  const KEPT_S = 300;
  const LEFT = 34;
  const FOOT = 16;
  const HEAD = 18;
  let history = [];
  let window_s = 10;
  let held = null;
  let cursor = null;
  let box = null; // held: {now, rows} while paused; cursor: s before now

  const norm = (row) => Math.hypot(row.w[0], row.w[1], row.w[2]);
  // Value and standard deviation of one plot in a row.
  function value(row, k) {
    return k === 3 ? norm(row) : row.w[k > 3 ? k - 1 : k];
  }
  function spread(row, k) {
    if (k !== 3) return row.sd[k > 3 ? k - 1 : k];
    const n = norm(row);
    return n > 0.05 && row.sd[0] !== null ? Math.hypot(...[0, 1, 2].map((i) => (row.w[i] * row.sd[i]) / n)) : row.sd[0];
  }

  function set(container, count) {
    box = container;
    held = null;
    cursor = null;
    history = Array.from({ length: count }, () => ({ rows: [], gap: false, behind: 0 }));
    container.replaceChildren(...NAMES.map(() => Object.assign(document.createElement("canvas"), { role: "img" })));
  }

  // Rows of the plots; behind: from the frames' clock to the run's, so that plots move on while no number comes.
  function remember(shown) {
    shown.endcaps.forEach((endcap, k) => {
      const kept = history[k];
      const rows = kept.rows;
      const last = rows[rows.length - 1];
      if (!endcap.valid) kept.gap = true;
      else {
        if (last && endcap.time_s < last.t) rows.length = 0; // a replay that begins again; what is paused stays
        if (!last || endcap.time_s > last.t) {
          rows.push({
            t: endcap.time_s,
            w: endcap.force_n.concat(endcap.torque_nm),
            sd: endcap.sd,
            first: kept.gap || !last || endcap.time_s - last.t > 1,
          });
          kept.gap = false;
        }
        kept.behind = shown.time_s - endcap.time_s;
      }
      while (rows.length && rows[0].t < shown.time_s - kept.behind - KEPT_S) rows.shift();
    });
  }

  function hold(on, chosen = 0, now = 0) {
    held = on ? history.map((kept) => ({ rows: kept.rows.slice(), now: now - kept.behind })) : null;
    return held !== null;
  }

  function draw(shown, chosen) {
    const kept = history[chosen];
    const now = held ? held[chosen].now : shown.time_s - kept.behind;
    const rows = (held ? held[chosen].rows : kept.rows).filter(
      (row) => row.t >= now - window_s && row.t <= now + 0.001,
    );
    const at = cursor === null ? null : nearest(rows, now - cursor);
    NAMES.forEach((_, k) => plot(box.children[k], k, rows, now, at, shown.endcaps[chosen]));
    return at;
  }

  function nearest(rows, t) {
    return rows.reduce((best, row) => (best === null || Math.abs(row.t - t) < Math.abs(best.t - t) ? row : best), null);
  }

  function plot(canvas, k, rows, now, at, endcap) {
    const [g, w, h] = Draw.begin(canvas);
    const c = Draw.colour;
    const digits = k < 4 ? 1 : 2;
    let top = LEAST[k];
    rows.forEach((row) => (top = Math.max(top, Math.abs(value(row, k)) * 1.1)));
    const low = k === 3 ? 0 : -top;
    const plot_h = h - HEAD - FOOT;
    const X = (t) => LEFT + (w - LEFT - 4) * (1 - (now - t) / window_s);
    const Y = (v) => HEAD + plot_h * (1 - (v - low) / (top - low));
    ticks(g, X, Y, low, top, now, w, h);
    const pieces = [];
    rows.forEach((row) => {
      if (row.first || !pieces.length) pieces.push([]);
      pieces[pieces.length - 1].push(row);
    });
    g.save();
    g.beginPath();
    g.rect(LEFT, HEAD - 2, w - LEFT, plot_h + 4);
    g.clip();
    for (const piece of pieces) {
      // nothing is drawn where there was no number
      const thin = thinned(piece, k, Math.max(40, w));
      const known = thin.filter((row) => spread(row, k) !== null);
      g.fillStyle = c.band;
      g.beginPath();
      known.forEach((row, i) => g[i ? "lineTo" : "moveTo"](X(row.t), Y(value(row, k) + 2 * spread(row, k))));
      known
        .slice()
        .reverse()
        .forEach((row) => g.lineTo(X(row.t), Y(value(row, k) - 2 * spread(row, k))));
      g.closePath();
      g.fill();
      g.strokeStyle = c.accent;
      g.lineWidth = 1.5;
      g.beginPath();
      thin.forEach((row, i) => g[i ? "lineTo" : "moveTo"](X(row.t), Y(value(row, k))));
      g.stroke();
    }
    if (at) {
      g.strokeStyle = c.text;
      g.lineWidth = 1;
      Draw.line(g, [X(at.t), HEAD], [X(at.t), h - FOOT]);
      g.fillStyle = c.text;
      g.beginPath();
      g.arc(X(at.t), Y(value(at, k)), 3, 0, 7);
      g.fill();
    }
    g.restore();
    const newest = endcap.valid ? { w: endcap.force_n.concat(endcap.torque_nm) } : null;
    const row = at || (held ? rows[rows.length - 1] : newest);
    const words = `${NAMES[k]} ${row ? fixed(value(row, k), digits) : "–"} ${UNITS[k]}`;
    if (canvas.getAttribute("aria-label") !== words) canvas.setAttribute("aria-label", words);
    Draw.text(g, words, 4, 13, 12.5, c.text);
  }

  const fixed = (number, digits) => (Math.abs(number) < 0.5 / 10 ** digits ? 0 : number).toFixed(digits); // no "-0.0"

  function ticks(g, X, Y, low, top, now, w, h) {
    const c = Draw.colour;
    const y_step = Draw.nice((top - low) / 4);
    const t_step = Draw.nice(window_s / 4);
    const digits = Math.max(0, -Math.floor(Math.log10(y_step)));
    g.lineWidth = 1;
    for (let v = Math.ceil(low / y_step) * y_step; v <= top; v += y_step) {
      g.strokeStyle = Math.abs(v) < y_step / 2 ? c.edge : c.grid;
      Draw.line(g, [LEFT, Y(v)], [w - 4, Y(v)]);
      if (Y(v) > HEAD + 5) Draw.text(g, fixed(v, digits), LEFT - 4, Y(v) + 3.5, 10, c.dim, "right");
    }
    g.strokeStyle = c.grid;
    for (let t = 0; t <= window_s + 1e-9; t += t_step) {
      Draw.line(g, [X(now - t), HEAD], [X(now - t), h - FOOT + 3]);
      Draw.text(g, t ? `−${+t.toFixed(2)}` : "0 s", X(now - t), h - 3, 10, c.dim, t ? "center" : "right");
    }
  }

  // Of more rows than columns the smallest and the largest of each group, so that no peak is lost.
  function thinned(rows, k, most) {
    if (rows.length <= most) return rows;
    const found = [];
    const size = Math.ceil((2 * rows.length) / most);
    for (let i = 0; i < rows.length; i += size) {
      const group = rows.slice(i, i + size).sort((a, b) => value(a, k) - value(b, k));
      found.push(...[group[0], group[group.length - 1]].sort((a, b) => a.t - b.t));
    }
    return found;
  }

  // s before now of a pointer on one of the plots.
  function point(event) {
    const canvas = event.target.closest("canvas");
    if (!canvas) return;
    const place = canvas.getBoundingClientRect();
    cursor = Math.max(
      0,
      Math.min(window_s, window_s * (1 - (event.clientX - place.left - LEFT) / (place.width - LEFT - 4))),
    );
  }
  function listen(container, drawn) {
    container.addEventListener("pointermove", (e) => {
      point(e);
      drawn();
    });
    container.addEventListener("pointerdown", (e) => {
      point(e);
      drawn();
    });
    container.addEventListener("pointerleave", (e) => {
      if (e.pointerType === "mouse") {
        cursor = null;
        drawn();
      }
    });
    container.addEventListener("keydown", (e) => {
      const step = { ArrowLeft: window_s / 50, ArrowRight: -window_s / 50 }[e.key];
      if (step !== undefined) {
        cursor = Math.max(0, Math.min(window_s, (cursor === null ? 0 : cursor) + step));
        e.preventDefault();
      } else if (e.key === "Escape") cursor = null;
      else return;
      drawn();
    });
  }
  return {
    set,
    remember,
    hold,
    draw,
    listen,
    length: (s) => {
      window_s = s;
    },
    cursor: () => cursor,
    rows: (k) => history[k].rows,
  };
})();
