// The program's text, with the line at the cursor marked. Only the lines that are seen are in the document.

const ROW_PX = 20;
/** Lines above and below those that are seen. */
const MORE = 8;

export class Code {
  constructor(state) {
    this.state = state;
    const section = document.getElementById("code");
    const text = state.run.program?.text;
    if (text === undefined) {
      section.hidden = true;
      return;
    }
    // The reader counts a line for each line feed; a last one ends the last line.
    this.lines = text.replace(/\n$/, "").split("\n");
    this.list = section.querySelector(".lines");
    this.inner = this.list.appendChild(document.createElement("div"));
    this.inner.style.height = `${this.lines.length * ROW_PX}px`;
    this.digits = String(this.lines.length).length;
    this.list.addEventListener("scroll", () => this.draw());
    this.list.addEventListener("click", (event) => {
      const row = event.target.closest("[data-line]");
      if (row) this.visit(Number(row.dataset.line));
    });
    this.list.addEventListener("keydown", (event) => {
      const by = { ArrowUp: -1, ArrowDown: 1 }[event.key];
      if (!by) return;
      state.visit(state.run.tickOfNeighbour(state.cursor, by));
      event.preventDefault();
    });
    state.on("cursor", () => this.follow());
    const resized = new ResizeObserver(() => this.draw());
    resized.observe(this.list);
    state.on("end", () => resized.disconnect());
    this.follow();
  }

  /** The text of a line, from 1. */
  text(line) {
    return this.lines?.[line - 1]?.trim() ?? "";
  }

  /** Goes to where the path comes to a line, or to the next line that moves. */
  visit(line) {
    for (let wanted = line; wanted <= this.lines.length; wanted += 1) {
      const tick = this.state.run.tickOfLine(wanted);
      if (tick !== undefined) {
        this.state.visit(tick);
        return;
      }
    }
  }

  follow() {
    const line = this.state.run.lineAt(this.state.cursor);
    if (line === this.line) return;
    this.line = line;
    const top = (line - 1) * ROW_PX;
    const { scrollTop, clientHeight } = this.list;
    if (line > 0 && (top < scrollTop || top + ROW_PX > scrollTop + clientHeight)) {
      this.list.scrollTop = top - clientHeight / 2 + ROW_PX / 2;
    }
    this.draw();
  }

  draw() {
    const { scrollTop, clientHeight } = this.list;
    const first = Math.max(0, Math.floor(scrollTop / ROW_PX) - MORE);
    const last = Math.min(this.lines.length, Math.ceil((scrollTop + clientHeight) / ROW_PX) + MORE);
    const rows = [];
    for (let i = first; i < last; i += 1) {
      const row = document.createElement("div");
      row.className = "row";
      row.setAttribute("role", "option");
      row.setAttribute("aria-selected", String(i + 1 === this.line));
      row.dataset.line = i + 1;
      row.style.top = `${i * ROW_PX}px`;
      const number = row.appendChild(document.createElement("span"));
      number.textContent = String(i + 1).padStart(this.digits, "\u2007");
      row.append(this.lines[i]);
      rows.push(row);
    }
    this.inner.replaceChildren(...rows);
  }
}
