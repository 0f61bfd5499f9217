// A GLB that turns: WebGL 2, no other file. What it reads is what fab/exports/preview.py writes: one triangle mesh a
// node, positions as normalised shorts, a colour, and in the node's extras its group and its displacement when pulled
// apart.
"use strict";
function glb_parts(bytes) {
  const view = new DataView(bytes);
  const length = view.getUint32(12, true);
  const scene = JSON.parse(new TextDecoder().decode(new Uint8Array(bytes, 20, length)));
  const start = 28 + length;
  const data = (number) => {
    const a = scene.accessors[number];
    const v = scene.bufferViews[a.bufferView];
    const kind = { 5122: Int16Array, 5123: Uint16Array, 5125: Uint32Array }[a.componentType];
    return { array: new kind(bytes.slice(start + v.byteOffset, start + v.byteOffset + v.byteLength)), count: a.count };
  };
  return scene.nodes.map((node) => {
    const shape = scene.meshes[node.mesh].primitives[0];
    return {
      name: node.name,
      group: node.extras.group,
      apart: node.extras.apart,
      origin: node.translation,
      scale: node.scale[0],
      color: scene.materials[shape.material].pbrMetallicRoughness.baseColorFactor,
      points: data(shape.attributes.POSITION).array,
      faces: data(shape.indices).array,
    };
  });
}
const VERTEX = `#version 300 es
in vec3 at; uniform vec3 origin, apart; uniform float scale, pull; uniform mat4 eye; out vec3 place;
void main() { place = at * scale + origin; gl_Position = eye * vec4(place + pull * apart, 1.0); }`;
const FRAGMENT = `#version 300 es
precision highp float; in vec3 place; uniform vec3 color, light; uniform bool cut; out vec4 shown;
void main() {
  if (cut && place.z > 0.0) discard;
  vec3 normal = normalize(cross(dFdx(place), dFdy(place)));
  float lit = 0.45 + 0.55 * abs(dot(normal, light));
  vec3 face = gl_FrontFacing ? color : mix(color, vec3(0.85, 0.45, 0.2), cut ? 0.35 : 0.0);
  shown = vec4(pow(face * lit, vec3(1.0 / 2.2)), 1.0);
}`;
class Viewer {
  constructor(canvas) {
    this.canvas = canvas;
    this.parts = [];
    this.hidden = new Set();
    this.group = "endcap";
    this.yaw = 0.6;
    this.pitch = 0.35;
    this.zoom = 1;
    this.pull = 0;
    this.cut = false;
    this.drawn = 0;
    const gl = (this.gl = canvas.getContext("webgl2", { antialias: true, preserveDrawingBuffer: true }));
    if (!gl) {
      canvas.style.display = "none";
      return;
    }
    this.begin();
    // The driver was reset, or the computer slept.
    canvas.addEventListener("webglcontextlost", (event) => event.preventDefault());
    canvas.addEventListener("webglcontextrestored", () => {
      this.begin();
      if (this.bytes) this.load(this.bytes);
    });
    canvas.addEventListener("pointerdown", (event) => {
      this.held = [event.clientX, event.clientY];
      canvas.setPointerCapture(event.pointerId);
    });
    canvas.addEventListener("pointerup", () => {
      this.held = null;
    });
    canvas.addEventListener("pointercancel", () => {
      this.held = null;
    });
    canvas.addEventListener("pointermove", (event) => {
      if (!this.held) return;
      this.turn((event.clientX - this.held[0]) / 150, (event.clientY - this.held[1]) / 150);
      this.held = [event.clientX, event.clientY];
    });
    canvas.addEventListener(
      "wheel",
      (event) => {
        event.preventDefault();
        this.scale_by(event.deltaY < 0 ? 1.1 : 1 / 1.1);
      },
      { passive: false },
    );
    canvas.addEventListener("keydown", (event) => {
      const steps = { ArrowLeft: [-0.15, 0], ArrowRight: [0.15, 0], ArrowUp: [0, -0.15], ArrowDown: [0, 0.15] };
      if (steps[event.key]) {
        event.preventDefault();
        this.turn(...steps[event.key]);
      } else if (event.key === "+" || event.key === "-") this.scale_by(event.key === "+" ? 1.1 : 1 / 1.1);
    });
    new ResizeObserver(() => this.draw()).observe(canvas);
  }
  begin() {
    const gl = this.gl;
    const program = gl.createProgram();
    for (const [kind, text] of [
      [gl.VERTEX_SHADER, VERTEX],
      [gl.FRAGMENT_SHADER, FRAGMENT],
    ]) {
      const shader = gl.createShader(kind);
      gl.shaderSource(shader, text);
      gl.compileShader(shader);
      gl.attachShader(program, shader);
    }
    gl.linkProgram(program);
    gl.useProgram(program);
    gl.enable(gl.DEPTH_TEST);
    this.at = gl.getAttribLocation(program, "at");
    this.where = (name) => gl.getUniformLocation(program, name);
  }
  turn(yaw, pitch) {
    this.yaw += yaw;
    this.pitch = Math.max(-1.5, Math.min(1.5, this.pitch + pitch));
    this.draw();
  }
  scale_by(factor) {
    this.zoom = Math.max(0.3, Math.min(8, this.zoom * factor));
    this.draw();
  }
  load(bytes) {
    const gl = this.gl;
    if (!gl) return;
    for (const part of this.parts) for (const buffer of part.buffers) gl.deleteBuffer(buffer);
    this.bytes = bytes;
    this.parts = glb_parts(bytes);
    for (const part of this.parts) {
      part.buffers = [gl.createBuffer(), gl.createBuffer()];
      gl.bindBuffer(gl.ARRAY_BUFFER, part.buffers[0]);
      gl.bufferData(gl.ARRAY_BUFFER, part.points, gl.STATIC_DRAW);
      gl.bindBuffer(gl.ELEMENT_ARRAY_BUFFER, part.buffers[1]);
      gl.bufferData(gl.ELEMENT_ARRAY_BUFFER, part.faces, gl.STATIC_DRAW);
      part.kind = part.faces instanceof Uint16Array ? gl.UNSIGNED_SHORT : gl.UNSIGNED_INT;
      part.count = part.faces.length;
      part.points = part.faces = null;
    }
    this.draw();
  }
  set(values) {
    Object.assign(this, values);
    this.draw();
  }
  shown() {
    return this.parts.filter((part) => part.group === this.group && !this.hidden.has(part.name));
  }
  eye() {
    // perspective, around the middle of what is shown, y up
    let low = [1e9, 1e9, 1e9];
    let high = [-1e9, -1e9, -1e9];
    for (const part of this.parts.filter((part) => part.group === this.group))
      for (let k = 0; k < 3; k++) {
        const middle = part.origin[k] + this.pull * part.apart[k];
        low[k] = Math.min(low[k], middle - part.scale);
        high[k] = Math.max(high[k], middle + part.scale);
      }
    const size = Math.hypot(...high.map((v, k) => v - low[k])) || 1;
    const far = (1.35 * size * Math.max(1, this.canvas.height / this.canvas.width)) / this.zoom;
    const m = high.map((v, k) => (v + low[k]) / 2);
    const [s, c, t, u] = [Math.sin(this.yaw), Math.cos(this.yaw), Math.sin(this.pitch), Math.cos(this.pitch)];
    const rows = [
      [c, 0, -s],
      [-s * t, u, -c * t],
      [s * u, t, c * u],
    ]; // right, up, back
    const shift = rows.map((row) => -row.reduce((sum, v, k) => sum + v * m[k], 0));
    shift[2] -= far;
    const f = 3.2;
    const w = (f * this.canvas.height) / this.canvas.width;
    const near = far / 50;
    const end = far + 2 * size;
    const a = (end + near) / (near - end);
    const b = (2 * end * near) / (near - end);
    const columns = [0, 1, 2].map((k) => [w * rows[0][k], f * rows[1][k], a * rows[2][k], -rows[2][k]]);
    return {
      matrix: [...columns.flat(), w * shift[0], f * shift[1], a * shift[2] + b, -shift[2]],
      back: rows[2],
      up: rows[1],
    };
  }
  draw() {
    const gl = this.gl;
    const box = this.canvas.getBoundingClientRect();
    const ratio = window.devicePixelRatio || 1;
    if (!gl || !box.width) return;
    this.canvas.width = Math.round(box.width * ratio);
    this.canvas.height = Math.round(box.height * ratio);
    gl.viewport(0, 0, this.canvas.width, this.canvas.height);
    gl.clearColor(0.96, 0.97, 0.975, 1);
    gl.clear(gl.COLOR_BUFFER_BIT | gl.DEPTH_BUFFER_BIT);
    const { matrix, back, up } = this.eye();
    gl.uniformMatrix4fv(this.where("eye"), false, matrix);
    const light = back.map((v, k) => v + 0.7 * up[k]);
    const norm = Math.hypot(...light);
    gl.uniform3fv(
      this.where("light"),
      light.map((v) => v / norm),
    );
    gl.uniform1i(this.where("cut"), this.cut);
    gl.uniform1f(this.where("pull"), this.pull);
    for (const part of this.shown()) {
      gl.uniform3fv(this.where("origin"), part.origin);
      gl.uniform3fv(this.where("apart"), part.apart);
      gl.uniform1f(this.where("scale"), part.scale);
      gl.uniform3fv(this.where("color"), part.color.slice(0, 3));
      gl.bindBuffer(gl.ARRAY_BUFFER, part.buffers[0]);
      gl.enableVertexAttribArray(this.at);
      gl.vertexAttribPointer(this.at, 3, gl.SHORT, true, 8, 0);
      gl.bindBuffer(gl.ELEMENT_ARRAY_BUFFER, part.buffers[1]);
      gl.drawElements(gl.TRIANGLES, part.count, part.kind, 0);
    }
    this.drawn += 1;
  }
}
