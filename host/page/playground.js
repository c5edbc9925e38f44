// The playground: a program and a machine that are edited here, planned and run in the page itself.
//
// editor, sliders, dropped files ─► request ─► engine ─► answer ─► workbench

import { Data, inflate, inflateBytes } from "page/data.js";
import { complain, make } from "page/dom.js";
import { Engine } from "page/engine.js";
import { drawFigure } from "page/figures.js";
import { figure } from "page/format.js";
import { Sliders } from "page/sliders.js";
import { cell, table } from "page/tables.js";
import { show } from "page/workbench.js";

/** Time without a key until what was typed is run [ms]. */
const TYPED_MS = 300;
/** Time until the progress of a request is shown [ms]. */
const PROGRESS_MS = 150;

const element = (id) => document.getElementById(id);
const [bench, headline] = [element("bench"), element("headline")];
const texts = { program: element("program-text"), machine: element("machine-text") };
const words = { reading: "Reading", planning: "Planning", running: "Running", writing: "Writing the result" };

class Playground {
  constructor(module, { program, machine }) {
    this.names = { program: program.name, machine: machine.name };
    texts.program.value = program.text;
    texts.machine.value = machine.text;
    this.sheet = "program";
    /** The machine as it was before edits that are still under way, and these. */
    this.base = machine.text;
    this.edits = [];
    /** Figures of an experiment. */
    this.figures = [];
    /** Answers shown, for tests. */
    this.shown = 0;
    /** Requests, and the latest of which an answer is shown. */
    this.asked = 0;
    this.answered = 0;
    /** Programs and machines from elsewhere. */
    this.taken = 0;
    this.engine = new Engine(module, (stage, part) => this.tell(stage, part));
    this.sliders = new Sliders(element("sliders"), (edits) => {
      this.edits = [...this.edits, ...edits];
      // Tuning takes its time, and is asked for.
      if (this.sheet !== "drive" || element("drive").elements.experiment.value !== "tune") this.ask();
    });
    this.listen();
  }

  listen() {
    for (const button of bench.querySelectorAll("button[data-sheet]")) {
      button.addEventListener("click", () => this.turnTo(button.dataset.sheet));
    }
    for (const text of Object.values(texts)) {
      text.addEventListener("input", () => {
        if (text === texts.machine) {
          // What is typed is the machine; no slider writes over it.
          this.base = text.value;
          this.edits = [];
        }
        clearTimeout(this.typed);
        this.typed = setTimeout(() => this.ask(), TYPED_MS);
      });
    }
    element("ramp").addEventListener("input", () => this.ask());
    element("ramp").addEventListener("submit", (event) => event.preventDefault());
    element("drive").addEventListener("submit", (event) => {
      event.preventDefault();
      this.ask();
    });
    element("cancel").addEventListener("click", () => {
      clearTimeout(this.typed);
      this.engine.drop();
      this.say("Cancelled. What is shown is the result before.", "unfinished");
    });
    element("open").addEventListener("click", () => element("file").click());
    element("file").addEventListener("change", ({ target }) => {
      this.open(target.files[0]);
      // The same file may be opened again.
      target.value = "";
    });
    element("save").addEventListener("click", () => this.save());
    const drag = (isOver) => document.body.classList.toggle("dragged", isOver);
    addEventListener("dragover", (event) => {
      event.preventDefault();
      drag(true);
    });
    addEventListener("dragleave", (event) => drag(event.relatedTarget !== null));
    addEventListener("drop", (event) => {
      event.preventDefault();
      drag(false);
      const [file] = event.dataTransfer.files;
      if (file) this.open(file);
    });
    addEventListener("paste", (event) => {
      const text = event.clipboardData.getData("text");
      if (!text || event.target.closest?.("textarea,input,select")) return;
      this.take("pasted.ngc", text);
    });
  }

