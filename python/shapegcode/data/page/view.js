// Where one looks from, and the colours of amounts.

// Dark to bright, so that amounts can be distinguished without seeing hues; on a ground that is always dark.
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

  /** Nearer by a factor; the point at `point` on the canvas stays there. */
  zoom(factor, point = [this.size[0] / 2, this.size[1] / 2]) {
    const from = [point[0] - this.size[0] / 2, this.size[1] / 2 - point[1]];
    this.pan = this.pan.map((pan, k) => from[k] + (pan - from[k]) * factor);
    this.scale *= factor;
  }
}
