// Cuts to choose from: sorted by a heading, ticked, summed, named in a command. No row has a listener of its own, and
// only the first rows stand in the page until somebody asks for all.

const SHOWN_CUTS = 500;
// What a prompt of Windows takes is 8191 characters.
const LONGEST_COMMAND = 8000;

class CutPicker {
  constructor(box) {
    this.box = box;
    this.data = dataOf(box.dataset.of);
    this.table = box.querySelector("table");
    this.rows = [...this.table.tBodies[0].rows];
    this.order = this.rows.map((_, rank) => rank);
    this.fixed = new Set(this.data.fixed);
    this.more = box.querySelector(".more");
    this.code = box.querySelector("code");
    this.limit = SHOWN_CUTS;
    this.#head();
    this.#listen();
    this.tick("first");
  }

  #head() {
    const [row] = this.table.tHead.rows;
    for (const cell of row.cells) {
      const button = Object.assign(document.createElement("button"), { type: "button" });
      button.append(...cell.childNodes);
      cell.append(button);
    }
    const head = Object.assign(document.createElement("th"), { className: "tick", textContent: "shape", scope: "col" });
    row.prepend(head);
  }

  #listen() {
    this.table.tHead.addEventListener("click", (event) => {
      const cell = event.target.closest("button")?.closest("th");
      if (cell) this.sort(cell);
    });
    this.table.tBodies[0].addEventListener("change", ({ target }) => {
      this.ticked[Number(target.value)] = target.checked;
      this.sum();
    });
    this.box.querySelector(".ticks").addEventListener("click", ({ target }) => {
      if (target.dataset.tick) this.tick(target.dataset.tick);
    });
    this.more.querySelector("button").addEventListener("click", () => {
      this.limit = Infinity;
      this.render();
    });
    // On paper are all cuts that are shaped; without this script by the style.
    window.addEventListener("beforeprint", () => {
      this.fill(this.order.filter((rank) => this.rows[rank].matches(".shaped")));
    });
    window.addEventListener("afterprint", () => this.render());
  }

  /** Tick all, none, or those of the beginning. */
  tick(which) {
    const first = new Set(this.data.ticked);
    this.ticked = this.rows.map((_, k) => !this.fixed.has(k) && (which === "all" || (which === "first" && first.has(k))));
    this.render();
    this.sum();
  }

  /** By a column: numbers from the largest, texts and lines from the first; once more turns it round; none last. */
  sort(cell) {
    const name = this.data.columns[cell.cellIndex - 1];
    const values = this.data.values[name];
    const isText = typeof values.find((value) => value !== null) === "string";
    const before = cell.getAttribute("aria-sort");
    const up = before ? before === "descending" : isText || name === "first";
    for (const other of cell.parentNode.cells) other.removeAttribute("aria-sort");
    cell.setAttribute("aria-sort", up ? "ascending" : "descending");
    const { compare } = new Intl.Collator("en", { numeric: true });
    const missing = (value) => value === null || value === "";
    this.order = this.rows.map((_, rank) => rank).sort((a, b) => {
      const [x, y] = [values[a], values[b]];
      if (missing(x) || missing(y)) return missing(x) - missing(y) || a - b;
      return (up ? 1 : -1) * (isText ? compare(x, y) : x - y) || a - b;
    });
    // The first of another order are what is looked for: all of them take seconds to lay out.
    this.limit = SHOWN_CUTS;
    this.render();
  }

  /** The first rows in the present order, or all. */
  render() {
    const shown = Math.min(this.limit, this.rows.length);
    this.fill(this.order.slice(0, shown));
    this.more.hidden = shown === this.rows.length;
    this.more.querySelector("span").textContent = `The first ${shown} of ${this.rows.length} cuts in this order.`;
  }

  fill(order) {
    const rows = document.createDocumentFragment();
    for (const rank of order) rows.append(this.#row(rank));
    this.table.tBodies[0].replaceChildren(rows);
  }

  /** A row with its box, which is made when the row is shown first. */
  #row(rank) {
    const row = this.rows[rank];
    let box = row.cells[0].querySelector("input");
    if (!row.cells[0].matches(".tick")) {
      const cell = Object.assign(document.createElement("td"), { className: "tick" });
      if (!this.fixed.has(rank)) {
        box = Object.assign(document.createElement("input"), { type: "checkbox", value: rank });
        box.setAttribute("aria-label", `Shape the cut in lines ${this.#lines(rank)}`);
        cell.append(box);
      }
      row.prepend(cell);
    }
    if (box) box.checked = this.ticked[rank];
    return row;
  }

  #lines(rank) {
    return `${this.data.values.first[rank]}-${this.data.values.last[rank]}`;
  }

  /** Of all cuts, the ticked ones shaped and the others as they are in the original. */
  sum() {
    const { values, totals } = this.data;
    let [count, untried, time, bytes, residual, contour] = [0, 0, 0, 0, 0, 0];
    this.ticked.forEach((ticked, k) => {
      const of = (name) => (ticked ? values[`${name}.emitted`][k] : null) ?? values[`${name}.original`][k] ?? 0;
      residual = Math.max(residual, of("residual_um"));
      contour = Math.max(contour, of("contour_um"));
      if (!ticked) return;
      count += 1;
      untried += values["residual_um.emitted"][k] === null || values["contour_um.emitted"][k] === null;
      time += of("time_s") - (values["time_s.original"][k] ?? 0);
      bytes += values.bytes_added[k] ?? 0;
    });
    const signed = (value, digits) => `${value >= 0 ? "+" : ""}${value.toFixed(digits).replace(/^-(0\.?0*)$/, "$1")}`;
    const change = totals.time_s > 0 ? `${signed((100 * time) / totals.time_s, 1)} % of ${totals.time_s.toFixed(2)} s` : "";
    this.#say("count", `${count} of ${this.rows.length}`);
    this.#say("time", `${signed(time, 2)} s`, change);
    this.#say("residual", `${residual.toFixed(1)} µm`, "", residual, totals.residual_limit_um);
    this.#say("contour", `${contour.toFixed(1)} µm`, "", contour, totals.contour_limit_um);
    this.#say("bytes", `${((totals.bytes + bytes) / 1e3).toFixed(1)} kB`, `${signed(bytes / 1e3, 1)} kB`);
    this.#command(count, untried);
  }

  #say(name, value, change = "", figure = 0, limit = null) {
    const card = this.box.querySelector(`[data-sum="${name}"]`);
    card.querySelector(".value").textContent = value;
    card.querySelector(".change").textContent = change;
    if (limit === null) return;
    const within = figure <= limit;
    card.classList.toggle("within", within);
    card.classList.toggle("over", !within);
    const word = Object.assign(document.createElement("b"), { textContent: within ? "✓ within" : "▲ over" });
    card.querySelector(".limit").replaceChildren(word, ` the limit of ${limit.toFixed(1)} µm`);
  }

  #command(count, untried) {
    const notes = [];
    if (untried) notes.push(`Ticked, but not simulated as shaped, and counted as in the original: ${untried} cuts.`);
    const { first } = this.data.values;
    const ranked = this.rows.map((_, rank) => rank).sort((a, b) => first[a] - first[b]);
    const typed = (ranges) => this.data.command.split("{lines}").join(ranges.join(","));
    let text = typed([...new Set(ranked.filter((rank) => this.ticked[rank]).map((rank) => this.#lines(rank)))]);
    if (text.length > LONGEST_COMMAND) text = typed(this.#runs(ranked));
    if (text.length > LONGEST_COMMAND) notes.push("The command is longer than a Windows prompt takes (8191 characters).");
    if (!count) notes.push("No cut is ticked: run the original program.");
    this.box.querySelector(".note").textContent = notes.join(" ");
    this.code.textContent = count ? text : "";
    this.code.parentNode.hidden = !count;
  }

  /** Ranges of lines over ticked cuts between which there is none that is left unticked. */
  #runs(ranked) {
    const { first, last } = this.data.values;
    const runs = [];
    let open = false;
    for (const rank of ranked) {
      if (this.fixed.has(rank)) continue;
      if (this.ticked[rank] && open) runs.at(-1)[1] = Math.max(runs.at(-1)[1], last[rank]);
      else if (this.ticked[rank]) runs.push([first[rank], last[rank]]);
      open = this.ticked[rank];
    }
    return runs.map(([begin, end]) => `${begin}-${end}`);
  }
}

for (const box of document.querySelectorAll(".cut-picker")) new CutPicker(box);
document.documentElement.classList.remove("starting");
