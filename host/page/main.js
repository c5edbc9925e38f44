// Makes the page from the runs of a source.
//
// source ─► data ─► run ─► state: one cursor, one window ─► plots, path, code, tables

import { Code } from "page/code.js";
import { figure, fixed, span } from "page/format.js";
import { PathView } from "page/path.js";
import { Plots } from "page/plots.js";
import { Run } from "page/run.js";
import { embedded } from "page/source.js";
import { State } from "page/state.js";
import { Tables } from "page/tables.js";
import { work } from "page/work.js";

async function start(source) {
  let runs = (await source()).runs.map(({ data, program }) => new Run(data, program));
  if (runs.length === 0 || runs[0].ticks === 0) return null;
  for (const { header } of runs.slice(1).filter((run) => run.ticks === 0)) {
    complain(`${header.program} is not shown: it holds no tick.`);
  }
  runs = runs.filter((run) => run.ticks > 0);
  for (const other of runs.slice(1)) other.matchAxes(runs[0]);
  const state = new State(runs);
  document.getElementById("workbench").hidden = false;
  const code = new Code(state);
  const page = { state, run: state.run, work, code, path: new PathView(state), plots: new Plots(state), tables: new Tables(state, code) };
  makeTools(state);
  makeReadout(state, code);
  tellResolution(state.run);
  state.place(0);
  return page;
}

/** Says what cannot be shown. */
function complain(words) {
  const problem = document.getElementById("problem");
  problem.hidden = false;
  problem.textContent = words;
}

/** Time or path, zoom, the whole run. */
function makeTools(state) {
  const tools = document.querySelector(".plots > .tools");
  const box = tools.appendChild(document.createElement("div"));
  box.className = "choice";
  const button = (parent, text, label, act) => {
    const made = parent.appendChild(document.createElement("button"));
    made.type = "button";
    made.textContent = text;
    if (label) made.setAttribute("aria-label", label);
    made.addEventListener("click", act);
    return made;
  };
  const over = { time: "Over time [s]", path: "Over path [mm]" };
  const buttonOf = {};
  const layOver = (name) => {
    state.layOver(name);
    for (const [of, made] of Object.entries(buttonOf)) made.setAttribute("aria-pressed", String(of === name));
  };
  for (const [name, text] of Object.entries(over)) buttonOf[name] = button(box, text, "", () => layOver(name));
  layOver("time");
  const zoom = (factor) => () => {
    const at = state.xOf(state.run, state.cursor);
    state.zoom(at >= state.from && at <= state.to ? at : (state.from + state.to) / 2, factor);
  };
  const buttons = tools.appendChild(document.createElement("div"));
  buttons.className = "choice";
  button(buttons, "−", "Zoom out", zoom(2));
  button(buttons, "+", "Zoom in", zoom(0.5));
  button(buttons, "All", "The whole run", () => state.showAll());
  const hint = tools.appendChild(document.createElement("span"));
  hint.className = "remark hint";
  hint.textContent = "Wheel or pinch zooms, shift-drag moves, a click sets the cursor.";
}

/** What holds at the cursor, in a line at the foot of the window. */
function makeReadout(state, code) {
  const readout = document.getElementById("readout");
  new IntersectionObserver(([{ isIntersecting }]) => {
    readout.hidden = !isIntersecting;
  }).observe(document.getElementById("workbench"));
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

try {
  // For those who look behind the page, and for its tests.
  window.motion = await start(embedded);
  document.documentElement.dataset.state = "ready";
} catch (error) {
  complain(`The page cannot show its data: ${error.message}`);
  document.documentElement.dataset.state = "failed";
  throw error;
}
