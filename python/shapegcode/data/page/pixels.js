// The lines of the path, pixel by pixel. On a machine without a graphics card WebGL is a program, too, and takes several
// times as long; with one, this is fast enough.

class PixelPainter {
  constructor(context) {
    this.context = context;
    this.ramp = new Uint32Array(rampColours(RAMP).buffer);
    this.ground = this.#word(GROUND);
  }

  #word(hex) {
    return new Uint32Array(new Uint8Array([...rgb(hex), 255]).buffer)[0];
  }

  load(motion) {
    return { motion, count: motion.count, values: null, seen: new Float32Array(3 * motion.count) };
  }

  setValues(line, values) {
    line.values = values;
  }

  begin(camera, ratio) {
    const { width, height } = this.context.canvas;
    if (this.image?.width !== width || this.image?.height !== height) {
      this.image = new ImageData(width, height);
      this.words = new Uint32Array(this.image.data.buffer);
      this.depths = new Float32Array(width * height);
    }
    this.words.fill(this.ground);
    this.depths.fill(-Infinity);
    Object.assign(this, { camera, ratio });
  }

  /** Pixels and depths of all corners of a line. */
  #project({ motion, count, seen }, magnify) {
    const rows = this.camera.rows(this.camera.scale * this.ratio);
    const [x0, y0, z0] = this.camera.centre, [px, py, pz] = motion.position, [ox, oy, oz] = motion.off;
    const [a, b, c] = rows[0], [d, e, f] = rows[1], [g, h, k] = rows[2];
    const right = this.image.width / 2 + this.camera.pan[0] * this.ratio;
    const down = this.image.height / 2 - this.camera.pan[1] * this.ratio;
    const m = magnify * 1e-3;
    for (let i = 0, at = 0; i < count; i++) {
      const u = px[i] - x0 + m * ox[i], v = py[i] - y0 + m * oy[i], w = pz[i] - z0 + m * oz[i];
      seen[at++] = right + a * u + b * v + c * w;
      seen[at++] = down - (d * u + e * v + f * w);
      seen[at++] = g * u + h * v + k * w;
    }
  }

  draw(line, magnify, colour = null) {
    this.#project(line, magnify);
    const { seen, values } = line;
    const { words, depths, ramp } = this;
    const { width, height } = this.image;
    const flat = colour ? this.#word(colour) : 0;
    const [most_x, most_y] = [width - 2, height - 2];
    for (let i = 1, at = 3; i < line.count; i++, at += 3) {
      const x0 = seen[at - 3], y0 = seen[at - 2], z0 = seen[at - 1];
      const dx = seen[at] - x0, dy = seen[at + 1] - y0, dz = seen[at + 2] - z0;
      // The part of it that is inside (Liang and Barsky 1984).
      let from = 0, to = 1;
      if (dx) {
        const p = (0 - x0) / dx, q = (most_x - x0) / dx;
        from = Math.max(from, Math.min(p, q));
        to = Math.min(to, Math.max(p, q));
      } else if (x0 < 0 || x0 > most_x) continue;
      if (dy) {
        const p = (0 - y0) / dy, q = (most_y - y0) / dy;
        from = Math.max(from, Math.min(p, q));
        to = Math.min(to, Math.max(p, q));
      } else if (y0 < 0 || y0 > most_y) continue;
      if (from > to) continue;
      const steps = Math.ceil(Math.max(Math.abs(dx), Math.abs(dy)) * (to - from)) || 1;
      const part = (to - from) / steps;
      // Two pixels wide, across the path.
      const beside = Math.abs(dx) > Math.abs(dy) ? width : 1;
      let x = x0 + dx * from, y = y0 + dy * from, z = z0 + dz * from;
      const [sx, sy, sz] = [dx * part, dy * part, dz * part];
      const v0 = 255 * values[i - 1], dv = 255 * (values[i] - values[i - 1]);
      for (let step = 0; step <= steps; step++) {
        const pixel = (y | 0) * width + (x | 0);
        if (z >= depths[pixel]) {
          const word = flat || ramp[(v0 + dv * (from + part * step)) | 0];
          depths[pixel] = z;
          words[pixel] = word;
          words[pixel + beside] = word;
        }
        x += sx;
        y += sy;
        z += sz;
      }
    }
  }

  /** Onto the canvas, below its letters. */
  show() {
    this.context.putImageData(this.image, 0, 0);
  }
}
