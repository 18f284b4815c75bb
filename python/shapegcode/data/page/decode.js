// From the packed bytes of the page to columns of numbers.

async function unzipped(base64) {
  if (typeof DecompressionStream === "undefined") {
    throw new Error("This browser cannot unpack the motion (DecompressionStream is missing): use one made since 2023. " +
      "Everything else on the page is complete.");
  }
  const packed = typeof Uint8Array.fromBase64 === "function"
    ? Uint8Array.fromBase64(base64)
    : Uint8Array.from(atob(base64), (sign) => sign.charCodeAt(0));
  const stream = new Blob([packed]).stream().pipeThrough(new DecompressionStream("gzip"));
  return new Response(stream).arrayBuffer();
}

/** A column: differences modulo 65536 of ranks between two limits, or 32-bit differences. */
function columnOf(buffer, entry) {
  if (entry.kind === "i4d") {
    const steps = new Int32Array(buffer, entry.at, entry.count);
    const found = new Int32Array(entry.count);
    for (let i = 0, sum = 0; i < entry.count; i++) found[i] = sum += steps[i];
    return found;
  }
  const steps = new Uint16Array(buffer, entry.at, entry.count);
  const found = new Float32Array(entry.count);
  const scale = (entry.high - entry.low) / 65535;
  for (let i = 0, rank = 0; i < entry.count; i++) {
    rank = (rank + steps[i]) & 65535;
    found[i] = entry.low + rank * scale;
  }
  return found;
}

/** A program in time: columns, texts, and where its lines and blocks begin. */
class Motion {
  constructor(buffer, entry, period, channels) {
    Object.assign(this, { key: entry.key, label: entry.label, file: entry.file, samples: entry.samples, period, cuts: entry.cuts });
    const column = (name) => columnOf(buffer, entry.columns[name]);
    [this.sample, this.line, this.block] = ["sample", "line", "block"].map(column);
    this.position = ["x", "y", "z"].map(column);
    this.off = ["dx", "dy", "dz"].map(column);
    const named = channels.filter((name) => entry.columns[name]);
    this.channels = Object.fromEntries(named.map((name) => [name, column(name)]));
    const bytes = new Uint8Array(buffer, entry.text.at, entry.text.count);
    this.lines = new TextDecoder().decode(bytes).replace(/\r/g, "").replace(/\n$/, "").split("\n");
    this.count = this.sample.length;
    this.duration = this.count ? this.sample[this.count - 1] * period : 0;
    this.first = this.#firstOfLines();
    this.length = this.#lengths();
    this.inCuts = this.#samplesInCuts();
  }

  /** Whether each sample counts for the largest deviation: those in cuts; where no cut is known, all. */
  #samplesInCuts() {
    const lines = new Uint8Array(this.lines.length + 2);
    for (const [first, last] of this.cuts) lines.fill(1, first, last + 1);
    const found = Uint8Array.from(this.line, (line) => lines[line]);
    return found.includes(1) ? found : found.fill(1);
  }

  /** Sample of the largest deviation from the path. */
  get worst() {
    const deviation = this.channels.deviation ?? [];
    let found = Math.max(this.inCuts.indexOf(1), 0);
    for (let i = found; i < deviation.length; i++) {
      if (this.inCuts[i] && deviation[i] > deviation[found]) found = i;
    }
    return found;
  }

  /** Of each line the first sample at it, or of the next line that moves. */
  #firstOfLines() {
    const first = new Int32Array(this.lines.length + 2).fill(-1);
    for (let i = this.count - 1; i >= 0; i--) if (this.line[i] < first.length) first[this.line[i]] = i;
    for (let line = first.length - 2; line >= 0; line--) if (first[line] < 0) first[line] = first[line + 1];
    return first;
  }

  #lengths() {
    const [x, y, z] = this.position;
    const length = new Float64Array(this.count);
    for (let i = 1; i < this.count; i++) {
      length[i] = length[i - 1] + Math.hypot(x[i] - x[i - 1], y[i] - y[i - 1], z[i] - z[i - 1]);
    }
    return length;
  }

  /** Last sample at or before a time, and how far it is to the next: a straight line in time between both. */
  at(time) {
    const wanted = time / this.period;
    const i = Math.max(lastNotAbove(this.sample, wanted), 0);
    const step = i + 1 < this.count ? this.sample[i + 1] - this.sample[i] : 0;
    return { i, share: step ? Math.min(Math.max((wanted - this.sample[i]) / step, 0), 1) : 0 };
  }

  value(column, { i, share }) {
    return share ? column[i] + share * (column[i + 1] - column[i]) : column[i];
  }

  timeOf(i, share = 0) {
    return (this.sample[i] + (share ? share * (this.sample[i + 1] - this.sample[i]) : 0)) * this.period;
  }

  /** Time at which a line begins to move; of a line that is run several times, the run next to a time. */
  timeOfLine(line, near) {
    let found = this.first[Math.min(Math.max(line, 0), this.first.length - 1)];
    if (found < 0) return this.duration;
    const wanted = this.line[found];
    let best = found;
    for (let i = found; i < this.count; i++) {
      const begins = this.line[i] === wanted && (i === 0 || this.block[i - 1] !== this.block[i]);
      if (begins && Math.abs(this.timeOf(i) - near) < Math.abs(this.timeOf(best) - near)) best = i;
    }
    return this.timeOf(best);
  }
}

