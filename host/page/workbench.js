// The workbench: path, program, plots and tables of runs, with one cursor and one window.
//
// data ─► run ─► state: one cursor, one window ─► plots, path, code, tables

import { Code } from "page/code.js";
import { button, complain } from "page/dom.js";
import { figure, fixed, span } from "page/format.js";
import { PathView } from "page/path.js";
import { Plots } from "page/plots.js";
import { Run } from "page/run.js";
import { State } from "page/state.js";
import { Tables } from "page/tables.js";
import { work } from "page/work.js";

/** The workbench as the page has it, without a run. */
const empty = document.getElementById("workbench").cloneNode(true);
/** What it shows. */
let page = null;
/** What it is, and what the reader chose of each. */
let shown = "";
const choices = new Map();

/** Shows a source's runs in place of those before; what the reader chose of runs of this name stays. Null if there is nothing to
 * show. */
export function show(given, name = "") {
  let runs = given.map(({ data, program }) => new Run(data, program));
  clear();
  shown = name;
  const kept = choices.get(name);
  if (runs.length === 0 || runs[0].ticks === 0) return null;
  for (const { header } of runs.slice(1).filter((run) => run.ticks === 0)) {
    complain(`${header.program} is not shown: it holds no tick.`);
  }
  runs = runs.filter((run) => run.ticks > 0);
  for (const other of runs.slice(1)) other.matchAxes(runs[0]);
  const state = new State(runs);
  if (kept) state.restore(kept.state);
  document.getElementById("workbench").hidden = false;
  const code = new Code(state);
  page = {
    state,
    run: state.run,
    work,
    code,
    path: new PathView(state, kept?.path),
    plots: new Plots(state),
    tables: new Tables(state, code, kept?.tables),
  };
  makeTools(state);
  makeReadout(state, code);
  tellResolution(state.run);
  state.place(state.placed);
  return page;
}

/** Shows nothing. */
function clear() {
  if (!page) return;
  choices.set(shown, { state: page.state.kept(), path: page.path.kept(), tables: page.tables.kept() });
  page.state.end();
  page = null;
  document.getElementById("workbench").replaceWith(empty.cloneNode(true));
  document.getElementById("tables").replaceChildren();
  document.getElementById("readout").hidden = true;
}

/** Time or path, zoom, the whole run. */
function makeTools(state) {
  const tools = document.querySelector(".plots > .tools");
  const box = tools.appendChild(document.createElement("div"));
  box.className = "choice";
  const over = { time: "Over time [s]", path: "Over path [mm]" };
  const buttonOf = {};
  const layOver = (name) => {
    state.layOver(name);
    for (const [of, made] of Object.entries(buttonOf)) made.setAttribute("aria-pressed", String(of === name));
  };
  for (const [name, text] of Object.entries(over)) {
    buttonOf[name] = box.appendChild(button(text, "", () => layOver(name)));
  }
  layOver(state.over);
  const zoom = (factor) => () => {
    const at = state.xOf(state.run, state.cursor);
    state.zoom(at >= state.from && at <= state.to ? at : (state.from + state.to) / 2, factor);
  };
  const buttons = tools.appendChild(document.createElement("div"));
  buttons.className = "choice";
  buttons.append(button("−", "Zoom out", zoom(2)), button("+", "Zoom in", zoom(0.5)),
    button("All", "The whole run", () => state.showAll()));
  const hint = tools.appendChild(document.createElement("span"));
  hint.className = "remark hint";
  hint.textContent = "Wheel or pinch zooms, shift-drag moves, a click sets the cursor.";
}

/** What holds at the cursor, in a line at the foot of the window. */
function makeReadout(state, code) {
  const readout = document.getElementById("readout");
  readout.replaceChildren();
  const seen = new IntersectionObserver(([{ isIntersecting }]) => {
    readout.hidden = !isIntersecting;
  });
  seen.observe(document.getElementById("workbench"));
  state.on("end", () => seen.disconnect());
  const fields = ["Time", "Path", "Line", "Feed", "Limit", "Contour error", "At"].map((name) => {
    const field = readout.appendChild(document.createElement("span"));
    field.append(Object.assign(document.createElement("small"), { textContent: name }));
    const value = field.appendChild(document.createElement("b"));
    value.dataset.of = name;
    return { field, value };
  });
  const { run } = state;
  const at = (name, unit) => {
    const quantity = run.quantity(name);
    const sample = run.sampleOf(state.cursor);
    return quantity?.range(sample, sample + 1) ? [quantity.low, quantity.high, unit] : null;
  };
  const words = (found, digits = 4) => found && `${span(found[0], found[1], digits)} ${found[2]}`;
  // Programs name feeds in mm/min.
  const perMinute = (found) => found && `${words(found)} (${words([60 * found[0], 60 * found[1], "mm/min"])})`;
  const tell = () => {
    const { cursor } = state;
    const mm = run.pathMm(cursor);
    const line = run.lineAt(cursor);
    const place = run.placeAt(cursor).map((value, i) => (value === null ? null : `${run.header.axes[i].name} ${fixed(value, 3)}`));
    const block = run.blocks.count ? run.blockAt(mm) : -1;
    const ceiling = block >= 0 ? `${figure(run.blocks.ceiling[block], 4)} mm/s, ${run.reasonOf(block).name}` : null;
    const texts = [
      `${fixed(run.timeS(cursor), 4)} s`,
      `${fixed(mm, 3)} mm`,
      line ? `${line} ${code.text(line)}`.trim() : null,
      perMinute(at("feed", "mm/s")),
      ceiling,
      words(at("contour", "µm"), 3),
      place.filter((text) => text !== null).join("  ") || null,
    ];
    fields.forEach(({ field, value }, i) => {
      field.hidden = texts[i] === null;
      value.textContent = texts[i] ?? "";
    });
  };
  state.on("cursor", tell);
}

/** How closely the page tells the run. */
function tellResolution(run) {
  const per = run.ticksPerSample;
  const sample = per === 1
    ? "1 sample = 1 tick"
    : `1 sample = ${per} ticks = ${figure(per * run.tickS * 1e3, 4)} ms, of which the page has the lowest and the highest value`;
  document.getElementById("resolution").textContent = `Finest level of the plots: ${sample}.`;
}
