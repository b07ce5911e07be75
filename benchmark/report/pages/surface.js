/* Draw a triangle surface with WebGL: shaded, coloured at its vertices, with dots and marks; turn it, pick a point. */
"use strict";
(() => {
  const NR = (window.NONRIGID = window.NONRIGID || {});

  NR.decode = (text, Kind) => {
    const raw = atob(text);
    const bytes = new Uint8Array(raw.length);
    for (let i = 0; i < raw.length; i++) bytes[i] = raw.charCodeAt(i);
    return new Kind(bytes.buffer);
  };

  /* Vertices come as whole numbers between the corners of the bounding box. */
  NR.readSurface = (block) => {
    const whole = NR.decode(block.vertices, Uint16Array);
    const faces = NR.decode(block.faces, block.wide ? Uint32Array : Uint16Array);
    const positions = new Float32Array(whole.length);
    for (let i = 0; i < whole.length; i++) positions[i] = block.low[i % 3] + (whole[i] / 65535) * block.size[i % 3];
    const surface = { positions, faces: Uint32Array.from(faces), normals: new Float32Array(whole.length), low: block.low, size: block.size };
    const { normals: n, faces: f, positions: p } = surface;
    for (let i = 0; i < f.length; i += 3) {
      const [a, b, c] = [3 * f[i], 3 * f[i + 1], 3 * f[i + 2]];
      const u = [p[b] - p[a], p[b + 1] - p[a + 1], p[b + 2] - p[a + 2]];
      const v = [p[c] - p[a], p[c + 1] - p[a + 1], p[c + 2] - p[a + 2]];
      const cross = [u[1] * v[2] - u[2] * v[1], u[2] * v[0] - u[0] * v[2], u[0] * v[1] - u[1] * v[0]];
      for (const corner of [a, b, c]) for (let k = 0; k < 3; k++) n[corner + k] += cross[k];
    }
    return surface;
  };

  const multiply = (a, b) =>
    [0, 1, 2].flatMap((i) => [0, 1, 2].map((j) => a[3 * i] * b[j] + a[3 * i + 1] * b[3 + j] + a[3 * i + 2] * b[6 + j]));
  const about = (axis, angle) => {
    const [c, s] = [Math.cos(angle), Math.sin(angle)];
    return axis === "x" ? [1, 0, 0, 0, c, -s, 0, s, c] : [c, 0, s, 0, 1, 0, -s, 0, c];
  };

  /* Where one looks from; views that share a camera turn together. */
  class Camera {
    constructor(turn = [1, 0, 0, 0, 1, 0, 0, 0, 1]) {
      this.start = turn;
      this.watchers = [];
      this.reset();
    }
    reset() {
      Object.assign(this, { turn: this.start.slice(), zoom: 1, shift: [0, 0] });
      this.changed();
    }
    rotate(right, down) {
      this.turn = multiply(about("x", down), multiply(about("y", right), this.turn));
      this.changed();
    }
    changed() {
      this.watchers.forEach((watcher) => watcher());
    }
  }
  NR.Camera = Camera;

  const PLACE = `
    uniform mat3 turn; uniform vec3 centre; uniform float radius; uniform float zoom; uniform vec2 shift; uniform vec2 aspect;
    vec4 place(vec3 p) {
      vec3 q = turn * (p - centre) / radius;
      return vec4(q.xy * zoom / aspect + shift, -0.5 * q.z, 1.0);
    }`;
  const SURFACE = [
    `#version 300 es
    ${PLACE}
    in vec3 position; in vec3 normal; in vec3 colour; out vec3 light; out vec3 tint;
    void main() { gl_Position = place(position); light = turn * normal; tint = colour; }`,
    `#version 300 es
    precision highp float;
    in vec3 light; in vec3 tint; out vec4 pixel;
    void main() {
      vec3 n = normalize(light + vec3(0.0, 0.0, 1e-9));
      float shade = 0.42 + 0.48 * abs(n.z) + 0.10 * max(0.0, dot(n, normalize(vec3(-0.5, 0.7, 0.5))));
      pixel = vec4(tint * shade * (n.z < 0.0 ? 0.72 : 1.0), 1.0);
    }`,
  ];
  const DOTS = [
    `#version 300 es
    ${PLACE}
    uniform float lift; uniform float scale;
    in vec3 position; in vec3 colour; in vec2 look; out vec3 tint; out float shape;
    void main() {
      gl_Position = place(position); gl_Position.z -= lift; gl_PointSize = look.x * scale; tint = colour; shape = look.y;
    }`,
    `#version 300 es
    precision highp float;
    uniform float fade; uniform float rim; in vec3 tint; in float shape; out vec4 pixel;
    void main() {
      vec2 p = abs(2.0 * gl_PointCoord - 1.0);
      float r = shape < 0.5 ? length(p) : shape < 1.5 ? max(p.x, p.y) * 1.15 : p.x + p.y;
      if (r > 1.0) discard;
      pixel = vec4(r > 0.84 ? vec3(0.05) : r > rim ? vec3(1.0) : tint, 1.0) * fade;
    }`,
  ];

  const program = (gl, [vertex, fragment]) => {
    const made = gl.createProgram();
    for (const [kind, text] of [[gl.VERTEX_SHADER, vertex], [gl.FRAGMENT_SHADER, fragment]]) {
      const shader = gl.createShader(kind);
      gl.shaderSource(shader, text.trim());
      gl.compileShader(shader);
      gl.attachShader(made, shader);
    }
    gl.linkProgram(made);
    if (!gl.getProgramParameter(made, gl.LINK_STATUS)) throw new Error(gl.getProgramInfoLog(made) || "shader");
    return made;
  };

  class SurfaceView {
    constructor(canvas, surface, camera, radius) {
      const gl = canvas.getContext("webgl2", { antialias: true, preserveDrawingBuffer: true });
      if (!gl) throw new Error("this browser has no WebGL 2");
      Object.assign(this, { canvas, surface, camera, radius, gl, onpick: () => {}, pending: false });
      this.centre = surface.low.map((low, k) => low + surface.size[k] / 2);
      this.programs = { surface: program(gl, SURFACE), dots: program(gl, DOTS) };
      this.buffers = {};
      this.counts = { dots: 0, marks: 0 };
      this.load("position", surface.positions);
      this.load("normal", surface.normals);
      this.buffers.faces = gl.createBuffer();
      gl.bindBuffer(gl.ELEMENT_ARRAY_BUFFER, this.buffers.faces);
      gl.bufferData(gl.ELEMENT_ARRAY_BUFFER, surface.faces, gl.STATIC_DRAW);
      camera.watchers.push(() => this.refresh());
      new ResizeObserver(() => this.refresh()).observe(canvas);
      this.listen();
    }

    load(name, values) {
      const gl = this.gl;
      this.buffers[name] = this.buffers[name] || gl.createBuffer();
      gl.bindBuffer(gl.ARRAY_BUFFER, this.buffers[name]);
      gl.bufferData(gl.ARRAY_BUFFER, values, gl.DYNAMIC_DRAW);
    }

    colour(values) {
      this.load("colour", values);
      this.refresh();
    }

    /* points: [{ at: [x, y, z], colour: [r, g, b], size, shape }]; name is "dots" or "marks". */
    points(name, points) {
      this.counts[name] = points.length;
      this.load(`${name} position`, Float32Array.from(points.flatMap((point) => point.at)));
      this.load(`${name} colour`, Uint8Array.from(points.flatMap((point) => point.colour)));
      this.load(`${name} look`, Float32Array.from(points.flatMap((point) => [point.size, point.shape])));
      this.refresh();
    }

    refresh() {
      if (this.pending) return;
      this.pending = true;
      requestAnimationFrame(() => {
        this.pending = false;
        this.draw();
      });
    }

    aspect() {
      const { clientWidth: w, clientHeight: h } = this.canvas;
      return w > h ? [w / h, 1] : [1, h / w];
    }

    draw() {
      const { gl, canvas, camera } = this;
      const ratio = window.devicePixelRatio || 1;
      const [width, height] = [Math.round(canvas.clientWidth * ratio), Math.round(canvas.clientHeight * ratio)];
      if (!width || !height || !this.buffers.colour) return;
      if (canvas.width !== width || canvas.height !== height) Object.assign(canvas, { width, height });
      gl.viewport(0, 0, width, height);
      gl.clearColor(0, 0, 0, 0);
      gl.clear(gl.COLOR_BUFFER_BIT | gl.DEPTH_BUFFER_BIT);
      gl.enable(gl.DEPTH_TEST);
      this.use("surface");
      this.attribute("position", "position", 3, gl.FLOAT);
      this.attribute("normal", "normal", 3, gl.FLOAT);
      this.attribute("colour", "colour", 3, gl.UNSIGNED_BYTE);
      gl.bindBuffer(gl.ELEMENT_ARRAY_BUFFER, this.buffers.faces);
      gl.drawElements(gl.TRIANGLES, this.surface.faces.length, gl.UNSIGNED_INT, 0);
      this.drawPoints("dots", 0.01, 1, ratio);
      // A mark on the far side is seen faintly through the surface, so that no answer is out of sight.
      gl.enable(gl.BLEND);
      gl.blendFunc(gl.ONE, gl.ONE_MINUS_SRC_ALPHA);
      gl.disable(gl.DEPTH_TEST);
      this.drawPoints("marks", 0, 0.45, ratio);
      gl.enable(gl.DEPTH_TEST);
      // The last mark lies above the others, wherever they are close together.
      gl.depthMask(false);
      this.drawPoints("marks", 0.03, 1, ratio);
      gl.depthMask(true);
      gl.disable(gl.BLEND);
    }

    drawPoints(name, lift, fade, ratio) {
      const { gl } = this;
      if (!this.counts[name]) return;
      const used = this.use("dots");
      gl.uniform1f(gl.getUniformLocation(used, "lift"), lift);
      gl.uniform1f(gl.getUniformLocation(used, "fade"), fade);
      // A white rim keeps a mark apart from a surface of its own colour.
      gl.uniform1f(gl.getUniformLocation(used, "rim"), name === "marks" ? 0.6 : 1);
      gl.uniform1f(gl.getUniformLocation(used, "scale"), ratio);
      this.attribute("position", `${name} position`, 3, gl.FLOAT);
      this.attribute("colour", `${name} colour`, 3, gl.UNSIGNED_BYTE);
      this.attribute("look", `${name} look`, 2, gl.FLOAT);
      gl.drawArrays(gl.POINTS, 0, this.counts[name]);
    }

    use(name) {
      const { gl, camera } = this;
      const used = this.programs[name];
      gl.useProgram(used);
      const at = (uniform) => gl.getUniformLocation(used, uniform);
      gl.uniformMatrix3fv(at("turn"), true, camera.turn);
      gl.uniform3fv(at("centre"), this.centre);
      gl.uniform1f(at("radius"), this.radius);
      gl.uniform1f(at("zoom"), camera.zoom);
      gl.uniform2fv(at("shift"), camera.shift);
      gl.uniform2fv(at("aspect"), this.aspect());
      this.used = used;
      return used;
    }

    attribute(name, buffer, size, kind) {
      const { gl } = this;
      const place = gl.getAttribLocation(this.used, name);
      if (place < 0) return;
      gl.bindBuffer(gl.ARRAY_BUFFER, this.buffers[buffer]);
      gl.enableVertexAttribArray(place);
      gl.vertexAttribPointer(place, size, kind, kind === gl.UNSIGNED_BYTE, 0, 0);
    }

    /* Vertices as they stand on the canvas: x and y in its pixels from the upper left, z towards the reader. */
    projected() {
      const { positions: p } = this.surface;
      const { turn: t, zoom, shift } = this.camera;
      const [ax, ay] = this.aspect();
      const [w, h] = [this.canvas.clientWidth, this.canvas.clientHeight];
      const out = new Float32Array(p.length);
      const { centre, radius } = this;
      for (let i = 0; i < p.length; i += 3) {
        const [x, y, z] = [(p[i] - centre[0]) / radius, (p[i + 1] - centre[1]) / radius, (p[i + 2] - centre[2]) / radius];
        out[i] = (((t[0] * x + t[1] * y + t[2] * z) * zoom) / ax + shift[0] + 1) * 0.5 * w;
        out[i + 1] = (1 - ((t[3] * x + t[4] * y + t[5] * z) * zoom) / ay - shift[1]) * 0.5 * h;
        out[i + 2] = t[6] * x + t[7] * y + t[8] * z;
      }
      return out;
    }

    /* Return the nearest corner of the foremost triangle under a place of the canvas, or -1. */
    pick(x, y) {
      const s = this.projected();
      const f = this.surface.faces;
      let [best, depth] = [-1, -Infinity];
      for (let i = 0; i < f.length; i += 3) {
        const [a, b, c] = [3 * f[i], 3 * f[i + 1], 3 * f[i + 2]];
        const area = (s[b] - s[a]) * (s[c + 1] - s[a + 1]) - (s[c] - s[a]) * (s[b + 1] - s[a + 1]);
        if (area === 0) continue;
        const v = ((x - s[a]) * (s[c + 1] - s[a + 1]) - (s[c] - s[a]) * (y - s[a + 1])) / area;
        const w = ((s[b] - s[a]) * (y - s[a + 1]) - (x - s[a]) * (s[b + 1] - s[a + 1])) / area;
        const u = 1 - v - w;
        if (u < 0 || v < 0 || w < 0) continue;
        const z = u * s[a + 2] + v * s[b + 2] + w * s[c + 2];
        if (z > depth) [depth, best] = [z, [a, b, c][[u, v, w].indexOf(Math.max(u, v, w))] / 3];
      }
      return best;
    }

    listen() {
      const { canvas } = this;
      let last = null;
      let moved = 0;
      canvas.addEventListener("pointerdown", (event) => {
        last = [event.offsetX, event.offsetY];
        moved = 0;
        canvas.setPointerCapture(event.pointerId);
      });
      canvas.addEventListener("pointermove", (event) => {
        if (!last) return;
        const [dx, dy] = [event.offsetX - last[0], event.offsetY - last[1]];
        moved += Math.abs(dx) + Math.abs(dy);
        last = [event.offsetX, event.offsetY];
        if (moved < 4) return;
        if (event.shiftKey || event.buttons & 6) {
          this.camera.shift[0] += (2 * dx) / canvas.clientWidth;
          this.camera.shift[1] -= (2 * dy) / canvas.clientHeight;
          this.camera.changed();
        } else this.camera.rotate(dx * 0.01, dy * 0.01);
      });
      canvas.addEventListener("pointerup", (event) => {
        if (last && moved < 4) this.onpick(this.pick(event.offsetX, event.offsetY));
        last = null;
      });
      canvas.addEventListener("contextmenu", (event) => event.preventDefault());
      // A page must still scroll over a surface that nobody works with.
      canvas.addEventListener("wheel", (event) => {
        if (document.activeElement !== canvas) return;
        event.preventDefault();
        this.zoom(Math.exp(-0.0015 * event.deltaY));
      }, { passive: false });
      const step = Math.PI / 18;
      const keys = {
        ArrowLeft: () => this.camera.rotate(-step, 0),
        ArrowRight: () => this.camera.rotate(step, 0),
        ArrowUp: () => this.camera.rotate(0, -step),
        ArrowDown: () => this.camera.rotate(0, step),
        "+": () => this.zoom(1.2),
        "=": () => this.zoom(1.2),
        "-": () => this.zoom(1 / 1.2),
        0: () => this.camera.reset(),
      };
      canvas.addEventListener("keydown", (event) => {
        if (!keys[event.key] || event.ctrlKey || event.metaKey || event.altKey) return;
        event.preventDefault();
        keys[event.key]();
      });
    }

    zoom(factor) {
      this.camera.zoom = Math.min(Math.max(this.camera.zoom * factor, 0.2), 40);
      this.camera.changed();
    }
  }
  NR.SurfaceView = SurfaceView;
})();
