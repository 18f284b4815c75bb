// The tool path: where one looks from, and its lines by WebGL where there is a graphics card.

// Dark to bright, so that amounts can be told apart without seeing hues; on a ground that is always dark.
const RAMP = ["#7f88f0", "#5f9fe0", "#45b0c8", "#3fbfa5", "#4dcb82", "#85d65a", "#b5df3c", "#dce52e", "#fdee60"];
const RAMP_ON_PAPER = [
  "#1d2b6f", "#2b4f96", "#1f6f9c", "#158491", "#1e967c", "#4a9e52", "#7d9a1c", "#a98a00", "#c07000",
];
const GROUND = "#14171b";
const PROGRAM_COLOURS = ["#f28e3c", "#56b4e9"];

const rgb = (hex) => [1, 3, 5].map((at) => parseInt(hex.slice(at, at + 2), 16));

/** 256 colours between the stops of a ramp. */
function rampColours(stops) {
  const found = new Uint8Array(256 * 4);
  for (let i = 0; i < 256; i++) {
    const at = (i / 255) * (stops.length - 1);
    const k = Math.min(Math.floor(at), stops.length - 2);
    const [a, b] = [rgb(stops[k]), rgb(stops[k + 1])];
    for (let c = 0; c < 3; c++) found[4 * i + c] = Math.round(a[c] + (at - k) * (b[c] - a[c]));
    found[4 * i + 3] = 255;
  }
  return found;
}

/** Where one looks from: without perspective, so that lengths can be compared. */
class Camera {
  constructor(low, high) {
    this.centre = low.map((value, k) => (value + high[k]) / 2);
    this.span = low.map((value, k) => high[k] - value);
    this.radius = Math.max(Math.hypot(...this.span) / 2, 1e-3);
    this.plan = false;
    this.yaw = -0.6;
    this.pitch = 0.75;
    this.size = [1, 1];
    this.fit();
  }

  fit() {
    const [x, y] = this.rows(1);
    const reach = (row) => this.span.reduce((sum, span, k) => sum + Math.abs(row[k]) * span, 0) || 1e-3;
    this.scale = 0.82 * Math.min(this.size[0] / reach(x), this.size[1] / reach(y));
    this.pan = [0, 0];
  }

  /** Rows of the matrix from millimetres to pixels: right, up, towards the eye. */
  rows(scale = this.scale) {
    const [yaw, pitch] = this.plan ? [0, Math.PI / 2] : [this.yaw, this.pitch];
    const [cy, sy, cp, sp] = [Math.cos(yaw), Math.sin(yaw), Math.cos(pitch), Math.sin(pitch)];
    return [[cy, -sy, 0], [sy * sp, cy * sp, cp], [-sy * cp, -cy * cp, sp]].map((row) => row.map((v) => v * scale));
  }

  /** A function from millimetres to pixels of the canvas. */
  projector() {
    const [[a, b, c], [d, e, f]] = this.rows();
    const [x0, y0, z0] = this.centre;
    const [right, down] = [this.size[0] / 2 + this.pan[0], this.size[1] / 2 - this.pan[1]];
    return (x, y, z) => {
      const [u, v, w] = [x - x0, y - y0, z - z0];
      return [right + a * u + b * v + c * w, down - (d * u + e * v + f * w)];
    };
  }

  turn(dx, dy) {
    if (this.plan) return this.move(dx, dy);
    this.yaw += dx * 0.008;
    this.pitch = Math.min(Math.max(this.pitch + dy * 0.008, -Math.PI / 2), Math.PI / 2);
  }

  move(dx, dy) {
    this.pan = [this.pan[0] + dx, this.pan[1] - dy];
  }

  /** Nearer by a factor; what is at a place on the canvas stays there. */
  zoom(factor, place = [this.size[0] / 2, this.size[1] / 2]) {
    const from = [place[0] - this.size[0] / 2, this.size[1] / 2 - place[1]];
    this.pan = this.pan.map((pan, k) => from[k] + (pan - from[k]) * factor);
    this.scale *= factor;
  }
}

const VERTEX = `attribute vec3 place; attribute vec3 off; attribute float value;
uniform vec3 right; uniform vec3 up; uniform vec3 eye; uniform vec3 centre; uniform vec2 pan; uniform vec2 half_size;
uniform float magnify; uniform float depth; uniform vec2 shift; varying float amount;
void main() { vec3 q = place - centre + magnify * off; amount = value;
  gl_Position = vec4((vec2(dot(right, q), dot(up, q)) + pan + shift) / half_size, -dot(eye, q) * depth, 1.0); }`;
const FRAGMENT = `precision mediump float; varying float amount; uniform sampler2D ramp; uniform vec4 flat_colour;
void main() { gl_FragColor = flat_colour.a > 0.0 ? flat_colour : texture2D(ramp, vec2(amount, 0.5)); }`;