  /** Shows a sheet, and what it says, unless that is `asked` for already. */
  turnTo(sheet, asked = false) {
    clearTimeout(this.typed);
    const isText = (of) => of in texts;
    const isNew = !(isText(sheet) && isText(this.sheet)) && sheet !== this.sheet;
    this.sheet = sheet;
    for (const of of bench.querySelectorAll("[data-sheet]")) {
      if (of.matches("button")) of.setAttribute("aria-pressed", String(of.dataset.sheet === sheet));
      else of.hidden = of.dataset.sheet !== sheet;
    }
    element("save").hidden = !isText(sheet);
    element("sliders").hidden = sheet === "ramp";
    // An experiment is made when it is asked for.
    if (isNew && !asked && sheet !== "drive") this.ask();
  }

  async open(file) {
    if (file) this.take(file.name, await file.text());
  }

  /** A text from elsewhere: a machine file, if its name says so, or a program. */
  take(name, text) {
    const of = name.toLowerCase().endsWith(".toml") ? "machine" : "program";
    this.names[of] = name;
    texts[of].value = text;
    if (of === "machine") {
      this.base = text;
      this.edits = [];
    }
    this.taken += 1;
    this.turnTo(of, true);
    this.ask();
  }

  save() {
    const link = document.createElement("a");
    link.download = this.names[this.sheet];
    link.href = URL.createObjectURL(new Blob([texts[this.sheet].value]));
    link.click();
    setTimeout(() => URL.revokeObjectURL(link.href), 1000);
  }

  request() {
    if (this.sheet === "ramp") {
      const fields = Object.fromEntries(new FormData(element("ramp")));
      const numbers = Object.entries(fields).map(([name, text]) => [name, name === "law" ? text : Number(text)]);
      return { do: "ramp", ...Object.fromEntries(numbers) };
    }
    const machine = { machine_name: this.names.machine, machine: this.base, edits: this.edits };
    if (this.sheet === "drive") {
      const { experiment, axis } = Object.fromEntries(new FormData(element("drive")));
      return { do: "drive", experiment, axis: Number(axis ?? 0), ...machine };
    }
    return { do: "run", name: this.names.program, program: texts.program.value, ...machine };
  }

  /** Asks for what the sheets say, and shows the answer. */
  async ask() {
    clearTimeout(this.typed);
    const since = performance.now();
    this.since = since;
    const request = this.request();
    if (request.do === "ramp" && !element("ramp").checkValidity()) {
      this.say("found a field without a number, expected one that is not below 0", "faulted");
      return;
    }
    this.asked += 1;
    const number = this.asked;
    const name = `${request.do} ${this.taken}`;
    let answer;
    try {
      answer = await this.engine.ask(request);
    } catch (error) {
      this.say(`The module stopped: ${error.message}`, "faulted");
      return;
    }
    // A later request has taken its place.
    if (!answer) return;
    const { header, data } = answer;
    const inflated = header.error || request.do === "drive" ? null : await inflateBytes(data);
    // While it was inflated, a later one was shown.
    if (number < this.answered) return;
    this.answered = number;
    if (header.error) {
      // The machine is what its sliders say, also where the program is refused.
      if (header.machine !== undefined) this.takeMachine(request, header);
      this.say(header.error, "faulted");
      this.point(header.error);
      this.shown += 1;
      return;
    }
    for (const drawn of this.figures) drawn.end();
    this.figures = [];
    const runs = [];
    if (inflated) runs.push({ data: new Data(inflated), program: null });
    if (request.do !== "ramp") this.takeMachine(request, header);
    if (request.do === "drive") {
      const { outcome, is_good: isGood } = header;
      const drawings = make("div", { class: "drawings" });
      element("outcome").replaceChildren(make("p", { class: `result ${isGood ? "done" : "faulted"}` }, outcome));
      headline.replaceChildren(...this.experiment(header), drawings);
      // They are as wide as their place.
      this.figures = header.figures.map((of) => drawFigure(drawings.appendChild(make("div")), of));
    } else if (request.do === "run") {
      runs[0].program = { text: request.program, times: header.times };
      headline.innerHTML = header.headline;
      // How it ended stands above the plots.
      element("outcome").replaceChildren(...headline.querySelectorAll("header"));
    } else {
      element("outcome").replaceChildren();
      headline.replaceChildren();
      element("ramp-figures").replaceChildren(rampFigures(header.figures));
    }
    this.page = show(runs, name);
    this.digest = header.digest;
    this.say("", "");
    this.shown += 1;
    this.took = performance.now() - since;
  }

