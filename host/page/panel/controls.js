// Buttons and keys: what the operator does becomes a command.

import { fixed } from "page/format.js";

/** While a jog key is down, the server hears of it this often; it waits 400 ms. */
const KEEP_MS = 100;
/** How far a key goes at most on an axis without soft limits [mm, °]. */
const FAR = 1000;

/** Keys as LinuxCNC's operators know them. */
const COMMANDS = { r: "start", p: "hold", s: "resume", Escape: "abort", t: "single_block", F2: "drives", Home: "home" };
const JOGS = { ArrowLeft: ["X", "-"], ArrowRight: ["X", "+"], ArrowDown: ["Y", "-"], ArrowUp: ["Y", "+"], PageDown: ["Z", "-"], PageUp: ["Z", "+"] };
const OVERRIDES = "`1234567890";

export class Controls {
  constructor(root, link, complain) {
    this.root = root;
    this.link = link;
    this.complain = complain;
    this.state = null;
    this.board = null;
    /** What holds the jog key down: a pointer or a key of the keyboard. */
    this.held = null;
    root.addEventListener("click", ({ target }) => this.act(target.closest("button[data-do]")?.dataset.do));
    this.field("single_block", "do").addEventListener("change", ({ target }) => this.say("single_block", { is_on: target.checked }));
    const override = this.field("override", "do");
    override.addEventListener("input", () => this.say("override", { permille: 10 * Number(override.value) }));
    // Whoever scrolls the page means the page: the slider is chosen first.
    override.addEventListener("wheel", (event) => {
      if (document.activeElement !== override || event.deltaY === 0) return;
      event.preventDefault();
      this.setOverride(Number(override.value) + (event.deltaY < 0 ? 1 : -1));
    }, { passive: false });
    this.field("jog_share").addEventListener("input", () => this.tellFeed());
    root.querySelector("input[type=file]").addEventListener("change", ({ target }) => {
      if (target.files[0]) this.load(target.files[0]);
      target.value = "";
      target.blur();
    });
    // Keys are the panel's again.
    this.field("distance").addEventListener("change", ({ target }) => target.blur());
    addEventListener("dragover", (event) => event.preventDefault());
    addEventListener("drop", (event) => {
      event.preventDefault();
      if (event.dataTransfer.files[0]) this.load(event.dataTransfer.files[0]);
    });
    addEventListener("keydown", (event) => this.keyDown(event));
    addEventListener("keyup", (event) => this.keyUp(event));
    addEventListener("pointerup", () => this.release("pointer"));
    addEventListener("pointercancel", () => this.release("pointer"));
    addEventListener("lostpointercapture", () => this.release("pointer"));
    // Whoever looks elsewhere holds no key.
    addEventListener("blur", () => this.release(this.held));
    document.addEventListener("visibilitychange", () => this.release(this.held));
  }

  field(name, kind = "of") {
    return this.root.querySelector(`[data-${kind}="${name}"]`);
  }

  say(what, more = {}) {
    const isSaid = this.link.say({ do: what, ...more });
    if (!isSaid && what !== "keep" && what !== "release") this.complain(`${what}: nobody is there to hear it`);
  }

  /** The server is not there: what is pressed now is not said. */
  lose() {
    this.drop();
    for (const button of this.root.querySelectorAll("button")) button.disabled = true;
  }

  /** A key that is down is not held any more. */
  drop() {
    clearInterval(this.keeping);
    this.keeping = undefined;
    this.held = null;
  }

  showBoard(board) {
    this.drop();
    this.board = board;
    const keys = this.root.querySelector(".keys");
    keys.replaceChildren(...board.axes.flatMap(({ name }) => ["-", "+"].map((direction) => {
      const button = document.createElement("button");
      button.type = "button";
      button.textContent = `${name} ${direction === "-" ? "−" : "+"}`;
      button.dataset.key = name + direction;
      button.addEventListener("pointerdown", (event) => {
        if (event.button !== 0) return;
        // The press stays with the button, wherever the pointer goes.
        button.setPointerCapture(event.pointerId);
        this.press(name, direction, "pointer");
      });
      button.addEventListener("contextmenu", (event) => event.preventDefault());
      return button;
    })));
    const homed = board.axes.filter(({ has_homing }) => has_homing);
    this.root.querySelector(".home").hidden = homed.length === 0;
    this.field("home_axis").replaceChildren(...homed.map(({ name }) => new Option(name)));
    this.tellFeed();
  }

