// What the page says in tables: worst places, time by reason, blocks, and two runs beside each other.

import { make } from "page/dom.js";
import { figure, fixed } from "page/format.js";

const BLOCKS_PER_PAGE = 20;

/** A table that scrolls by itself where the page is too narrow. Headings of words begin with a star; a name that is not ours
 * is a heading as it is, in a list of its own. */
export function table(name, headings, rows) {
  const head = headings.map((heading) => {
    if (Array.isArray(heading)) return make("th", { scope: "col" }, heading[0]);
    const isWord = heading.startsWith("*");
    const [word, unit] = heading.replace("*", "").split(" [");
    const cell = make("th", { scope: "col", ...(isWord && { class: "word" }) }, word);
    if (unit) cell.append(" ", make("span", { class: "unit" }, unit.replace("]", "")));
    return cell;
  });
  return make("div", { class: "scroll", role: "region", "aria-label": name, tabindex: 0 },
    make("table", {}, make("thead", {}, make("tr", {}, ...head)), make("tbody", {}, ...rows)));
}

export const cell = (text, isWord) => make("td", isWord ? { class: "word" } : {}, text);

export class Tables {
  /** `kept` is what the reader chose of the tables that were shown before, if there were any. */
  constructor(state, code, kept) {
    this.state = state;
    this.code = code;
    this.chosen = kept ?? "contour error";
    const parent = document.getElementById("tables");
    const sections = [this.runs(), this.times(), this.worst(), this.blocks()].filter(Boolean);
    parent.replaceChildren(...sections);
  }

  /** What the reader chose: the quantity whose worst places are shown. */
  kept() {
    return this.chosen;
  }

  /** Two runs beside each other. */
  runs() {
    const { runs } = this.state;
    if (runs.length < 2) return null;
    const duration = (run) => run.ticks * run.tickS;
    const figures = [["Time", "s", runs.map(duration)], ["Path length", "mm", runs.map((run) => run.header.length_mm)]];
    for (const { name, unit } of runs[0].header.worst) {
      const of = (run) => run.header.worst.find((other) => other.name === name)?.places[0]?.value;
      figures.push([`Highest ${name}`, unit, runs.map((run) => Math.abs(of(run) ?? NaN))]);
    }
    const rows = figures.map(([name, unit, [a, b]]) => {
      const change = Number.isFinite(a) && b ? `${fixed(100 * (a / b - 1), 1)} %` : "–";
      return make("tr", {}, make("th", { scope: "row" }, `${name} [${unit}]`), cell(figure(a, 6)), cell(figure(b, 6)), cell(change));
    });
    const names = runs.map((run) => run.header.program);
    return make("section", {}, make("h2", {}, "Two runs"),
      make("p", {}, `Drawn in full: ${names[0]}; paler, dashed in the plots and grey in the path: ${names[1]}.`),
      table("Two runs", ["*Figure", ...names.map((of) => [of]), "first to second"], rows));
  }

  times() {
    const programs = this.state.runs.map((run) => run.program);
    if (!programs[0]) return null;
    const total = programs[0].times.reduce((sum, [, time]) => sum + time, 0);
    const sorted = [...programs[0].times].sort((a, b) => b[1] - a[1]);
    const rows = sorted.map(([reason, time]) => {
      const share = total > 0 ? time / total : 0;
      const bar = make("td", { class: "bar" }, make("i", { style: `width:${(100 * share).toFixed(2)}%` }));
      return make("tr", {}, make("th", { scope: "row" }, reason), cell(fixed(time, 3)), cell(`${fixed(100 * share, 1)} %`), bar);
    });
    return make("section", {}, make("h2", {}, "Where the time goes"),
      make("p", {}, `The plan’s ${fixed(total, 3)} s, by what holds the feed down.`),
      table("Time by reason", ["*Reason", "Time [s]", "Share", ""], rows));
  }

