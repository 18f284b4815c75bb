// Curves over time and spectra, by Plotly, which is read when somebody comes to them.

const BUCKETS = 900;

async function loadPlotly(name) {
  if (window.Plotly) return;
  const script = document.createElement("script");
  if (name) {
    await new Promise((done, failed) => {
      script.onload = done;
      script.onerror = () => failed(new Error(`The curves need the file ${name} beside this page: copy it, too.`));
      script.src = encodeURIComponent(name);
      document.head.append(script);
    });
  } else {
    script.textContent = new TextDecoder().decode(await unzipped(byId("plotly-data").textContent));
    document.head.append(script);
  }
  if (!window.Plotly) throw new Error("The script of the curves does not run in this browser.");
}

/** The smallest and the largest value of a section of a curve in each of many buckets: looks the same, draws fast. */
function thinned(motion, column, low, high) {
  const from = Math.max(lastNotAbove(motion.sample, low / motion.period), 0);
  const to = Math.min(lastNotAbove(motion.sample, high / motion.period) + 1, motion.count - 1);
  const [x, y] = [[], []];
  const add = (i) => { x.push(motion.sample[i] * motion.period); y.push(column[i]); };
  const size = Math.max((to - from + 1) / BUCKETS, 1);
  for (let begin = from; begin <= to; begin += size) {
    const [a, b] = [Math.floor(begin), Math.min(Math.floor(begin + size) - 1, to)];
    let [least, most] = [a, a];
    for (let i = a; i <= b; i++) {
      if (column[i] < column[least]) least = i;
      if (column[i] > column[most]) most = i;
    }
    for (const i of [...new Set([a, Math.min(least, most), Math.max(least, most), b])].filter((i) => i >= a)) add(i);
  }
  return { x, y };
}

/** A name of an axis in two lines, where it is longer than a row is high. */
function wrapped(text) {
  const words = text.split(" ");
  const half = words.findIndex((_, k) => words.slice(0, k + 1).join(" ").length >= text.length / 2 - 2);
  return text.length < 16 ? text : `${words.slice(0, half + 1).join(" ")}<br>${words.slice(half + 1).join(" ")}`;
}

const styleOf = (name) => getComputedStyle(document.documentElement).getPropertyValue(name).trim();

class Charts {
  /** `onSeek(motion, time)` is called with a click on a curve. */
  constructor(scene, onSeek) {
    Object.assign(this, { scene, onSeek, kind: "position", shown: scene.motions, channel: null, ready: false });
    this.traces = byId("traces");
    this.spectra = byId("spectra");
    this.whole = [0, Math.max(...scene.motions.map((motion) => motion.duration)) || 1];
    this.range = this.whole;
    themeListeners.push(() => this.draw());
    const seen = new IntersectionObserver((entries) => {
      if (entries.some((entry) => entry.isIntersecting)) {
        seen.disconnect();
        this.load();
      }
    }, { rootMargin: "300px" });
    seen.observe(this.traces);
    seen.observe(this.spectra);
  }

  load() {
    this.loading ??= (async () => {
      try {
        await loadPlotly(this.scene.plotly);
      } catch (error) {
        this.traces.textContent = error.message;
        return;
      }
      this.traces.replaceChildren();
      this.ready = true;
      await this.draw();
      this.#listen();
    })();
    return this.loading;
  }

  set(changes) {
    const changed = Object.keys(changes).some((name) => this[name] !== changes[name]);
    Object.assign(this, changes);
    return changed ? this.draw() : undefined;
  }

  async draw() {
    if (!this.ready) return;
    await this.#drawTraces();
    if (this.scene.spectra.length) await this.#drawSpectra();
    else this.spectra.textContent = "No axis moves.";
    this.mark();
  }

