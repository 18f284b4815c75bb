// The picture of the path: what is drawn where, what a pointer and a key do, what lies under a click.

/** A round number not above a value: 1, 2 or 5 times a power of ten. */
function roundBelow(value) {
  const power = 10 ** Math.floor(Math.log10(value));
  return power * ([5, 2, 1].find((k) => k * power <= value * (1 + 1e-9)) ?? 1);
}

const rounded = (value) => String(Number(value.toPrecision(6)));

/** Lines in up to 48 colours on a canvas, smooth, for paper. */
function paintPath(context, motion, project, magnify, values, ramp, flat) {
  const bins = flat ? 1 : 48;
  const paths = Array.from({ length: bins }, () => new Path2D());
  let [bin, last] = [-1, null];
  for (let i = 0; i < motion.count; i++) {
    const point = project(...motion.position.map((column, k) => column[i] + 1e-3 * magnify * motion.off[k][i]));
    const mine = flat ? 0 : Math.min(Math.floor(values[i] * bins), bins - 1);
    if (last && mine !== bin) paths[mine].moveTo(...last);
    if (last) paths[mine].lineTo(...point); else paths[mine].moveTo(...point);
    [bin, last] = [mine, point];
  }
  paths.forEach((path, k) => {
    const at = 4 * Math.round((255 * (k + 0.5)) / bins);
    context.strokeStyle = flat ?? `rgb(${ramp[at]},${ramp[at + 1]},${ramp[at + 2]})`;
    context.stroke(path);
  });
}

class Stage {
  /** `onPick(motion, time)` is called with what lies under a click. */
  constructor(host, motions, onPick) {
    Object.assign(this, { host, motions, onPick, magnify: 1, shown: motions, marks: [], flat: false });
    const ends = [0, 1, 2].map((k) => motions.flatMap((one) => {
      let [low, high] = [Infinity, -Infinity];
      for (const value of one.position[k]) [low, high] = [Math.min(low, value), Math.max(high, value)];
      return [low, high];
    }));
    [this.low, this.high] = [ends.map((both) => Math.min(...both)), ends.map((both) => Math.max(...both))];
    this.camera = new Camera(this.low, this.high);
    this.values = new Map();
    this.lines = new Map();
    this.paper = document.createElement("canvas");
    host.append(this.paper);
    this.context = this.paper.getContext("2d", { alpha: false, willReadFrequently: true });
    this.painter = new PixelPainter(this.context);
    motions.forEach((motion) => this.lines.set(motion, this.painter.load(motion)));
    new ResizeObserver(() => this.#resize()).observe(host);
    this.#listen();
  }

  #resize() {
    const [wide, high] = [this.host.clientWidth, this.host.clientHeight];
    if (!wide || !high) return;
    this.ratio = Math.min(window.devicePixelRatio || 1, 2);
    this.paper.width = Math.round(wide * this.ratio);
    this.paper.height = Math.round(high * this.ratio);
    const fresh = this.camera.size[0] === 1;
    this.camera.size = [wide, high];
    if (fresh || !this.touched) this.camera.fit();
    this.draw();
  }

  setPlan(plan) {
    this.camera.plan = plan;
    this.fit();
  }

  fit() {
    this.touched = false;
    this.camera.fit();
    this.draw();
  }

  /** Amounts between 0 and 1 along every path. */
  setValues(valuesOf) {
    for (const motion of this.motions) {
      const values = valuesOf(motion);
      this.values.set(motion, values);
      this.painter.setValues(this.lines.get(motion), values);
    }
    this.draw();
  }

  /** Draw before the next picture of the screen: all, or only what moves along the path. */
  draw(all = true) {
    this.stale = this.stale || all;
    if (this.waiting) return;
    this.waiting = true;
    requestAnimationFrame(() => {
      this.waiting = false;
      this.drawNow(this.stale);
    });
  }

  drawNow(all = true) {
    if (this.camera.size[0] === 1) return;
    if (all) {
      this.painter.begin(this.camera, this.ratio);
      this.#each((motion, colour) => this.painter.draw(this.lines.get(motion), this.magnify, colour));
    }
    this.#letters();
    this.stale = false;
  }