  worst() {
    const { state, code } = this;
    const { worst } = state.run.header;
    if (worst.length === 0) return null;
    const choice = make("div", { class: "choice", role: "group", "aria-label": "Quantity" });
    const place = make("div");
    const show = ({ name, unit, places }, button) => {
      this.chosen = name;
      for (const other of choice.children) other.setAttribute("aria-pressed", String(other === button));
      const rows = places.map(({ tick, line, s_mm, value }) => {
        const time = tick * state.run.tickS;
        const go = make("button", { type: "button", class: "go", "data-tick": tick }, figure(value, 6));
        go.addEventListener("click", () => {
          state.visit(tick - state.run.firstTick);
          document.getElementById("workbench").scrollIntoView({ block: "start" });
        });
        return make("tr", {}, make("td", {}, go), cell(line ? String(line) : "–"), cell(fixed(time, 4)), cell(fixed(s_mm, 3)),
          make("td", { class: "word text" }, code.text(line)));
      });
      place.replaceChildren(table(`Worst places: ${name}`, [`${name} [${unit}]`, "Line", "Time [s]", "Path [mm]", "*Program"], rows));
    };
    for (const quantity of worst) {
      const button = make("button", { type: "button" }, quantity.name);
      button.addEventListener("click", () => show(quantity, button));
      choice.append(button);
    }
    const first = Math.max(0, worst.findIndex((quantity) => quantity.name === this.chosen));
    show(worst[first], choice.children[first]);
    return make("section", { id: "worst" }, make("h2", {}, "Worst places"),
      make("p", {}, "Where the quantity is greatest, each visit to a line once. A value goes there."), choice, place);
  }

  /** Blocks around the cursor. */
  blocks() {
    const { run } = this.state;
    const { blocks } = run;
    if (blocks.count === 0) return null;
    const place = make("div");
    const where = make("span", { class: "remark" });
    const back = make("button", { type: "button" }, "Earlier");
    const on = make("button", { type: "button" }, "Later");
    let page = -1;
    const show = (wanted) => {
      const last = Math.floor((blocks.count - 1) / BLOCKS_PER_PAGE);
      const next = Math.min(last, Math.max(0, wanted));
      const isSame = next === page;
      page = next;
      const current = run.blockAt(run.pathMm(this.state.cursor));
      if (!isSame) {
        const first = page * BLOCKS_PER_PAGE;
        const end = Math.min(blocks.count, first + BLOCKS_PER_PAGE);
        where.textContent = `Blocks ${first + 1} to ${end} of ${blocks.count} in path order.`;
        const rows = [];
        for (let i = first; i < end; i += 1) rows.push(this.blockRow(i));
        place.replaceChildren(table("Blocks",
          ["*Line", "*Kind", "Length [mm]", "Ceiling [mm/s]", "*Limited by", "Enter [mm/s]", "Peak [mm/s]", "Exit [mm/s]", "Time [ms]"], rows));
      }
      for (const row of place.querySelectorAll("tr[data-block]")) {
        row.classList.toggle("current", Number(row.dataset.block) === current);
      }
    };
    back.addEventListener("click", () => show(page - 1));
    on.addEventListener("click", () => show(page + 1));
    this.state.on("cursor", () => show(Math.floor(run.blockAt(run.pathMm(this.state.cursor)) / BLOCKS_PER_PAGE)));
    show(0);
    const isMany = blocks.count > BLOCKS_PER_PAGE;
    const tools = make("div", { class: "tools" }, where, ...(isMany ? [back, on] : []));
    return make("section", { id: "blocks" }, make("h2", {}, "Blocks"), tools, place);
  }

  blockRow(i) {
    const { run } = this.state;
    const { blocks } = run;
    const length = blocks.start[i + 1] - blocks.start[i];
    const kind = run.header.kinds[blocks.kind[i]] + (blocks.isRapid[i] ? ", rapid" : "");
    const row = make("tr", { "data-block": i }, make("th", { scope: "row" }, String(blocks.line[i])), cell(kind, true),
      cell(fixed(length, 3)), cell(fixed(blocks.ceiling[i], 2)), cell(run.reasonOf(i).name, true),
      ...[blocks.enter[i], blocks.peak[i], blocks.exit[i]].map((feed) => cell(fixed(feed, 2))), cell(fixed(blocks.time[i] * 1e3, 2)));
    row.addEventListener("click", () => this.state.visit(run.tickAtPath(blocks.start[i] + length / 2)));
    return row;
  }
}
