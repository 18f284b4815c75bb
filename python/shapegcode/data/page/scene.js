// What the controls of the motion do: one state, of which path, texts, curves and figures show the same instant.

const MAGNIFY = [1, 2, 5, 10, 20, 50, 100, 200, 500, 1000, 2000, 5000, 10000];
const PACES = [0.05, 0.2, 1, 5, 20, 100, 500];
const LOGARITHMIC = new Set(["block_s"]);

class ScenePage {
  constructor(scene) {
    this.scene = scene;
    this.motions = scene.motions;
    this.chief = this.motions[this.motions.length - 1];
    this.time = 0;
    this.stage = new Stage(byId("view"), this.motions, (motion, time) => this.seek(motion, time));
    const near = (motion) => (motion === this.chief ? this.time : 0);
    const pick = (motion, line) => this.seek(motion, motion.timeOfLine(line, near(motion)), line);
    this.lists = this.motions.map((motion) => new ProgramList(byId("program-texts"), motion, pick));
    this.charts = new Charts(scene, (motion, time) => this.seek(motion, time));
    this.#offer();
    this.show(this.chief.key);
    this.seekWorst();
    byId("thinned").textContent = scene.thinned;
    window.addEventListener("beforeprint", () => this.paint());
  }

  #offer() {
    const each = this.motions.map(({ key, label }) => [key, label]);
    const shown = each.length > 1 ? [...each, ["both", "both"]] : [];
    for (const [key, label] of shown) {
      const button = Object.assign(document.createElement("button"), { type: "button", textContent: label });
      button.dataset.show = key;
      button.addEventListener("click", () => this.show(key));
      byId("show").append(button);
    }
    byId("show").hidden = !shown.length;
    const add = (id, rows) => byId(id).append(...rows.map(([value, text]) => new Option(text, value)));
    add("colour", Object.entries(this.scene.channels).map(([name, { label, unit }]) => [name, `${label}, ${unit}`]));
    if (shown.length) add("colour", [["program", "program"]]);
    if (this.scene.channels.deviation) byId("colour").value = "deviation";
    add("pace", PACES.map((pace) => [pace, `${pace}× as fast`]));
    byId("pace").value = PACES.find((pace) => this.chief.duration / pace < 60) ?? PACES[PACES.length - 1];
    byId("magnify").max = MAGNIFY.length - 1;
    byId("magnify").value = this.#fittingMagnify();
    const on = (id, kind, action) => byId(id).addEventListener(kind, action);
    on("colour", "change", () => this.colourBy(byId("colour").value));
    on("magnify", "input", () => this.magnify());
    on("view-3d", "click", () => this.plan(false));
    on("view-plan", "click", () => this.plan(true));
    on("view-fit", "click", () => this.stage.fit());
    on("play", "click", () => (this.playing ? this.stop() : this.play()));
    on("clock", "input", () => { this.stop(); this.seek(this.chief, Number(byId("clock").value)); });
    on("worst", "click", () => { this.stop(); this.seekWorst(); });
    on("block-back", "click", () => this.step(-1));
    on("block-on", "click", () => this.step(1));
    on("trace-kind", "change", () => this.charts.set({ kind: byId("trace-kind").value }));
  }

  /** So that the largest deviation in a cut is drawn as a thirtieth of the path. */
  #fittingMagnify() {
    const most = Math.max(...this.motions.map(({ off, inCuts }) => off.reduce((best, column) =>
      column.reduce((a, b, i) => (inCuts[i] ? Math.max(a, Math.abs(b)) : a), best), 0)));
    const wanted = (this.stage.camera.radius * 1e3) / 30 / (most || 1);
    return Math.max(MAGNIFY.findLastIndex((factor) => factor <= wanted), 0);
  }

  show(key) {
    const both = key === "both";
    this.shown = both ? this.motions : this.motions.filter((motion) => motion.key === key);
    const before = this.chief;
    if (!this.shown.includes(this.chief)) this.chief = this.shown[0];
    for (const button of byId("show").querySelectorAll("button")) {
      button.setAttribute("aria-pressed", button.dataset.show === key);
    }
    this.lists.forEach((list) => { list.box.hidden = !this.shown.includes(list.motion); });
    this.stage.shown = this.shown;
    byId("clock").max = this.chief.duration;
    byId("clock").step = this.chief.duration / 2000 || "any";
    this.charts.set({ shown: this.shown });
    if (both) byId("colour").value = "program";
    else if (byId("colour").value === "program") byId("colour").selectedIndex = 0;
    this.colourBy(byId("colour").value);
    this.magnify();
    if (before !== this.chief) this.seek(before, this.time);
    this.lists.forEach((list) => list.reveal());
    this.#sayWorst();
  }

  seekWorst() {
    this.seek(this.chief, this.chief.timeOf(this.chief.worst));
  }

  #sayWorst() {
    const { label, line, channels, worst } = this.chief;
    byId("worst").hidden = byId("worst-said").hidden = !channels.deviation;
    if (!channels.deviation) return;
    const at = `line ${line[worst]}, ${this.chief.timeOf(worst).toFixed(3)} s`;
    const size = Number(channels.deviation[worst].toPrecision(4));
    byId("worst-said").textContent = `Largest deviation in a cut: ${size} µm at ${at} (${label}).`;
  }

  plan(plan) {
    byId("view-3d").setAttribute("aria-pressed", !plan);
    byId("view-plan").setAttribute("aria-pressed", plan);
    this.stage.setPlan(plan);
  }

  magnify() {
    this.stage.magnify = MAGNIFY[byId("magnify").value];
    const magnification = `×${this.stage.magnify}`;
    byId("magnify-said").textContent = magnification;
    byId("magnify").setAttribute("aria-valuetext", magnification);
    this.stage.draw();
  }

  /** Least and largest value of a channel, of all programs, so that colours can be compared; of a deviation in cuts. */
  #limits(name) {
    let [low, high] = [Infinity, -Infinity];
    for (const { channels, inCuts } of this.motions) {
      (channels[name] ?? []).forEach((value, i) => {
        if (name !== "deviation" || inCuts[i]) [low, high] = [Math.min(low, value), Math.max(high, value)];
      });
    }
    if (!(high > low)) return [low === Infinity ? 0 : low, (low === Infinity ? 0 : low) + 1];
    return LOGARITHMIC.has(name) && low >= 0 ? [Math.max(low, high * 1e-3), high] : [Math.min(low, 0), high];
  }

  colourBy(name) {
    this.colour = name;
    this.stage.flat = name === "program";
    const channel = this.stage.flat ? Object.keys(this.scene.channels)[0] : name;
    const [low, high] = this.#limits(channel);
    const log = LOGARITHMIC.has(channel);
    const scaled = log
      ? (value) => Math.log(Math.max(value, low) / low) / Math.log(high / low)
      : (value) => Math.min((value - low) / (high - low), 1);
    const none = (motion) => new Float32Array(motion.count);
    this.stage.setValues((motion) => Float32Array.from(motion.channels[channel] ?? none(motion), scaled));
    const beyond = this.motions.some(({ channels }) => channels[channel]?.some((value) => value > high));
    this.limits = { low, high, beyond, middle: log ? Math.sqrt(low * high) : (low + high) / 2 };
    this.charts.set({ channel });
    this.#legend();
  }

  #legend() {
    const legend = byId("colours");
    const span = (text, kind, style = "") => {
      const span = Object.assign(document.createElement("span"), { textContent: text, className: kind });
      span.style.background = style;
      return span;
    };
    if (this.stage.flat) {
      legend.replaceChildren(...this.shown.flatMap((motion) => [
        span("", "sample", PROGRAM_COLOURS[this.motions.indexOf(motion)]), span(motion.label, "")]));
      byId("colour-how").textContent = "Each program has its colour; the markers stand at the same position on the part.";
      return;
    }
    const { label, unit, how } = this.scene.channels[this.colour];
    const { low, middle, high, beyond } = this.limits;
    const number = (value) => String(Number(value.toPrecision(3)));
    legend.replaceChildren(span(`${label}, ${unit}`, ""), span(number(low), ""),
      span("", "ramp", `linear-gradient(90deg, ${RAMP.join(",")})`), span(number(high), ""),
      span(`(middle ${number(middle)}${beyond ? "; outside of the cuts it is larger" : ""})`, ""));
    byId("colour-how").textContent = how;
  }

  /** Go to a time of a program; the others go to the same position. */
  seek(motion, time, line = null) {
    const links = this.scene.links;
    const timeOf = (one) => (one === motion || !links ? time : links.time(motion, time));
    this.time = Math.min(Math.max(timeOf(this.chief), 0), this.chief.duration);
    this.stage.marks = this.motions.map((one) => (
      { motion: one, here: one.at(timeOf(one)), chief: one === this.chief }));
    this.stage.draw(false);
    for (const { motion: one, here } of this.stage.marks) {
      this.#mark(one, one === motion && line ? line : one.line[here.i]);
    }
    this.#read();
    this.charts.mark(this.time);
  }

  #mark(motion, line) {
    const list = this.lists[this.motions.indexOf(motion)];
    const links = this.scene.links;
    const section = links?.section(motion, line);
    let note = `line ${line} of ${motion.lines.length}`;
    if (section && !section.unchanged) {
      const other = motion === links.emitted ? "the original" : "what was emitted";
      note += `; lines ${section.lines.join("–")} stand for lines ${section.other.join("–")} of ${other}`;
    } else if (section) note += "; left unchanged";
    list.mark(line, section && !section.unchanged ? section.lines : null, note);
  }

  #read() {
    const { here } = this.stage.marks.find((mark) => mark.chief);
    const line = this.chief.line[here.i];
    const time = `${this.time.toFixed(3)} s of ${this.chief.duration.toFixed(3)} s`;
    byId("clock").value = this.time;
    byId("clock").setAttribute("aria-valuetext", `${time}, line ${line}`);
    byId("clock-said").textContent = `${time} (${this.chief.label})`;
    const head = ["", "time s", "line", "block", "X mm", "Y mm", "Z mm",
      ...Object.values(this.scene.channels).map(({ label, unit }) => `${label} ${unit}`)];
    const rows = this.stage.marks.filter(({ motion }) => this.shown.includes(motion)).map(({ motion, here: at }) => [
      motion.label, motion.timeOf(at.i, at.share).toFixed(3), motion.line[at.i], motion.block[at.i] + 1,
      ...motion.position.map((column) => motion.value(column, at).toFixed(3)),
      ...Object.keys(this.scene.channels).map((name) => {
        const column = motion.channels[name];
        return column ? Number(motion.value(column, at).toPrecision(4)) : "";
      })]);
    const cells = (row, kind) => {
      const lineRow = document.createElement("tr");
      lineRow.append(...row.map((text, k) => {
        const cell = document.createElement(kind === "th" && text !== "" ? "th" : k ? "td" : "th");
        if (cell.tagName === "TH") cell.scope = kind === "th" ? "col" : "row";
        cell.textContent = text;
        cell.className = "figure";
        return cell;
      }));
      return lineRow;
    };
    if (head[0] === "") head[0] = "program";
    byId("reading").replaceChildren(cells(head, "th"), ...rows.map((row) => cells(row, "td")));
  }

  step(direction) {
    const { i } = this.chief.at(this.time);
    const block = this.chief.block[i];
    let k = i;
    if (direction > 0) while (k < this.chief.count - 1 && this.chief.block[k] === block) k++;
    else {
      while (k > 0 && this.chief.block[k] === block) k--;
      while (k > 0 && this.chief.block[k - 1] === this.chief.block[k]) k--;
    }
    this.stop();
    this.seek(this.chief, this.chief.timeOf(k));
  }

  play() {
    if (this.time >= this.chief.duration) this.seek(this.chief, 0);
    this.playing = true;
    let last = performance.now();
    const frame = (now) => {
      if (!this.playing) return;
      this.seek(this.chief, this.time + ((now - last) / 1e3) * Number(byId("pace").value));
      last = now;
      if (this.time >= this.chief.duration) this.stop(); else requestAnimationFrame(frame);
    };
    byId("play").textContent = "❚❚ Pause";
    byId("play").setAttribute("aria-pressed", true);
    requestAnimationFrame((now) => { last = now; frame(now); });
  }

  stop() {
    this.playing = false;
    byId("play").textContent = "▶ Play";
    byId("play").setAttribute("aria-pressed", false);
  }

  /** What paper shows instead: the path from above, in the same colours made darker. */
  paint() {
    const canvas = byId("paper-view");
    const context = canvas.getContext("2d");
    const camera = new Camera(this.stage.low, this.stage.high);
    context.setTransform(2, 0, 0, 2, 0, 0);
    Object.assign(camera, { plan: true, size: [canvas.width / 2, canvas.height / 2] });
    camera.fit();
    context.fillStyle = "#ffffff";
    context.fillRect(0, 0, ...camera.size);
    context.lineWidth = 1;
    const [project, ramp] = [camera.projector(), rampColours(RAMP_ON_PAPER)];
    for (const motion of this.shown) {
      const flat = this.stage.flat ? ["#b85000", "#0072b2"][this.motions.indexOf(motion)] : null;
      paintPath(context, motion, project, this.stage.magnify, this.stage.values.get(motion), ramp, flat);
    }
    drawAxes(context, camera, this.stage.low, this.stage.high, "#000000", "#ffffff");
    drawScales(context, camera, this.stage.magnify, "#000000", "#ffffff");
    const { label, unit } = this.scene.channels[this.colour] ?? {};
    const [low, high] = [this.limits.low, this.limits.high].map((value) => String(Number(value.toPrecision(3))));
    const colours = this.stage.flat
      ? this.shown.map((motion) => `${["orange", "blue"][this.motions.indexOf(motion)]}: ${motion.label}`).join(", ")
      : `${label} from ${low} (dark blue) to ${high} ${unit} (brown)`;
    byId("paper-said").textContent = `Path from above, deviation drawn ×${this.stage.magnify}; ${colours}.`;
  }
}

async function setUpScene() {
  if (!byId("scene-head")) return;
  const message = byId("scene-message");
  message.textContent = "The motion is being unpacked.";
  try {
    const scene = await readScene();
    byId("scene-body").hidden = false;
    window.scenePage = new ScenePage(scene);
    message.textContent = "";
    message.hidden = true;
  } catch (error) {
    byId("scene-body").hidden = true;
    message.hidden = false;
    message.textContent = `The motion cannot be shown. ${error.message}`;
    throw error;
  }
}

// What can be read is painted before anything is unpacked.
requestAnimationFrame(() => setTimeout(setUpScene, 0));
