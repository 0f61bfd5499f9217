"use strict";
// The robot in space as estimated, and dashed as it truly is where that is known: bars, cables, endcaps, forces, path.
// World frame, m, z up; parallel projection.
const view = { turn: 0.6, tilt: 0.45, zoom: 1 };
const labels = []; // boxes of the last drawing
const NEWTONS_PER_M = 200; // of the arrows of forces
const colour = (name) => getComputedStyle(document.documentElement).getPropertyValue(`--${name}`).trim();
const place = (T, p) => [0, 1, 2].map((i) => T[i][0] * p[0] + T[i][1] * p[1] + T[i][2] * p[2] + T[i][3]);
const bar_ends = (T, bar) => [-1, 1].map((side) => place(T, [0, 0, (side * bar.length_m) / 2]));

function line(g, points, name, width = 1, dash = []) {
  g.strokeStyle = colour(name);
  g.lineWidth = width;
  g.setLineDash(dash);
  g.beginPath();
  points.forEach((p, k) => (k ? g.lineTo(p[0], p[1]) : g.moveTo(p[0], p[1])));
  g.stroke();
  g.setLineDash([]);
}

// Metres to CSS pixels, with the robot in the middle.
function projection(middle, scale, width, height) {
  const [st, ct, sp, cp] = [Math.sin(view.turn), Math.cos(view.turn), Math.sin(view.tilt), Math.cos(view.tilt)];
  return (p) => {
    const [x, y, z] = p.map((v, i) => v - middle[i]);
    const across = ct * x - st * y;
    const deep = st * x + ct * y;
    return [width / 2 + scale * across, height / 2 - scale * (cp * z + sp * deep)];
  };
}

function draw_scene(canvas, about, state) {
  const [g, width, height] = Draw.begin(canvas);
  const scale = (Math.min(width, height) / 1.9) * view.zoom;
  const eye = projection(state.centre_of_mass_m, scale, width, height);
  const radii = about.radius_m.map((r) => r * scale);
  draw_ground(g, eye, state);
  if (state.truth) about.bars.forEach((bar, k) => line(g, bar_ends(state.truth[k], bar).map(eye), "truth", 3, [6, 5]));
  about.cables.forEach((cable) => {
    const ends = cable.bars.map((bar, e) => eye(place(state.bars[bar].T_world_bar, cable.points_m[e])));
    line(g, ends, "dim");
  });
  about.bars.forEach((bar, k) => line(g, bar_ends(state.bars[k].T_world_bar, bar).map(eye), "text", 4));
  state.endcaps.forEach((endcap, k) => draw_endcap(g, eye, endcap, radii[k]));
  const centres = state.endcaps.map((endcap) => eye(endcap.centre_m));
  draw_labels(g, state.endcaps, centres, radii, width, height);
}

// Grid of half a metre, paths, and the ellipse of two standard deviations of the centre of mass.
function draw_ground(g, eye, state) {
  const [x0, y0] = state.centre_of_mass_m.map((v) => Math.round(v * 2) / 2);
  const on_ground = ([x, y]) => eye([x, y, state.ground_m]);
  for (let k = -2; k <= 2; k += 0.5) {
    line(g, [on_ground([x0 + k, y0 - 2]), on_ground([x0 + k, y0 + 2])], "grid");
    line(g, [on_ground([x0 - 2, y0 + k]), on_ground([x0 + 2, y0 + k])], "grid");
  }
  line(g, state.true_path.map(on_ground), "truth", 2, [5, 4]);
  line(g, state.path.map(on_ground), "accent", 2);
  const ellipse = [...state.ellipse, state.ellipse[0]].map(on_ground);
  line(g, ellipse, "accent");
  g.fillStyle = colour("band");
  g.fill();
}

function draw_endcap(g, eye, endcap, radius) {
  const at = eye(endcap.centre_m);
  const faint = ["unknown", "free"].includes(endcap.state);
  g.fillStyle = g.strokeStyle = colour(endcap.state);
  g.globalAlpha = faint ? 0.3 : 0.75;
  g.beginPath();
  g.arc(at[0], at[1], radius, 0, 7);
  g.fill();
  g.globalAlpha = 1;
  g.lineWidth = 1.5;
  g.stroke();
  if (endcap.force_n[0] === null || endcap.contact_m[0] === null) return;
  const tip = endcap.contact_m.map((v, i) => v + endcap.force_n[i] / NEWTONS_PER_M);
  line(g, [eye(endcap.contact_m), eye(tip)], "force", 3);
}

// Each label beside its endcap, where it covers no other label and no other endcap: below where it touches, else above,
// right, left.
function draw_labels(g, endcaps, centres, radii, width, height) {
  const taken = centres.map(([x, y], k) => ({
    k,
    x0: x - radii[k],
    x1: x + radii[k],
    y0: y - radii[k],
    y1: y + radii[k],
  }));
  const inside = { x0: 0, x1: width, y0: 0, y1: height };
  g.font = "12px system-ui";
  g.textAlign = "center";
  g.textBaseline = "middle";
  g.lineJoin = "round";
  g.lineWidth = 4;
  g.strokeStyle = colour("card");
  g.fillStyle = colour("text");
  labels.length = 0;
  endcaps.forEach((endcap, k) => {
    const text = `${endcap.name} ${endcap.state}`;
    const half = g.measureText(text).width / 2 + 2;
    const found = label_places(centres[k], radii[k], half, endcap.contact_m[0] !== null).map(([x, y]) => {
      const box = { k, text, x, y, x0: x - half, x1: x + half, y0: y - 8, y1: y + 8 };
      const weight = (other) => (other.text ? 20 : other.k !== k);
      const hidden = [...taken, ...labels].reduce((sum, other) => sum + weight(other) * covered(box, other), 0);
      return { box, badness: 4 * half * 8 - covered(box, inside) + hidden };
    });
    labels.push(found.reduce((best, each) => (each.badness < best.badness - 1 ? each : best)).box);
  });
  for (const each of labels) {
    g.strokeText(each.text, each.x, each.y);
    g.fillText(each.text, each.x, each.y);
  }
  g.textBaseline = "alphabetic";
}

// Middles of a label, the best first; half: of its width.
function label_places([x, y], radius, half, touches) {
  const away = radius + 11;
  const side = radius + half + 4;
  const upright = touches ? [away, -away] : [-away, away];
  const corners = [0, away, -away].flatMap((dy) => [side, -side].map((dx) => [dx, dy]));
  return [...upright.map((dy) => [0, dy]), ...corners, [0, away + 17], [0, -away - 17]].map(([dx, dy]) => [
    x + dx,
    y + dy,
  ]);
}

function covered(a, b) {
  const across = Math.min(a.x1, b.x1) - Math.max(a.x0, b.x0);
  const upright = Math.min(a.y1, b.y1) - Math.max(a.y0, b.y0);
  return Math.max(0, across) * Math.max(0, upright);
}
