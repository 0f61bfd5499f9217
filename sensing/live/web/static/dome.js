"use strict";
// The chosen endcap under its force against a plane: contact patch, normal, force and the part of it along the surface.
// Depth and patch come from solved presses of the design (domes.json). Endcap frame, mm; z is the axis of the dome.
const Dome = (() => {
  const view = { turn: 0.5, tilt: 0.35, zoom: 1 };
  const RINGS = 14;
  const ROUND = 40;
  const LEAST_N = 0.5;
  let designs = [];
  let curves = [];

  const dot = (a, b) => a[0] * b[0] + a[1] * b[1] + a[2] * b[2];
  const along = (p, v, k) => [p[0] + k * v[0], p[1] + k * v[1], p[2] + k * v[2]];
  const unit = (v) => {
    const n = Math.hypot(...v) || 1;
    return v.map((x) => x / n);
  };

  function set(hello) {
    designs = hello;
    fetch("domes.json")
      .then((answer) => answer.json())
      .then((found) => {
        curves = found;
      })
      .catch(() => {
        curves = [];
      });
  }

  // Value of one column of a curve under a force, straight between its points; the last one beyond.
  function under(curve, force, column) {
    const n = curve.force_n;
    const k = n.findIndex((x) => x > force);
    if (k < 0) return curve[column][n.length - 1];
    return curve[column][k - 1] + ((curve[column][k] - curve[column][k - 1]) * (force - n[k - 1])) / (n[k] - n[k - 1]);
  }

  // Where and how far the dome is pressed; null while it is free, or no press of its design is known. The normal is the
  // plane's; where that is not known, of a light touch, that of the place, which the skin's yielding moves by a degree
  // or two.
  function press(endcap, state, found) {
    if (!state.valid || !state.contact || state.centre_mm[0] === null) return null;
    const normal = state.normal[0] !== null ? state.normal : unit(along(state.centre_mm, [0, 0, 1], -endcap.centre_mm));
    const force = -dot(state.force_n, normal);
    if (!(force > LEAST_N) || !found || !found.length) return null;
    const tilt = (Math.acos(Math.max(-1, Math.min(1, normal[2]))) * 180) / Math.PI;
    const upper = found.findIndex((c) => c.tilt_deg >= tilt);
    const b = found[upper < 0 ? found.length - 1 : upper];
    const a = upper > 0 ? found[upper - 1] : b;
    const share = a === b ? 0 : (tilt - a.tilt_deg) / (b.tilt_deg - a.tilt_deg);
    const mix = (column) => under(a, force, column) * (1 - share) + under(b, force, column) * share;
    const depth = mix("depth_mm");
    const patch = mix("patch_mm2");
    const beyond = force > Math.min(a.force_n[a.force_n.length - 1], b.force_n[b.force_n.length - 1]);
    return {
      normal,
      force,
      depth,
      patch,
      beyond,
      radius: Math.sqrt(patch / Math.PI),
      tangent: along(state.force_n, normal, force),
    };
  }

  // A point of the sphere (from its centre) as it is under a press: flat in the patch, fading out beyond it.
  function moved(point, R, fade, pressed) {
    if (!pressed) return point;
    const height = dot(point, pressed.normal);
    const out = Math.sqrt(Math.max(0, R * R - height * height));
    const flat = R - pressed.depth;
    if (height <= 0) return point;
    if (out <= pressed.radius) return along(point, pressed.normal, flat - height);
    const edge = Math.max(0, Math.sqrt(Math.max(0, R * R - pressed.radius * pressed.radius)) - flat);
    return along(point, pressed.normal, -edge * Math.exp(-(out - pressed.radius) / fade));
  }

  function surface(endcap, pressed) {
    const R = endcap.radius_mm;
    const lowest = -Math.asin(Math.min(1, endcap.centre_mm / R));
    const fade = Math.sqrt(R * endcap.wall_mm) * 0.76; // of a thin shell
    return Array.from({ length: RINGS + 1 }, (_, i) => {
      const lat = lowest + ((Math.PI / 2 - lowest) * i) / RINGS;
      return Array.from({ length: ROUND }, (_, k) => {
        const lon = (2 * Math.PI * k) / ROUND;
        const point = [R * Math.cos(lat) * Math.cos(lon), R * Math.cos(lat) * Math.sin(lon), R * Math.sin(lat)];
        return along(moved(point, R, fade, pressed), [0, 0, 1], endcap.centre_mm);
      });
    });
  }

  function quads(g, eye, rings, state) {
    const c = Draw.colour;
    const seen = rings.map((ring) => ring.map(eye));
    const faces = [];
    for (let i = 0; i < RINGS; i++)
      for (let k = 0; k < ROUND; k++) {
        const corners = [seen[i][k], seen[i][(k + 1) % ROUND], seen[i + 1][(k + 1) % ROUND], seen[i + 1][k]];
        faces.push([corners.reduce((s, p) => s + p[2], 0), corners]);
      }
    faces.sort((a, b) => b[0] - a[0]);
    g.lineWidth = 0.6;
    g.strokeStyle = c.edge;
    g.fillStyle = c[state.valid ? "free" : "none"];
    for (const [, corners] of faces) {
      g.beginPath();
      corners.forEach((p, k) => g[k ? "lineTo" : "moveTo"](p[0], p[1]));
      g.closePath();
      g.globalAlpha = 0.75;
      g.fill();
      g.globalAlpha = 1;
      g.stroke();
    }
  }

  function contact(g, eye, endcap, state, pressed) {
    const c = Draw.colour;
    const R = endcap.radius_mm;
    const n = pressed.normal;
    const side = unit(Math.abs(n[2]) < 0.9 ? [n[1], -n[0], 0] : [0, n[2], -n[1]]);
    const other = [n[1] * side[2] - n[2] * side[1], n[2] * side[0] - n[0] * side[2], n[0] * side[1] - n[1] * side[0]];
    const centre = along([0, 0, endcap.centre_mm], n, R - pressed.depth);
    const per_n = (0.75 * R) / Draw.nice(Math.max(5, Math.hypot(...state.force_n)));
    g.beginPath();
    for (let k = 0; k <= 40; k++) {
      const a = (k * Math.PI) / 20;
      const p = eye(along(along(centre, side, pressed.radius * Math.cos(a)), other, pressed.radius * Math.sin(a)));
      k ? g.lineTo(p[0], p[1]) : g.moveTo(p[0], p[1]);
    }
    g.fillStyle = g.strokeStyle = c.force;
    g.globalAlpha = 0.55;
    g.fill();
    g.globalAlpha = 1;
    g.lineWidth = 1.5;
    g.stroke();
    g.setLineDash([4, 3]);
    g.strokeStyle = c.text;
    g.lineWidth = 1;
    Draw.line(g, eye(centre), eye(along(centre, n, 0.9 * R)));
    g.setLineDash([]);
    const end = eye(along(centre, n, 0.9 * R));
    Draw.text(g, "normal", end[0] + 4, end[1], 11.5, c.dim);
    Draw.arrow(g, eye(along(centre, state.force_n, -per_n)), eye(centre), 3, c.force);
    if (Math.hypot(...pressed.tangent) > LEAST_N)
      Draw.arrow(g, eye(centre), eye(along(centre, pressed.tangent, per_n)), 2.5, c.tangent);
  }

  function draw(canvas, state, chosen) {
    const endcap = designs[chosen];
    if (!endcap) return "";
    const R = endcap.radius_mm;
    const middle = [0, 0, endcap.centre_mm + 0.15 * R];
    const [g, w, h] = Draw.begin(canvas);
    const eye = Draw.camera(view, middle, 1.5 * R, w, h);
    const known = curves[chosen];
    const pressed = press(endcap, state, known);
    quads(g, eye, surface(endcap, pressed), state);
    if (pressed) contact(g, eye, endcap, state, pressed);
    Draw.axes(g, eye, middle, h, [
      [1, 0, 0],
      [0, 1, 0],
      [0, 0, 1],
    ]);
    if (!state.valid) return "no number";
    if (known && !known.length) return "no solved press of this design: shape at rest";
    if (!pressed) return "free";
    const depth = `${pressed.beyond ? "over " : ""}${pressed.depth.toFixed(1)} mm deep`;
    const along_n = Math.hypot(...pressed.tangent).toFixed(1);
    const force = `normal ${pressed.force.toFixed(1)} N, along ${along_n} N`;
    return `${depth}, patch ${pressed.patch.toFixed(0)} mm²; ${force}`;
  }
  return { set, draw, view, press, under };
})();