  /** The machine as it was run; edits that came since then are still to be made. */
  takeMachine(request, { machine, sliders, axes }) {
    if (request.machine !== this.base) return;
    if (texts.machine.value !== machine) texts.machine.value = machine;
    if (request.edits.length < this.edits.length) return;
    this.base = machine;
    this.edits = [];
    this.sliders.show(sliders, axes);
    const select = element("drive").elements.axis;
    const chosen = select.value;
    select.replaceChildren(...axes.map((name, i) => new Option(name, i, false, String(i) === chosen)));
  }

  /** The tables of an experiment, and what tuning proposes to take. */
  experiment({ tables, tuned }) {
    const shown = tables.map(({ title, words: lines, head, rows }) => make("section", {},
      make("h2", {}, title),
      table(title, head, rows.map((row) => make("tr", {}, ...row.map((value, i) => {
        if (typeof value === "number") return cell(figure(value, 5));
        return head[i].startsWith("*") ? make("td", { class: "word long" }, value) : cell(value);
      })))),
      ...(lines.length ? [make("pre", {}, lines.join("\n"))] : [])));
    if (!tuned) return shown;
    const take = make("button", { type: "button", class: "take" }, "Use the tuned machine");
    take.addEventListener("click", () => this.take("tuned.toml", tuned));
    return [take, ...shown];
  }

  /** How far a request is that takes its time. */
  tell(stage, part) {
    if (performance.now() - this.since < PROGRESS_MS) return;
    const bar = bench.querySelector("progress");
    bar.hidden = false;
    bar.value = part;
    element("cancel").hidden = false;
    const output = bench.querySelector("#status output");
    output.className = "";
    output.textContent = `${words[stage]}, ${Math.round(100 * part)} %`;
  }

  say(text, kind) {
    bench.querySelector("progress").hidden = true;
    element("cancel").hidden = true;
    const output = bench.querySelector("#status output");
    output.className = text && `result ${kind}`;
    output.textContent = text;
  }

  /** Selects the line that an error names. */
  point(error) {
    const of = Object.keys(texts).find((name) => error.startsWith(`${this.names[name]}:`));
    const line = of && Number(error.slice(this.names[of].length + 1).match(/^\d+/)?.[0]);
    if (!line || document.activeElement === texts[of]) return;
    const before = texts[of].value.split("\n").slice(0, line - 1).join("\n").length + (line > 1 ? 1 : 0);
    const length = texts[of].value.slice(before).split("\n")[0].length;
    texts[of].setSelectionRange(before, before + length);
  }
}

/** A ramp in the papers' figures. */
function rampFigures(figures) {
  const list = document.createElement("dl");
  list.className = "figures";
  for (const [name, value, unit] of [
    ["Duration t_p", figures.tp_s, "s"],
    ["Length", figures.length_mm, "mm"],
    ["Peak jerk", figures.peak_jerk_mm_s3, "mm/s³"],
    ["Edge of a pulse", figures.edge_s, "s"],
    ["Plateau of a pulse", figures.plateau_s, "s"],
    ["End of the rise t₁", figures.t1_s, "s"],
    ["Begin of the fall t₂", figures.t2_s, "s"],
    ["Limited by", figures.limited_by, ""],
  ]) {
    const row = list.appendChild(document.createElement("div"));
    row.append(Object.assign(document.createElement("dt"), { textContent: name }));
    const text = typeof value === "number" ? `${figure(value, 6)} ${unit}` : value;
    row.append(Object.assign(document.createElement("dd"), { textContent: text }));
  }
  return list;
}

/** What is embedded in the page, inflated; its text is as long as the page. */
async function embedded(id) {
  const script = element(id);
  const bytes = await inflate(script.textContent);
  script.remove();
  return bytes;
}

try {
  const [module, sheets] = await Promise.all(["module", "sheets"].map(embedded));
  const playground = new Playground(module, JSON.parse(new TextDecoder().decode(sheets)));
  // For those who look behind the page, and for its tests.
  window.playground = playground;
  await playground.ask();
  document.documentElement.dataset.state = "ready";
} catch (error) {
  complain(`The page does not start: ${error.message}`);
  document.documentElement.dataset.state = "failed";
  throw error;
}
