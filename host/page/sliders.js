// Sliders for the numbers of a machine file. A slider's move is an edit of the file's text.

import { figure } from "page/format.js";

const GROUPS = { path: "Limits", axes: "Axes", regulator: "Regulator", drive: "Drive" };
/** Steps of a slider. */
const STEPS = 1000;
/** Digits of a value that a slider sets. */
const DIGITS = 3;

/** Where a value lies on a slider, 0 to 1: by decades, if it does not begin at 0. */
const partOf = ({ low, high }, value) => {
  const part = low > 0 ? Math.log(value / low) / Math.log(high / low) : (value - low) / (high - low);
  return Math.min(1, Math.max(0, part));
};
const valueAt = ({ low, high }, part) => {
  const value = low > 0 ? low * (high / low) ** part : low + (high - low) * part;
  return Number(value.toPrecision(DIGITS));
};

export class Sliders {
  /** `edit` is called with the edits of a slider's move. */
  constructor(element, edit) {
    Object.assign(this, { element, edit, group: "path", axis: null, evenAxes: true, shown: "" });
    this.tools = element.querySelector(".tools");
    this.rows = element.querySelector(".rows");
  }

  /** Shows the sliders of a machine, with its values. */
  show(sliders, axes) {
    this.all = sliders;
    this.axes = axes;
    if (this.axis >= axes.length) this.axis = null;
    const shown = [this.group, ...axes].join();
    if (shown !== this.shown) {
      this.shown = shown;
      this.makeTools();
      this.makeRows();
    }
    this.place();
  }

  again() {
    this.shown = "";
    this.show(this.all, this.axes);
  }

  makeTools() {
    const choice = document.createElement("div");
    choice.className = "choice";
    choice.setAttribute("role", "group");
    choice.setAttribute("aria-label", "Group of sliders");
    for (const [group, name] of Object.entries(GROUPS)) {
      const button = choice.appendChild(document.createElement("button"));
      button.type = "button";
      button.textContent = name;
      button.dataset.group = group;
      button.setAttribute("aria-pressed", String(group === this.group));
      button.addEventListener("click", () => {
        this.group = group;
        this.again();
      });
    }
    const label = document.createElement("label");
    if (this.group === "path") {
      const box = label.appendChild(document.createElement("input"));
      box.type = "checkbox";
      box.checked = this.evenAxes;
      box.addEventListener("change", () => {
        this.evenAxes = box.checked;
      });
      label.append(" of every axis, too");
    } else {
      label.append("of ");
      const select = label.appendChild(document.createElement("select"));
      select.setAttribute("aria-label", "Axis");
      select.append(new Option("all axes", ""), ...this.axes.map((name, i) => new Option(`axis ${name}`, i)));
      select.value = this.axis ?? "";
      select.addEventListener("change", () => {
        this.axis = select.value === "" ? null : Number(select.value);
        this.place();
      });
    }
    this.tools.replaceChildren(choice, label);
  }

  makeRows() {
    this.inputs = this.all.filter(({ group }) => group === this.group).map((slider) => {
      const row = document.createElement("label");
      row.title = slider.meaning;
      const name = row.appendChild(document.createElement("span"));
      name.textContent = slider.label;
      const input = row.appendChild(document.createElement("input"));
      Object.assign(input, { type: "range", min: 0, max: STEPS });
      Object.assign(input.dataset, { table: slider.table, key: slider.key });
      const output = row.appendChild(document.createElement("output"));
      input.addEventListener("input", () => {
        const value = valueAt(slider, input.valueAsNumber / STEPS);
        this.tell(slider, output, [value]);
        this.edit(this.edits(slider, value));
      });
      return { slider, row, input, output };
    });
    this.rows.replaceChildren(...this.inputs.map(({ row }) => row));
  }

  /** A limit of the path binds only where those of the axes let it. */
  edits({ table, key }, value) {
    if (table !== "path") return [{ table, key, axis: this.axis, value }];
    const ofAxes = this.evenAxes && this.all.some((other) => other.table === "axis" && other.key === key);
    return [{ table, key, value }, ...(ofAxes ? [{ table: "axis", key, value }] : [])];
  }

  /** The values of what is chosen: one, or one of each axis. */
  values({ table, key }) {
    const values = this.all.find((slider) => slider.table === table && slider.key === key)?.values ?? [];
    return table === "path" || this.axis === null ? values : values.slice(this.axis, this.axis + 1);
  }

  tell({ unit }, output, values) {
    const texts = [...new Set(values.map((value) => figure(value, DIGITS + 1)))];
    output.textContent = `${texts.join(" | ")}${unit === "1" ? "" : ` ${unit}`}`;
  }

  place() {
    for (const { slider, input, output } of this.inputs) {
      const values = this.values(slider);
      if (values.length === 0) continue;
      // What the reader moves stays where it is moved to, by a key too: several places of a slider have one value.
      const isThere = input.matches(":active") || valueAt(slider, input.valueAsNumber / STEPS) === values[0];
      if (!isThere) input.value = Math.round(STEPS * partOf(slider, values[0]));
      this.tell(slider, output, values);
    }
  }
}
