// What the machine does: state, positions, feed, messages.

import { fixed } from "page/format.js";
import { ink } from "page/theme.js";

/** Seconds of the strip, and messages that stay. */
const STRIP_S = 20;
const MESSAGES = 50;

export class Display {
  constructor(root) {
    this.root = root;
    this.rows = [];
    this.feeds = [];
    this.board = null;
    this.fields = new Map([...document.querySelectorAll("[data-of]")].map((field) => [field.dataset.of, field]));
  }

  set(name, text) {
    const field = this.fields.get(name);
    if (field && field.textContent !== text) field.textContent = text;
  }

  showBoard(board) {
    this.board = board;
    const number = board.is_fixed_point ? "fixed point" : "f32";
    this.set("machine", `${board.machine} at ${board.port}, ${number}, ${fixed(1 / board.tick_s, 0)} ticks a second`);
    const body = this.root.querySelector(".positions tbody");
    this.rows = board.axes.map(({ name }) => {
      const row = document.createElement("tr");
      const head = row.appendChild(document.createElement("th"));
      head.scope = "row";
      head.textContent = name;
      return { row, head, set: row.appendChild(document.createElement("td")), error: row.appendChild(document.createElement("td")) };
    });
    body.replaceChildren(...this.rows.map(({ row }) => row));
  }

  showUp(isUp) {
    this.root.dataset.up = String(isUp);
    if (!isUp) {
      this.set("state", "no server");
      this.set("detail", "The panel’s server is not there. The board drives what it has, and rests.");
    }
  }

  showState(state, commander) {
    this.root.dataset.state = state.state ?? "";
    this.root.dataset.fault = String(state.fault !== null);
    const isResting = state.under_way === "nothing" && state.state === "held";
    this.set("state", state.is_lost ? "board lost" : isResting && !state.is_foreign ? "ready" : state.state ?? "connecting");
    const detail = { nothing: "", program: "the program", jog: "a jog", homing: `axis ${state.homing ?? ""}` }[state.under_way];
    const foreign = "a program that was not begun here: Abort gives it up";
    this.set("detail", !state.is_ready ? "inputs do not allow the drives to be on" : state.is_foreign ? foreign : detail);
    const fault = this.fields.get("fault");
    fault.hidden = state.fault === null;
    this.set("fault", state.fault === null ? "" : `Fault: ${state.fault}`);
    this.rows.forEach(({ head, set, error }, i) => {
      const { unit, name, has_homing } = this.board.axes[i];
      head.textContent = !has_homing ? name : `${name} ${state.homed[i] ? "homed" : "not homed"}`;
      const [wanted, actual] = [state.set_mm[i], state.actual_mm[i]];
      if (wanted === undefined) return;
      set.textContent = `${fixed(wanted, 3)} ${unit}`;
      error.textContent = `${fixed((wanted - actual) * 1e3, 1)} ${unit === "mm" ? "µm" : "m°"}`;
    });
    this.set("feed", `${fixed(state.feed_mm_s * 60, 0)} mm/min`);
    this.set("line", state.line ? String(state.line) : "–");
    this.set("program", state.program ?? "none");
    this.set("items", state.items ? `${state.items[0]} of ${state.items[1]}` : "–");
    this.set("override", `${fixed(state.override_permille / 10, 0)} %`);
    this.set("commander", { you: "This tab commands.", another: "Another tab commands.", nobody: "Nobody commands yet." }[commander]);
    this.addFeed(state);
  }

  /** The feed of the last seconds. */
  addFeed({ tick, feed_mm_s }) {
    const s = tick * this.board.tick_s;
    const last = this.feeds.at(-1);
    // A board that has started anew counts from 0.
    if (last && s < last[0]) this.feeds = [];
    this.feeds.push([s, feed_mm_s]);
    while (this.feeds[0][0] < s - STRIP_S) this.feeds.shift();
    const strip = this.root.querySelector(".strip");
    const context = strip.getContext("2d");
    const { width, height } = strip;
    const most = Math.max(1e-9, ...this.feeds.map(([, feed]) => feed));
    context.clearRect(0, 0, width, height);
    context.strokeStyle = ink("feed");
    context.lineWidth = 2;
    context.beginPath();
    for (const [at, feed] of this.feeds) {
      context.lineTo(width * (1 - (s - at) / STRIP_S), height - 4 - (height - 8) * (feed / most));
    }
    context.stroke();
  }

  /** A message, the newest first. */
  say(text, kind) {
    const list = this.root.querySelector(".events");
    const item = document.createElement("li");
    item.className = kind;
    item.textContent = text;
    list.prepend(item);
    while (list.children.length > MESSAGES) list.lastChild.remove();
  }
}
