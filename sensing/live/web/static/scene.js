"use strict";
// Endcaps of the robot, its bars and the forces and torques on it, in perspective on a plain canvas.
// Robot frame, mm; z up.
const Scene = (() => {
  const view = { turn: 0.7, tilt: 0.38, zoom: 1 };
  const SPAN = 0.42; // longest arrow, of the half size of what is seen
  const LEAST = { force: [0.3, 5], torque: [0.03, 0.5] }; // drawn from; never a scale finer than that of
  let endcaps = [];
  let bars = [];
  let middle = [0, 0, 0];
  let size = 150;
  let base = 0;
  let full = { force: 5, torque: 0.5 };

  const place = (T, p) => [0, 1, 2].map((i) => T[i][0] * p[0] + T[i][1] * p[1] + T[i][2] * p[2] + T[i][3]);
  const turned = (T, v) => [0, 1, 2].map((i) => T[i][0] * v[0] + T[i][1] * v[1] + T[i][2] * v[2]);
  const dot = (a, b) => a[0] * b[0] + a[1] * b[1] + a[2] * b[2];

  function set(hello) {
    const same = hello.every((c) => JSON.stringify(c.T_robot_endcap) === JSON.stringify(hello[0].T_robot_endcap));
    endcaps = hello.map((c, k) => {
      const T = c.T_robot_endcap.map((row) => row.slice());
      if (same) T[0][3] += (k - (hello.length - 1) / 2) * c.radius_mm * 2.6; // nobody said where they are: in a row
      return { ...c, T };
    });
    const centres = endcaps.map((c) => place(c.T, [0, 0, c.centre_mm]));
    middle = [0, 1, 2].map((i) => centres.reduce((s, p) => s + p[i], 0) / centres.length);
    size = Math.max(
      150,
      ...centres.map(
        (p, k) => Math.hypot(p[0] - middle[0], p[1] - middle[1], p[2] - middle[2]) + endcaps[k].radius_mm * 1.4,
      ),
    );
    base = Math.min(...centres.map((p, k) => p[2] - endcaps[k].radius_mm));
    bars = same ? [] : pairs();
  }

  // Endcaps that look away from each other along one line are the ends of a bar.
  function pairs() {
    const found = [];
    endcaps.forEach((a, i) =>
      endcaps.slice(i + 1).forEach((b) => {
        const p = place(a.T, [0, 0, 0]);
        const q = place(b.T, [0, 0, 0]);
        const apart = [0, 1, 2].map((k) => q[k] - p[k]);
        const length = Math.hypot(...apart);
        const za = turned(a.T, [0, 0, 1]);
        const zb = turned(b.T, [0, 0, 1]);
        if (length > 0 && dot(za, apart) < -0.97 * length && dot(zb, apart) > 0.97 * length) found.push([p, q]);
      }),
    );
    return found;
  }

  function ground(g, eye) {
    g.strokeStyle = Draw.colour.grid;
    g.lineWidth = 1;
    const n = 6;
    const step = (size * 1.3) / n;
    for (let k = -n; k <= n; k++)
      for (const ends of [
        [
          [k, -n],
          [k, n],
        ],
        [
          [-n, k],
          [n, k],
        ],
      ])
        Draw.line(g, ...ends.map((e) => eye([middle[0] + e[0] * step, middle[1] + e[1] * step, base])));
  }

  function dome(g, eye, endcap, state, chosen) {
    const known = state && state.valid;
    const touching = known && state.contact; // gray: no number
    const T = endcap.T;
    const R = endcap.radius_mm;
    const c = endcap.centre_mm;
    const rim = -Math.asin(Math.min(1, c / R));
    const at = (lat, lon) =>
      eye(place(T, [R * Math.cos(lat) * Math.cos(lon), R * Math.cos(lat) * Math.sin(lon), c + R * Math.sin(lat)]));
    const centre = eye(place(T, [0, 0, c]));
    const radius = (R * eye.px_per_mm * size * 4.2) / centre[2];
    g.globalAlpha = 0.8;
    g.fillStyle = Draw.colour[!known ? "none" : touching ? "force" : "free"];
    g.beginPath();
    g.arc(centre[0], centre[1], radius, 0, 7);
    g.fill();
    g.globalAlpha = 1;
    g.strokeStyle = chosen ? Draw.colour.accent : Draw.colour.edge;
    g.lineWidth = chosen ? 2 : 0.7;
    for (const lat of [rim, 0, 0.55, 1.05]) {
      g.beginPath();
      for (let k = 0; k <= 36; k++) {
        const p = at(lat, (k * Math.PI) / 18);
        k ? g.lineTo(p[0], p[1]) : g.moveTo(p[0], p[1]);
      }
      g.stroke();
    }
    Draw.text(
      g,
      endcap.name.replace(/^endcap_/, ""),
      centre[0],
      centre[1] - radius - 5,
      13,
      Draw.colour.text,
      "center",
    );
    return [centre[0], centre[1], centre[2], radius];
  }

  function arrows(g, eye, endcap, state, labels) {
    const f = state.force_n;
    const t = state.torque_nm;
    const force = Math.hypot(...f);
    const torque = Math.hypot(...t);
    if (force > LEAST.force[0]) {
      const centre = state.centre_mm[0] === null ? [0, 0, endcap.centre_mm + endcap.radius_mm] : state.centre_mm;
      const tip = place(endcap.T, centre);
      const way = turned(endcap.T, f);
      const tail = eye(tip.map((x, i) => x - (way[i] * SPAN * size) / full.force));
      Draw.arrow(g, tail, eye(tip), 3, Draw.colour.force);
      labels.push([force.toFixed(1) + " N", tail]);
    }
    if (torque > LEAST.torque[0]) {
      const origin = place(endcap.T, [0, 0, 0]);
      const way = turned(endcap.T, t);
      const tip = eye(origin.map((x, i) => x + (way[i] * SPAN * size) / full.torque));
      Draw.arrow(g, eye(origin), tip, 2, Draw.colour.torque, 2);
      labels.push([torque.toFixed(2) + " N m", tip]);
    }
  }

  // Newtons and newton metres of the longest arrow: grows at once, shrinks when it is three times too large.
  function fit(states) {
    for (const [kind, key] of [
      ["force", "force_n"],
      ["torque", "torque_nm"],
    ]) {
      const most = Math.max(LEAST[kind][1], ...states.filter((s) => s.valid).map((s) => Math.hypot(...s[key])));
      if (most > full[kind] || most < full[kind] / 3) full[kind] = Draw.nice(most);
    }
  }

  function scales(g, eye, w, h) {
    [
      ["force", "N"],
      ["torque", "N m"],
    ].forEach(([kind, unit], k) => {
      const part = Draw.nice(full[kind] / 4);
      const length = (part / full[kind]) * SPAN * size * eye.px_per_mm;
      const y = h - 12 - 16 * k;
      Draw.arrow(g, [w - 70 - length, y - 4], [w - 70, y - 4], 2, Draw.colour[kind], k + 1);
      Draw.text(g, `${part} ${unit}`, w - 64, y, 12, Draw.colour.text);
    });
  }

  function draw(canvas, states, chosen) {
    if (!endcaps.length) return;
    const [g, w, h] = Draw.begin(canvas);
    const eye = Draw.camera(view, middle, size, w, h);
    fit(states);
    ground(g, eye);
    g.strokeStyle = Draw.colour.edge;
    g.lineWidth = 4;
    for (const bar of bars) Draw.line(g, ...bar.map(eye));
    const order = endcaps.map((c, k) => [eye(place(c.T, [0, 0, c.centre_mm]))[2], k]).sort((a, b) => b[0] - a[0]);
    const names = order.map(([, k]) => dome(g, eye, endcaps[k], states[k], k === chosen));
    const labels = [];
    const places = Draw.labels(w, h);
    for (const [, k] of order) if (states[k] && states[k].valid) arrows(g, eye, endcaps[k], states[k], labels);
    for (const [x, y, , radius] of names) {
      places.take(x - 6, y - radius - 17, 12, 14);
      places.take(x - radius, y - radius, 2 * radius, 2 * radius);
    }
    places.take(w - 110, h - 44, 110, 44); // scales
    for (const [words, at] of labels) places.put(g, words, at, 12.5, Draw.colour.text);
    Draw.axes(g, eye, middle, h, [
      [1, 0, 0],
      [0, 1, 0],
      [0, 0, 1],
    ]);
    scales(g, eye, w, h);
  }
  return { set, draw, view, bars: () => bars.length, full };
})();