/** Rank of the last number of a rising column that is not above a value; -1: none. */
function lastNotAbove(column, value) {
  let low = 0, high = column.length;
  while (low < high) {
    const middle = (low + high) >> 1;
    if (column[middle] <= value) low = middle + 1; else high = middle;
  }
  return low - 1;
}

/** Where two programs are at the same position: by lines that stand for each other, and by the path length in them. */
class Links {
  constructor(rows, original, emitted) {
    Object.assign(this, { rows, original, emitted });
  }

  /** The section that a line of a program belongs to, as lines of it and of the other one. */
  section(from, line) {
    const isEmitted = from === this.emitted;
    let before = [0, 0];
    for (const [e0, e1, o0, o1] of this.rows) {
      const [a0, a1, b0, b1] = isEmitted ? [e0, e1, o0, o1] : [o0, o1, e0, e1];
      if (line < a0) return { unchanged: true, lines: [before[0], a0], other: [before[1], b0] };
      if (line <= a1) return { unchanged: false, lines: [a0, a1], other: [b0, b1] };
      before = [a1, b1];
    }
    const ends = [from, from === this.original ? this.emitted : this.original].map((one) => one.lines.length + 1);
    return { unchanged: true, lines: [before[0], ends[0]], other: [before[1], ends[1]] };
  }

  /** The same line in the other program, where both are unchanged; lines may have been put in. */
  unchangedLine(from, line, { lines, other }) {
    const to = from === this.original ? this.emitted : this.original;
    const text = from.lines[line - 1];
    const inside = (one) => one > other[0] && one < other[1];
    const [early, late] = [other[0] + line - lines[0], other[1] - (lines[1] - line)];
    for (let away = 0; away < 200; away++) {
      for (const one of [late - away, late + away, early - away, early + away]) {
        if (inside(one) && to.lines[one - 1] === text) return one;
      }
    }
    return Math.min(Math.max(late, other[0] + 1), Math.max(other[1] - 1, 1));
  }

  /** The time at which the other program is where this one is. */
  time(from, time) {
    const other = from === this.original ? this.emitted : this.original;
    const here = from.at(time);
    const section = this.section(from, from.line[here.i]);
    if (section.unchanged) {
      const line = from.line[here.i];
      const elapsed = time - from.timeOfLine(line, time);
      return Math.min(other.timeOfLine(this.unchangedLine(from, line, section), time) + elapsed, other.duration);
    }
    const [a, b] = [from, other].map((one, rank) => this.#samples(one, rank ? section.other : section.lines));
    const part = (from.value(from.length, here) - from.length[a[0]]) / (from.length[a[1]] - from.length[a[0]] || 1);
    const wanted = other.length[b[0]] + part * (other.length[b[1]] - other.length[b[0]]);
    return this.#nearest(from, here, other, wanted, b, time);
  }

  #samples(one, [first, last]) {
    const begin = Math.max(one.first[first] ?? 0, 0);
    let end = one.first[Math.min(last + 1, one.first.length - 1)];
    if (end === undefined || end < 0) end = one.count - 1;
    return [begin, Math.max(end, begin)];
  }

  /** Shaped corners are shorter: near the wanted length, the position that is nearest. */
  #nearest(from, here, other, wanted, [begin, end]) {
    const p = from.position.map((column) => from.value(column, here));
    const reach = Math.max(0.002 * (other.length[end] - other.length[begin]), 1);
    let best = { far: Infinity, time: other.timeOf(begin) };
    let i = Math.max(lastNotAbove(other.length, wanted - reach), begin);
    for (; i < end && other.length[i] <= wanted + reach; i++) {
      let dot = 0, square = 0;
      for (let k = 0; k < 3; k++) {
        const step = other.position[k][i + 1] - other.position[k][i];
        dot += step * (p[k] - other.position[k][i]);
        square += step * step;
      }
      const share = square ? Math.min(Math.max(dot / square, 0), 1) : 0;
      const far = Math.hypot(...other.position.map((c, k) => c[i] + share * (c[i + 1] - c[i]) - p[k])) +
        1e-4 * Math.abs(other.length[i] - wanted);
      if (far < best.far) best = { far, time: other.timeOf(i, share) };
    }
    return best.time;
  }
}

/** Everything that the page knows of the motion. */
async function readScene() {
  const head = dataOf("scene-head");
  const buffer = await unzipped(byId("scene-data").textContent);
  const names = Object.keys(head.channels);
  const motions = head.variants.map((entry) => new Motion(buffer, entry, head.period_s, names));
  const spectra = head.spectra.map((one) => ({
    ...one, frequency: columnOf(buffer, one.frequency_hz), amplitude: columnOf(buffer, one.amplitude),
  }));
  const [original, emitted] = motions;
  return { ...head, motions, spectra, links: emitted ? new Links(head.link_lines, original, emitted) : null };
}