  /** Rows from top to bottom: what colours the path, then the axes that move. */
  #rows() {
    const channel = this.scene.channels[this.channel];
    const named = channel ? wrapped(`${channel.label} ${channel.unit}`) : "";
    const rows = channel ? [{ title: named, name: channel.label, of: (motion) => motion.channels[this.channel] }] : [];
    const table = this.kind === "position" ? "position" : "off";
    const unit = this.kind === "position" ? "mm" : "µm";
    for (let k = 0; k < 3; k++) {
      const columns = this.scene.motions.map((motion) => motion[table][k]);
      const moves = columns.some((column) => column.some((value) => value !== column[0]));
      const name = `${this.kind} of ${"XYZ"[k]}`;
      if (moves) rows.push({ title: `${"XYZ"[k]} ${unit}`, name, of: (motion) => motion[table][k] });
    }
    return rows;
  }

  #colour(motion) {
    return styleOf(this.scene.motions.indexOf(motion) || this.scene.motions.length < 2 ? "--after" : "--before");
  }

  #layout(rows, title) {
    const [text, line] = [styleOf("--text"), styleOf("--line")];
    const height = 130 * rows.length + 90;
    const share = 1 / rows.length;
    const layout = {
      height, margin: { l: 64, r: 14, t: 34, b: 46 }, paper_bgcolor: "rgba(0,0,0,0)", plot_bgcolor: "rgba(0,0,0,0)",
      font: { family: "system-ui, DejaVu Sans, sans-serif", size: 12, color: text },
      hovermode: "x", hoverdistance: -1,
      modebar: { bgcolor: "rgba(0,0,0,0)", color: styleOf("--faint"), activecolor: text },
      legend: { orientation: "h", y: 1.0, yanchor: "bottom", x: 0 }, dragmode: "zoom",
      xaxis: {
        title: { text: title }, gridcolor: line, zeroline: false, anchor: rows.length > 1 ? `y${rows.length}` : "y",
      },
    };
    rows.forEach((row, rank) => {
      layout[rank ? `yaxis${rank + 1}` : "yaxis"] = {
        title: { text: row.title }, gridcolor: line, zeroline: false, fixedrange: false,
        domain: [1 - share * (rank + 0.94), 1 - share * (rank + 0.06)],
      };
    });
    return layout;
  }

  #data(rows) {
    return rows.flatMap((row, rank) => this.shown.map((motion) => ({
      type: "scatter", mode: "lines", name: motion.label, legendgroup: motion.key, showlegend: rank === 0,
      line: { width: 1.3, color: this.#colour(motion) }, yaxis: rank ? `y${rank + 1}` : "y",
      hovertemplate: `%{x:.3f} s: ${row.name} %{y:.4~g}<extra>${motion.key}</extra>`,
      ...thinned(motion, row.of(motion), ...this.range),
    })));
  }

  #config() {
    // Named one by one: Plotly's own list has one that sends the data away.
    const modeBarButtons = [["toImage", "zoom2d", "pan2d", "resetScale2d"]];
    const displayModeBar = this.traces.clientWidth > 600 ? "hover" : false;
    return { responsive: true, displaylogo: false, doubleClick: "reset", displayModeBar, modeBarButtons };
  }

  async #drawTraces() {
    const rows = this.#rows();
    const layout = this.#layout(rows, "time s");
    Object.assign(layout.xaxis, { range: [...this.range], autorange: false });
    await Plotly.react(this.traces, this.#data(rows), layout, this.#config());
  }

  async #drawSpectra() {
    const axes = ["x", "y", "z"].filter((axis) => this.scene.spectra.some((one) => one.axis === axis));
    const rows = axes.map((axis) => ({ title: `${axis.toUpperCase()} m/s²/√Hz` }));
    const layout = this.#layout(rows, "frequency Hz");
    const data = this.scene.spectra.flatMap((one) => {
      const motion = this.shown.find((each) => each.key === one.variant);
      const rank = axes.indexOf(one.axis);
      return motion ? [{
        type: "scatter", mode: "lines", name: motion.label, legendgroup: motion.key, showlegend: rank === 0,
        line: { width: 1.3, color: this.#colour(motion) }, yaxis: rank ? `y${rank + 1}` : "y",
        hovertemplate: "%{x:.1f} Hz: %{y:.3~g} m/s²/√Hz<extra></extra>",
        x: [...one.frequency], y: [...one.amplitude],
      }] : [];
    });
    axes.forEach((axis, rank) => {
      const mine = this.scene.spectra.filter((one) => one.axis === axis);
      const most = Math.max(...mine.flatMap((one) => [...one.amplitude]));
      const named = rank ? `yaxis${rank + 1}` : "yaxis";
      const top = Math.log10(most || 1);
      Object.assign(layout[named], { type: "log", range: [top - 3, top + 0.2], exponentformat: "power", dtick: 1 });
    });
    layout.shapes = [];
    layout.annotations = [];
    for (const mode of this.scene.modes) {
      const rank = axes.indexOf(mode.axis);
      if (rank < 0) continue;
      const yref = `${rank ? `y${rank + 1}` : "y"} domain`;
      const at = { xref: "x", yref };
      layout.shapes.push({
        ...at, type: "line", x0: mode.frequency_hz, x1: mode.frequency_hz, y0: 0, y1: 1,
        line: { dash: "dash", width: 1.5, color: styleOf("--text") },
      });
      layout.annotations.push({
        ...at, x: mode.frequency_hz, y: 1, xshift: 3,
        text: mode.label, showarrow: false, xanchor: "left", yanchor: "top",
      });
    }
    await Plotly.react(this.spectra, data, layout, this.#config());
  }

  #listen() {
    this.traces.on("plotly_relayout", (changes) => {
      const [low, high] = [changes["xaxis.range[0]"] ?? changes["xaxis.range"]?.[0],
        changes["xaxis.range[1]"] ?? changes["xaxis.range"]?.[1]];
      if (low === undefined && !changes["xaxis.autorange"]) return;
      this.range = low === undefined ? this.whole : [Number(low), Number(high)];
      const data = this.#data(this.#rows());
      Plotly.update(this.traces, { x: data.map((one) => one.x), y: data.map((one) => one.y) },
        { "xaxis.range": [...this.range] });
    });
    this.traces.on("plotly_afterplot", () => this.mark());
    this.traces.on("plotly_click", ({ points: [point] }) => {
      this.onSeek(this.shown[point.curveNumber % this.shown.length], point.x);
    });
    this.cursor = document.createElement("div");
    this.cursor.className = "cursor";
    this.traces.append(this.cursor);
    this.mark();
  }

  /** Where the marker is in time. */
  mark(time = this.time) {
    this.time = time;
    const layout = this.traces._fullLayout;
    if (!this.cursor || !layout || time === undefined) return;
    const x = layout.xaxis.l2p(time);
    this.cursor.hidden = x < 0 || x > layout.xaxis._length;
    this.cursor.style.transform = `translateX(${layout.xaxis._offset + x}px)`;
    this.cursor.style.top = `${layout._size.t}px`;
    this.cursor.style.height = `${layout._size.h}px`;
  }
}
