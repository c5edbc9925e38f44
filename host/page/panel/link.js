// The socket to the panel's server. It is opened again whenever it breaks, also after a restart of the server.

const AGAIN_MS = 500;

export class Link {
  /** Calls `onTold` with each message, `onUp` with whether the server is there. */
  constructor(onTold, onUp) {
    this.onTold = onTold;
    this.onUp = onUp;
    /** The number of the state heard last: a command says what it was given at. */
    this.heard = 0;
    this.open();
  }

  open() {
    const { host, search } = location;
    const socket = new WebSocket(`ws://${host}/socket${search}`);
    this.socket = socket;
    socket.addEventListener("open", () => this.onUp(true));
    socket.addEventListener("message", ({ data }) => {
      const told = JSON.parse(data);
      if (told.type === "state") this.heard = told.number;
      this.onTold(told);
    });
    // A failure closes it, too.
    socket.addEventListener("close", () => {
      this.onUp(false);
      setTimeout(() => this.open(), AGAIN_MS);
    });
  }

  /** Says a command; false where nobody is there. */
  say(command) {
    if (this.socket.readyState !== WebSocket.OPEN) return false;
    this.socket.send(JSON.stringify({ heard: this.heard, command }));
    return true;
  }
}