  showState(state, commander) {
    this.state = state;
    const isFree = state.under_way === "nothing" && !state.is_lost;
    const isOff = state.state === "drives off";
    const may = {
      take: commander !== "you",
      drives_on: isOff && state.is_ready && state.fault === null,
      drives_off: !isOff,
      clear_fault: state.fault !== null,
      start: isFree && !isOff && state.program !== null,
      resume: state.under_way !== "nothing" && (state.state === "held" || state.state === "program stop"),
      home: isFree && !isOff,
      home_all: isFree && !isOff,
      hold: true,
      abort: true,
      capture: true,
    };
    for (const [what, is] of Object.entries(may)) this.field(what, "do").disabled = !is;
    // A button that is switched off while it is down tells nobody of its release.
    const mayJog = !isOff && state.under_way !== "program" && state.under_way !== "homing";
    for (const button of this.root.querySelectorAll("[data-key]")) button.disabled = !mayJog && this.held === null;
    this.field("capture", "do").textContent = state.is_capturing ? "Waiting: capture anew" : "Capture";
    this.field("single_block", "do").checked = state.is_single_block;
    const override = this.field("override", "do");
    if (document.activeElement !== override) override.value = state.override_permille / 10;
  }

  /** The feed of a jog key: the share of the axis' greatest one that the slider has [mm/s]. */
  feedOf(name) {
    const axis = this.board.axes.find((other) => other.name === name);
    return axis.feed_mm_s * (Number(this.field("jog_share").value) / 100);
  }

  tellFeed() {
    this.field("jog_feed").textContent = this.board.axes.map(({ name, unit }) => `${name} ${fixed(60 * this.feedOf(name), 0)} ${unit}/min`).join(", ");
  }

  setOverride(percent) {
    const permille = 10 * Math.min(200, Math.max(0, Math.round(percent)));
    this.field("override", "do").value = permille / 10;
    this.say("override", { permille });
  }

  act(what) {
    switch (what) {
      case undefined: return;
      case "drives_on": this.say("drives", { are_on: true }); return;
      case "drives_off": this.say("drives", { are_on: false }); return;
      case "drives": this.say("drives", { are_on: this.state?.state === "drives off" }); return;
      case "single_block": this.say("single_block", { is_on: !this.state?.is_single_block }); return;
      case "home": {
        const axis = this.field("home_axis").value;
        if (axis) this.say("home", { axis });
        return;
      }
      case "home_all": this.say("home"); return;
      case "capture": {
        const trigger = this.field("trigger").value.trim();
        const number = (name) => Math.max(0, Math.round(Number(this.field(name).value) || 0));
        this.say("capture", { trigger: trigger || null, before: trigger ? number("before") : 0, after: number("after") });
        return;
      }
      default: this.say(what);
    }
  }

  async load(file) {
    this.say("load", { name: file.name, text: await file.text() });
  }

  keyDown(event) {
    const { key, code, target } = event;
    // With a modifier a key is another one, and some of them are never told to be up again.
    if (event.ctrlKey || event.altKey || event.metaKey) {
      this.release(this.held);
      if (key !== "Home" || !event.ctrlKey || event.altKey || event.metaKey || event.repeat) return;
    }
    const isText = target.closest?.("input[type=text],input[type=number],textarea");
    const command = COMMANDS[key.length === 1 ? key.toLowerCase() : key];
    // Stops are obeyed wherever they are pressed, but for a letter that is being written.
    const isStop = key === "Escape" || (command === "hold" && !isText);
    // Plots, path, lists and sliders have keys of their own.
    const isTaken = isText || target.closest?.("select,input[type=range],[role=application],[role=listbox],.stage");
    if (isTaken && !isStop) return;
    const jog = JOGS[key];
    const override = key.length === 1 ? OVERRIDES.indexOf(key) : -1;
    if (jog) {
      if (!event.repeat && this.board?.axes.some(({ name }) => name === jog[0])) this.press(...jog, code);
    } else if (command) {
      if (!event.repeat) this.act(event.ctrlKey ? "home_all" : command);
    } else if (override >= 0) this.setOverride(10 * override);
    else return;
    event.preventDefault();
  }

  keyUp({ code, key }) {
    // By the place of the key: what it is called may have changed since.
    this.release(code);
    if (["Shift", "Control", "Alt", "Meta", "NumLock"].includes(key) && this.held !== "pointer") this.release(this.held);
  }

  press(name, direction, by) {
    if (this.held !== null) return;
    const distance = this.field("distance").value;
    const isHeld = distance === "";
    // Without a soft limit there is no end but this one.
    const hasEnd = this.board.axes.find((axis) => axis.name === name).travel_mm !== null;
    this.held = by;
    this.say("press", { key: name + direction + (isHeld && !hasEnd ? FAR : distance), feed_mm_s: this.feedOf(name), is_held: isHeld });
    if (isHeld) this.keeping = setInterval(() => this.say("keep"), KEEP_MS);
  }

  release(by) {
    if (this.held === null || this.held !== by) return;
    // A distance is driven to its end.
    if (this.keeping !== undefined) this.say("release");
    this.drop();
  }
}
