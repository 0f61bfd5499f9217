"use strict";
// Endcaps of the robot and their forces in perspective on a plain canvas. Robot frame, mm; z up.
const Scene = (() => {
  const view = { turn: 0.7, tilt: 0.38, zoom: 1 };
  const MM_PER_N = 5;
  let endcaps = [];

  function place(T, p) {
    return [0, 1, 2].map((i) => T[i][0] * p[0] + T[i][1] * p[1] + T[i][2] * p[2] + T[i][3]);
  }
  function turned(T, v) {
    return [0, 1, 2].map((i) => T[i][0] * v[0] + T[i][1] * v[1] + T[i][2] * v[2]);
  }

  function set(hello) {
    const same = hello.every((c) => JSON.stringify(c.T_robot_endcap) === JSON.stringify(hello[0].T_robot_endcap));
    endcaps = hello.map((c, k) => {
      const T = c.T_robot_endcap.map((row) => row.slice());
      if (same) T[0][3] += (k - (hello.length - 1) / 2) * c.radius_mm * 2.6; // nobody said where they are: in a row
      return { ...c, T };
    });
    const centres = endcaps.map((c) => place(c.T, [0, 0, c.centre_mm]));
    const mean = [0, 1, 2].map((i) => centres.reduce((s, p) => s + p[i], 0) / centres.length);
    view.mean = mean;
    view.size = Math.max(150, ...centres.map((p, k) => Math.hypot(p[0] - mean[0], p[1] - mean[1], p[2] - mean[2]) + endcaps[k].radius_mm * 1.4));
    view.floor = Math.min(...centres.map((p, k) => p[2] - endcaps[k].radius_mm));
  }

  function camera(w, h) {
    const ct = Math.cos(view.turn), st = Math.sin(view.turn), cp = Math.cos(view.tilt), sp = Math.sin(view.tilt);
    const far = view.size * 4.2, scale = (Math.min(w, h) / 2 / view.size) * 0.82 * view.zoom * far;
    return (p) => {
      const [x, y, z] = [0, 1, 2].map((i) => p[i] - view.mean[i]);
      const a = ct * x + st * y, b = -st * x + ct * y;
      const depth = far + cp * b - sp * z, up = cp * z + sp * b;
      return [w / 2 + (scale * a) / depth, h * 0.46 - (scale * up) / depth, depth];
    };
  }

  function floor(g, eye) {
    g.strokeStyle = "#26323b";
    g.lineWidth = 1;
    const n = 6, step = (view.size * 1.3) / n;
    for (let k = -n; k <= n; k++) {
      for (const ends of [[[k, -n], [k, n]], [[-n, k], [n, k]]]) {
        const [p, q] = ends.map((e) => eye([view.mean[0] + e[0] * step, view.mean[1] + e[1] * step, view.floor]));
        g.beginPath(); g.moveTo(p[0], p[1]); g.lineTo(q[0], q[1]); g.stroke();
      }
    }
  }

  function dome(g, eye, endcap, state, chosen) {
    const known = state && state.valid, touching = known && state.contact; // gray: no number
    const T = endcap.T, R = endcap.radius_mm, c = endcap.centre_mm, rim = -Math.asin(Math.min(1, c / R));
    const at = (lat, lon) => eye(place(T, [R * Math.cos(lat) * Math.cos(lon), R * Math.cos(lat) * Math.sin(lon), c + R * Math.sin(lat)]));
    const middle = eye(place(T, [0, 0, c])), edge = eye(place(T, [0, 0, c + R]));
    const radius = (Math.min(g.canvas.width, g.canvas.height) / 2 / view.size) * 0.82 * view.zoom * R * ((view.size * 4.2) / middle[2]);
    const glow = g.createRadialGradient(middle[0] - radius / 3, middle[1] - radius / 3, radius / 8, middle[0], middle[1], radius);
    glow.addColorStop(0, !known ? "rgba(120,130,136,.6)" : touching ? "rgba(255,196,92,.95)" : "rgba(125,190,180,.85)");
    glow.addColorStop(1, !known ? "rgba(48,54,58,.6)" : touching ? "rgba(140,84,10,.9)" : "rgba(30,72,76,.85)");
    g.fillStyle = glow;
    g.beginPath(); g.arc(middle[0], middle[1], radius, 0, 7); g.fill();
    g.strokeStyle = chosen ? "#57b6ff" : "rgba(220,240,240,.30)";
    g.lineWidth = chosen ? 2 : 1;
    for (const lat of [rim, 0, 0.55, 1.05]) {
      g.beginPath();
      for (let k = 0; k <= 36; k++) { const p = at(lat, (k * Math.PI) / 18); k ? g.lineTo(p[0], p[1]) : g.moveTo(p[0], p[1]); }
      g.stroke();
    }
    g.fillStyle = "#e4ebef"; g.font = "22px system-ui,sans-serif"; g.textAlign = "center";
    g.fillText(endcap.name.replace(/^endcap_/, ""), middle[0], middle[1] - radius - 8);
    return edge;
  }

  function arrow(g, eye, endcap, state) {
    const f = state.force_n, norm = Math.hypot(...f);
    if (!(norm > 0.3)) return;
    const centre = state.centre_mm[0] === null ? [0, 0, endcap.centre_mm + endcap.radius_mm] : state.centre_mm;
    const tip = place(endcap.T, centre), way = turned(endcap.T, f);
    const tail = tip.map((x, i) => x - way[i] * MM_PER_N);
    const p = eye(tail), q = eye(tip), turn = Math.atan2(q[1] - p[1], q[0] - p[0]);
    g.strokeStyle = g.fillStyle = "#ffb02e"; g.lineWidth = 5; g.lineEndcap = "round";
    g.beginPath(); g.moveTo(p[0], p[1]); g.lineTo(q[0], q[1]); g.stroke();
    g.beginPath(); g.moveTo(q[0] + 4 * Math.cos(turn), q[1] + 4 * Math.sin(turn));
    for (const s of [-1, 1]) g.lineTo(q[0] - 20 * Math.cos(turn + s * 0.42), q[1] - 20 * Math.sin(turn + s * 0.42));
    g.closePath(); g.fill();
    g.font = "20px system-ui,sans-serif"; g.textAlign = "left";
    g.fillText(norm.toFixed(1) + " N", p[0] + 10, p[1] + 6);
  }

  function draw(canvas, states, chosen) {
    if (!endcaps.length) return;
    const g = canvas.getContext("2d"), eye = camera(canvas.width, canvas.height);
    g.fillStyle = "#11181d"; g.fillRect(0, 0, canvas.width, canvas.height);
    floor(g, eye);
    const order = endcaps.map((c, k) => [eye(place(c.T, [0, 0, c.centre_mm]))[2], k]).sort((a, b) => b[0] - a[0]);
    for (const [, k] of order) dome(g, eye, endcaps[k], states[k], k === chosen);
    for (const [, k] of order) if (states[k] && states[k].valid) arrow(g, eye, endcaps[k], states[k]);
  }

  function drag(canvas) {
    let last = null;
    canvas.addEventListener("pointerdown", (e) => { last = [e.clientX, e.clientY]; canvas.setPointerCapture(e.pointerId); });
    canvas.addEventListener("pointermove", (e) => {
      if (!last) return;
      view.turn += (e.clientX - last[0]) / 150;
      view.tilt = Math.max(-0.3, Math.min(1.5, view.tilt + (e.clientY - last[1]) / 150));
      last = [e.clientX, e.clientY];
    });
    canvas.addEventListener("pointerup", () => (last = null));
    canvas.addEventListener("wheel", (e) => { view.zoom = Math.max(0.4, Math.min(4, view.zoom * Math.exp(-e.deltaY / 600))); e.preventDefault(); }, { passive: false });
  }
  return { set, draw, drag };
})();
