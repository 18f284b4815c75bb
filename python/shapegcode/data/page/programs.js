// Program text of any length: only the lines that are seen stand in the page.

const LINE_PIXELS = 20;

class ProgramList {
  /** `onPick(motion, line)` is called when somebody chooses a line. */
  constructor(host, motion, onPick) {
    Object.assign(this, { motion, onPick, line: 0, section: null });
    this.box = document.createElement("div");
    this.box.className = "program";
    this.box.dataset.program = motion.key;
    const title = document.createElement("h3");
    title.textContent = `${motion.label}: ${motion.file.split(/[\\/]/).pop()}`;
    title.title = motion.file;
    this.note = document.createElement("p");
    this.note.className = "linked";
    this.list = document.createElement("div");
    this.list.className = "lines";
    this.list.tabIndex = 0;
    this.list.setAttribute("role", "listbox");
    this.list.setAttribute("aria-label", `Lines of the program, ${motion.label}`);
    this.pad = document.createElement("div");
    this.pad.className = "pad";
    this.pad.setAttribute("role", "presentation");
    this.pad.style.height = `${motion.lines.length * LINE_PIXELS}px`;
    this.list.append(this.pad);
    this.box.append(title, this.note, this.list);
    host.append(this.box);
    this.list.addEventListener("scroll", () => this.render());
    this.list.addEventListener("click", (event) => {
      const row = event.target.closest("[data-line]");
      if (row) this.onPick(motion, Number(row.dataset.line));
    });
    this.list.addEventListener("keydown", (event) => this.#key(event));
    new ResizeObserver(() => this.render()).observe(this.list);
  }

  #key(event) {
    const page = Math.max(Math.floor(this.list.clientHeight / LINE_PIXELS) - 1, 1);
    const last = this.motion.lines.length;
    const steps = { ArrowUp: -1, ArrowDown: 1, PageUp: -page, PageDown: page, Home: -last, End: last };
    if (!(event.key in steps)) return;
    event.preventDefault();
    this.onPick(this.motion, Math.min(Math.max(this.line + steps[event.key], 1), last));
  }

  /** Mark a line, and the lines that stand for the same section. */
  mark(line, section, note) {
    this.note.textContent = note;
    if (line === this.line && section?.[0] === this.section?.[0]) return;
    Object.assign(this, { line, section });
    this.reveal();
  }

  /** Scroll to the marked line, unless it is seen. */
  reveal() {
    const top = (this.line - 1) * LINE_PIXELS;
    const seen = this.list.clientHeight;
    if (top < this.list.scrollTop || top + LINE_PIXELS > this.list.scrollTop + seen) {
      this.list.scrollTop = top - seen / 2 + LINE_PIXELS;
    }
    this.render();
  }

  render() {
    const first = Math.max(Math.floor(this.list.scrollTop / LINE_PIXELS) - 4, 0);
    const last = Math.min(first + Math.ceil(this.list.clientHeight / LINE_PIXELS) + 8, this.motion.lines.length);
    const [begin, end] = this.section ?? [Infinity, 0];
    const rows = [];
    for (let rank = first; rank < last; rank++) {
      const row = document.createElement("div");
      row.className = "line";
      row.id = `line-${this.motion.key}-${rank + 1}`;
      row.dataset.line = rank + 1;
      row.setAttribute("role", "option");
      row.setAttribute("aria-selected", rank + 1 === this.line);
      row.classList.toggle("of-section", rank + 1 >= begin && rank + 1 <= end);
      row.style.top = `${rank * LINE_PIXELS}px`;
      const count = document.createElement("span");
      count.className = "count";
      count.textContent = rank + 1;
      row.append(count, this.motion.lines[rank]);
      rows.push(row);
    }
    this.pad.replaceChildren(...rows);
    if (this.line > first && this.line <= last) {
      this.list.setAttribute("aria-activedescendant", `line-${this.motion.key}-${this.line}`);
    } else this.list.removeAttribute("aria-activedescendant");
  }
}