/** Lines by WebGL. */
class LinePainter {
  constructor(canvas) {
    const gl = canvas.getContext("webgl", { antialias: false, alpha: false });
    if (!gl) throw new Error("no WebGL");
    const named = gl.getExtension("WEBGL_debug_renderer_info");
    const renderer = named ? gl.getParameter(named.UNMASKED_RENDERER_WEBGL) : "";
    if (/swiftshader|llvmpipe|software/i.test(renderer) && !location.hash.includes("webgl")) {
      throw new Error(`${renderer} is no graphics card`);
    }
    this.gl = gl;
    this.program = gl.createProgram();
    for (const [kind, source] of [[gl.VERTEX_SHADER, VERTEX], [gl.FRAGMENT_SHADER, FRAGMENT]]) {
      const shader = gl.createShader(kind);
      gl.shaderSource(shader, source);
      gl.compileShader(shader);
      gl.attachShader(this.program, shader);
    }
    ["place", "off", "value"].forEach((name, rank) => gl.bindAttribLocation(this.program, rank, name));
    gl.linkProgram(this.program);
    if (!gl.getProgramParameter(this.program, gl.LINK_STATUS)) throw new Error(gl.getProgramInfoLog(this.program));
    gl.useProgram(this.program);
    this.at = (name) => gl.getUniformLocation(this.program, name);
    gl.bindTexture(gl.TEXTURE_2D, gl.createTexture());
    gl.texImage2D(gl.TEXTURE_2D, 0, gl.RGBA, 256, 1, 0, gl.RGBA, gl.UNSIGNED_BYTE, rampColours(RAMP));
    for (const name of [gl.TEXTURE_WRAP_S, gl.TEXTURE_WRAP_T]) gl.texParameteri(gl.TEXTURE_2D, name, gl.CLAMP_TO_EDGE);
    gl.texParameteri(gl.TEXTURE_2D, gl.TEXTURE_MIN_FILTER, gl.LINEAR);
    gl.enable(gl.DEPTH_TEST);
    gl.depthFunc(gl.LEQUAL);
    [0, 1, 2].forEach((rank) => gl.enableVertexAttribArray(rank));
  }

  #buffer(data, old) {
    const buffer = old ?? this.gl.createBuffer();
    this.gl.bindBuffer(this.gl.ARRAY_BUFFER, buffer);
    this.gl.bufferData(this.gl.ARRAY_BUFFER, data, this.gl.STATIC_DRAW);
    return buffer;
  }

  /** What stays of a line: place in mm, deviation in mm. */
  load(motion) {
    const mixed = (columns, factor) => {
      const data = new Float32Array(3 * motion.count);
      columns.forEach((column, k) => { for (let i = 0; i < motion.count; i++) data[3 * i + k] = column[i] * factor; });
      return this.#buffer(data);
    };
    return { place: mixed(motion.place, 1), off: mixed(motion.off, 1e-3), value: null, count: motion.count };
  }

  setValues(line, values) {
    line.value = this.#buffer(values, line.value);
  }

  begin(camera, ratio) {
    const gl = this.gl;
    gl.viewport(0, 0, gl.canvas.width, gl.canvas.height);
    gl.clearColor(...rgb(GROUND).map((v) => v / 255), 1);
    gl.clear(gl.COLOR_BUFFER_BIT | gl.DEPTH_BUFFER_BIT);
    const [right, up, eye] = camera.rows();
    gl.uniform3fv(this.at("right"), right);
    gl.uniform3fv(this.at("up"), up);
    gl.uniform3fv(this.at("eye"), eye);
    gl.uniform3fv(this.at("centre"), camera.centre);
    gl.uniform2fv(this.at("pan"), camera.pan);
    gl.uniform2fv(this.at("half_size"), camera.size.map((v) => v / 2));
    gl.uniform1f(this.at("depth"), 0.5 / (camera.radius * camera.scale));
    this.pixel = 1 / ratio;
  }

  draw(line, magnify, colour = null, wide = true) {
    const gl = this.gl;
    [[line.place, 3], [line.off, 3], [line.value, 1]].forEach(([buffer, size], rank) => {
      gl.bindBuffer(gl.ARRAY_BUFFER, buffer);
      gl.vertexAttribPointer(rank, size, gl.FLOAT, false, 0, 0);
    });
    gl.uniform1f(this.at("magnify"), magnify);
    gl.uniform4fv(this.at("flat_colour"), colour ? [...rgb(colour).map((v) => v / 255), 1] : [0, 0, 0, 0]);
    // WebGL has lines of one pixel only: drawn again beside itself it is wider.
    for (const shift of wide ? [[0, 0], [this.pixel, 0], [0, this.pixel]] : [[0, 0]]) {
      gl.uniform2fv(this.at("shift"), shift);
      gl.drawArrays(gl.LINE_STRIP, 0, line.count);
    }
  }

  end() {}
}
