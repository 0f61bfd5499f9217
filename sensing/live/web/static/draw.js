"use strict";
// What all drawings share: colours of the page, canvases as sharp as the screen, steps that read well, turning by hand.
const Draw = (() => {
  const names = "bg text dim accent band field grid force torque tangent free none edge".split(" ");
  const colour = {};
  function read() {
    const style = getComputedStyle(document.documentElement);
    for (const name of names) colour[name] = style.getPropertyValue("--" + name).trim();
  }
  matchMedia("(prefers-color-scheme: light)").addEventListener("change", read);
  read();

  // Context of a canvas whose units are CSS pixels, emptied.
  function begin(canvas) {
    const ratio = Math.min(3, window.devicePixelRatio || 1);
    const w = canvas.clientWidth;
    const h = canvas.clientHeight;
    const W = Math.max(1, Math.round(w * ratio));
    const H = Math.max(1, Math.round(h * ratio));
    const g = canvas.getContext("2d");
    if (canvas.width !== W || canvas.height !== H) {
      canvas.width = W;
      canvas.height = H;
    }
    g.setTransform(ratio, 0, 0, ratio, 0, 0);
    g.fillStyle = colour.field;
    g.fillRect(0, 0, w, h);
    return [g, w, h];
  }

  // The smallest of 1, 2, 5 times a power of ten that is not below a number.
  function nice(number) {
    const power = 10 ** Math.floor(Math.log10(number));
    return power * ([1, 2, 5].find((k) => k * power >= number * 0.999999) || 10);
  }

  function line(g, from, to) {
    g.beginPath();
    g.moveTo(from[0], from[1]);
    g.lineTo(to[0], to[1]);
    g.stroke();
  }

  // An arrow on the canvas; heads: how many.
  function arrow(g, from, to, width, colour, heads = 1) {
    const turn = Math.atan2(to[1] - from[1], to[0] - from[0]);
    const size = Math.min(5 + 2 * width, Math.hypot(to[0] - from[0], to[1] - from[1]));
    g.strokeStyle = g.fillStyle = colour;
    g.lineWidth = width;
    line(g, from, to);
    for (let k = 0; k < heads; k++) {
      const x = to[0] - k * size * 0.8 * Math.cos(turn);
      const y = to[1] - k * size * 0.8 * Math.sin(turn);
      g.beginPath();
      g.moveTo(x, y);
      for (const side of [-1, 1])
        g.lineTo(x - size * Math.cos(turn + side * 0.42), y - size * Math.sin(turn + side * 0.42));
      g.closePath();
      g.fill();
    }
  }

  // Places of labels that cover neither one another nor what was put there before: the first free one of several, or
  // the first.
  function labels(w, h) {
    const taken = [];
    const free = ([x, y, width, height]) =>
      x >= 0 &&
      y >= 0 &&
      x + width <= w &&
      y + height <= h &&
      !taken.some((t) => x < t[0] + t[2] && t[0] < x + width && y < t[1] + t[3] && t[1] < y + height);
    return {
      take(x, y, width, height) {
        taken.push([x, y, width, height]);
      },
      put(g, words, at, size, ink) {
        g.font = size + "px system-ui,sans-serif";
        const width = g.measureText(words).width;
        const box = ([x, y]) => [at[0] + x, at[1] + y - size, width, size + 2];
        const places = [
          [6, 4],
          [-6 - width, 4],
          [6, 18],
          [-6 - width, 18],
          [6, -10],
          [-6 - width, -10],
          [-width / 2, 32],
          [-width / 2, -24],
        ];
        const [x, y] = places.find((p) => free(box(p))) || places[0];
        taken.push(box([x, y]));
        text(g, words, at[0] + x, at[1] + y, size, ink);
      },
    };
  }

  function text(g, words, x, y, size, colour, align = "left") {
    g.font = size + "px system-ui,sans-serif";
    g.fillStyle = colour;
    g.textAlign = align;
    g.fillText(words, x, y);
  }

  // Perspective view: mm in, CSS pixels and depth out; middle and size of what must be seen in mm.
  function camera(view, middle, size, w, h) {
    const ct = Math.cos(view.turn);
    const st = Math.sin(view.turn);
    const cp = Math.cos(view.tilt);
    const sp = Math.sin(view.tilt);
    const far = size * 4.2;
    const scale = (Math.min(w, h) / 2 / size) * 0.86 * view.zoom * far;
    const eye = (p) => {
      const [x, y, z] = [0, 1, 2].map((i) => p[i] - middle[i]);
      const a = ct * x + st * y;
      const b = -st * x + ct * y;
      const depth = far + cp * b - sp * z;
      return [w / 2 + (scale * a) / depth, h / 2 - (scale * (cp * z + sp * b)) / depth, depth];
    };
    eye.px_per_mm = scale / far;
    return eye;
  }

  // Letters and arrows of three axes at a corner of the canvas.
  function axes(g, eye, middle, h, columns) {
    const at = [34, h - 34];
    const origin = eye(middle);
    "xyz".split("").forEach((name, k) => {
      const way = columns.map((row) => row[k]);
      const tip = eye(middle.map((m, i) => m + way[i] * (22 / eye.px_per_mm)));
      const to = [at[0] + tip[0] - origin[0], at[1] + tip[1] - origin[1]];
      arrow(g, at, to, 1.5, colour.dim);
      text(g, name, to[0] + (to[0] - at[0]) * 0.3, to[1] + (to[1] - at[1]) * 0.3 + 4, 12, colour.text, "center");
    });
  }

  // Turning and zooming by pointer, pinch, wheel and keys.
  function hand(canvas, view, drawn) {
    const first = { ...view };
    const pointers = new Map();
    const turn = (a, b) => {
      view.turn += a;
      view.tilt = Math.max(-0.3, Math.min(1.5, view.tilt + b));
      drawn();
    };
    const zoom = (k) => {
      view.zoom = Math.max(0.4, Math.min(5, view.zoom * k));
      drawn();
    };
    const apart = () => {
      const [p, q] = [...pointers.values()];
      return Math.hypot(p[0] - q[0], p[1] - q[1]);
    };
    canvas.addEventListener("pointerdown", (e) => {
      pointers.set(e.pointerId, [e.clientX, e.clientY]);
      canvas.setPointerCapture(e.pointerId);
    });
    canvas.addEventListener("pointermove", (e) => {
      const last = pointers.get(e.pointerId);
      if (!last) return;
      const before = pointers.size === 2 ? apart() : 0;
      pointers.set(e.pointerId, [e.clientX, e.clientY]);
      if (pointers.size === 2) zoom(apart() / Math.max(before, 1));
      else if (pointers.size === 1) turn((e.clientX - last[0]) / 150, (e.clientY - last[1]) / 150);
    });
    for (const end of ["pointerup", "pointercancel"]) canvas.addEventListener(end, (e) => pointers.delete(e.pointerId));
    canvas.addEventListener(
      "wheel",
      (e) => {
        zoom(Math.exp(-e.deltaY / 600));
        e.preventDefault();
      },
      { passive: false },
    );
    const keys = {
      ArrowLeft: () => turn(-0.15, 0),
      ArrowRight: () => turn(0.15, 0),
      ArrowUp: () => turn(0, -0.1),
      ArrowDown: () => turn(0, 0.1),
      "+": () => zoom(1.2),
      "=": () => zoom(1.2),
      "-": () => zoom(1 / 1.2),
      0: () => {
        Object.assign(view, first);
        drawn();
      },
    };
    canvas.addEventListener("keydown", (e) => {
      if (keys[e.key] && !e.ctrlKey && !e.metaKey) {
        keys[e.key]();
        e.preventDefault();
      }
    });
  }

  return { colour, begin, nice, line, arrow, text, labels, camera, axes, hand };
})();