  #each(paint) {
    this.shown.forEach((motion) => paint(motion, this.flat ? PROGRAM_COLOURS[this.motions.indexOf(motion)] : null));
  }

  #letters() {
    const context = this.context;
    context.setTransform(this.ratio, 0, 0, this.ratio, 0, 0);
    this.painter.show();
    const project = this.camera.projector();
    drawAxes(context, this.camera, this.low, this.high, "#c3cad3", GROUND);
    drawScales(context, this.camera, this.magnify, "#e8ebef", GROUND);
    for (const mark of this.marks) if (this.shown.includes(mark.motion)) this.#mark(context, project, mark);
  }

  #mark(context, project, { motion, here, chief }) {
    const shownAt = (i, share = 0) => project(...motion.position.map((column, k) => motion.value(column, { i, share }) +
      1e-3 * this.magnify * motion.value(motion.off[k], { i, share })));
    context.lineWidth = 3;
    context.strokeStyle = "#ffffff";
    context.beginPath();
    let [begin, end] = [here.i, here.i];
    while (begin > 0 && motion.block[begin - 1] === motion.block[here.i] && here.i - begin < 5000) begin--;
    while (end < motion.count - 1 && motion.block[end] === motion.block[here.i] && end - here.i < 5000) end++;
    context.moveTo(...shownAt(begin));
    for (let i = begin + 1; i <= end; i++) context.lineTo(...shownAt(i));
    context.stroke();
    context.beginPath();
    context.arc(...shownAt(here.i, here.share), chief ? 6.5 : 5, 0, 7);
    context.fillStyle = this.motions.length > 1 ? PROGRAM_COLOURS[this.motions.indexOf(motion)] : "#ffffff";
    context.fill();
    context.lineWidth = 2;
    context.stroke();
  }

  /** Where a marker is on the canvas, in pixels. */
  placeOf(motion, here) {
    return this.camera.projector()(...motion.position.map((column, k) =>
      motion.value(column, here) + 1e-3 * this.magnify * motion.value(motion.off[k], here)));
  }

  /** The point on a path that is nearest to a pixel, where one is near enough. */
  pick(x, y, reach = 24) {
    let best = { far: reach };
    const project = this.camera.projector();
    for (const motion of this.shown) {
      const [px, py, pz] = motion.position, [ox, oy, oz] = motion.off, m = 1e-3 * this.magnify;
      let [ax, ay] = [Infinity, Infinity];
      for (let i = 0; i < motion.count; i++) {
        const [bx, by] = project(px[i] + m * ox[i], py[i] + m * oy[i], pz[i] + m * oz[i]);
        const [ux, uy] = i ? [bx - ax, by - ay] : [0, 0];
        const square = ux * ux + uy * uy;
        const share = square ? Math.min(Math.max(((x - ax) * ux + (y - ay) * uy) / square, 0), 1) : 1;
        const far = i ? Math.hypot(ax + share * ux - x, ay + share * uy - y) : Math.hypot(bx - x, by - y);
        if (far < best.far) best = { far, motion, time: i ? motion.timeOf(i - 1, share) : motion.timeOf(0) };
        [ax, ay] = [bx, by];
      }
    }
    return best.motion ? best : null;
  }

  #listen() {
    const pointers = new Map();
    let moved = 0;
    const at = (event) => {
      const box = this.host.getBoundingClientRect();
      return [event.clientX - box.left, event.clientY - box.top];
    };
    this.host.addEventListener("pointerdown", (event) => {
      this.host.setPointerCapture(event.pointerId);
      pointers.set(event.pointerId, at(event));
      if (pointers.size === 1) moved = 0;
    });
    this.host.addEventListener("pointermove", (event) => {
      const from = pointers.get(event.pointerId);
      if (!from) return;
      const to = at(event), [dx, dy] = [to[0] - from[0], to[1] - from[1]];
      moved += Math.abs(dx) + Math.abs(dy);
      if (moved < 4) return;
      const other = [...pointers].find(([id]) => id !== event.pointerId)?.[1];
      if (other) {
        const away = (p) => Math.hypot(p[0] - other[0], p[1] - other[1]) || 1;
        this.camera.zoom(away(to) / away(from), other);
      } else if (event.shiftKey || event.buttons & 6) this.camera.move(dx, dy);
      else this.camera.turn(dx, dy);
      pointers.set(event.pointerId, to);
      this.touched = true;
      this.draw();
    });
    const leave = (event) => {
      const from = pointers.get(event.pointerId);
      pointers.delete(event.pointerId);
      if (!from || event.type !== "pointerup" || moved >= 4 || event.button) return;
      const found = this.pick(...at(event), event.pointerType === "touch" ? 40 : 24);
      if (found) this.onPick(found.motion, found.time);
    };
    this.host.addEventListener("pointerup", leave);
    this.host.addEventListener("pointercancel", leave);
    this.host.addEventListener("contextmenu", (event) => event.preventDefault());
    this.host.addEventListener("wheel", (event) => {
      // Without the keys in it, the page shall scroll.
      if (document.activeElement !== this.host && !event.ctrlKey) return;
      event.preventDefault();
      this.camera.zoom(Math.exp(-event.deltaY * 0.0015), at(event));
      this.touched = true;
      this.draw();
    }, { passive: false });
    this.host.addEventListener("keydown", (event) => this.#key(event));
  }

  #key(event) {
    const steps = { ArrowLeft: [-20, 0], ArrowRight: [20, 0], ArrowUp: [0, -20], ArrowDown: [0, 20] };
    if (steps[event.key]) {
      if (event.shiftKey) this.camera.move(...steps[event.key]); else this.camera.turn(...steps[event.key]);
      this.touched = true;
    } else if (event.key === "+" || event.key === "=") this.camera.zoom(1.25);
    else if (event.key === "-") this.camera.zoom(0.8);
    else if (event.key === "0") this.fit();
    else return;
    event.preventDefault();
    this.draw();
  }
}
