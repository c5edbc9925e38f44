// The operator's panel of a board.
//
// socket ─► display: state, positions, messages        buttons, keys ─► controls ─► socket
//        └► pictures: the program as planned, captured ticks ─► workbench, with the machine's place on it

import { Data, inflateBytes } from "page/data.js";
import { Controls } from "page/panel/controls.js";
import { Display } from "page/panel/display.js";
import { Follower } from "page/panel/follow.js";
import { Link } from "page/panel/link.js";
import { complain } from "page/dom.js";
import { show } from "page/workbench.js";

const NAMES = { program: "The program, as planned", capture: "Captured ticks" };

/** Pictures that were fetched, and which one is shown. */
class Pictures {
  constructor() {
    this.choice = document.querySelector(".pictures");
    this.runs = {};
    /** The numbers of the latest ones. */
    this.numbers = {};
    this.shown = null;
    this.page = null;
    this.follower = null;
  }

  async fetch(of, number) {
    this.numbers[of] = number;
    const get = async (part) => {
      const response = await fetch(`/picture/${number}/${part}${location.search}`);
      return response.status === 200 ? inflateBytes(new Uint8Array(await response.arrayBuffer())) : null;
    };
    const [data, program] = await Promise.all([get("data"), get("program")]);
    // A later one has taken its place.
    if (!data || this.numbers[of] !== number) return;
    this.runs[of] = { data: new Data(data), program: program && JSON.parse(new TextDecoder().decode(program)) };
    this.choose(of);
  }

  /** Another program is loaded: the picture of the one before is over. */
  forget() {
    delete this.runs.program;
    delete this.numbers.program;
    this.follower = null;
    if (this.runs.capture) this.choose("capture");
    else if (this.page) {
      this.page = show([]);
      this.choice.hidden = true;
    }
  }

  choose(of) {
    this.shown = of;
    this.choice.hidden = false;
    this.choice.replaceChildren(...Object.keys(NAMES).filter((name) => this.runs[name]).map((name) => {
      const button = document.createElement("button");
      button.type = "button";
      button.textContent = NAMES[name];
      button.setAttribute("aria-pressed", String(name === of));
      button.addEventListener("click", () => this.choose(name));
      return button;
    }));
    this.page = show([this.runs[of]]);
    this.follower = this.page && of === "program" ? new Follower(this.page.run) : null;
  }

  /** Moves the cursor to where the machine is, unless a pointer has it. */
  follow({ under_way, set_mm, line }) {
    if (!this.follower || under_way !== "program") return;
    const { state } = this.page;
    if (state.cursor !== state.placed) return;
    const tick = this.follower.tick(set_mm, line);
    if (tick !== undefined) state.place(tick);
  }
}

function start() {
  const root = document.getElementById("panel");
  const display = new Display(root);
  const pictures = new Pictures();
  const link = new Link(told, (isUp) => {
    display.showUp(isUp);
    if (!isUp) controls?.lose();
  });
  const controls = new Controls(root, link, (text) => display.say(text, "refused"));

  function told(message) {
    switch (message.type) {
      case "board":
        display.showBoard(message.board);
        controls.showBoard(message.board);
        break;
      case "state":
        display.showState(message.state, message.commander);
        controls.showState(message.state, message.commander);
        pictures.follow(message.state);
        break;
      case "event":
        display.say(message.text, message.is_failure ? "failure" : "");
        break;
      case "refused":
        controls.drop();
        display.say(message.text, "refused");
        break;
      case "program":
        pictures.forget();
        display.say(`loaded ${message.name}`, "");
        break;
      case "picture":
        pictures.fetch(message.of, message.number).catch((error) => complain(`The picture can not be shown: ${error.message}`));
        break;
    }
  }

  return { display, controls, link, pictures };
}

try {
  // For those who look behind the page, and for its tests.
  window.panel = start();
  document.documentElement.dataset.state = "ready";
} catch (error) {
  complain(`The panel does not start: ${error.message}`);
  document.documentElement.dataset.state = "failed";
  throw error;
}
