// The socket to the panel's server. It is opened again whenever it breaks, also after a restart of the server.

const AGAIN_MS = 500;

export class Link {
  /** Calls `onTold` with each message, `onUp` with whether the server is there. */
  constructor(onTold, onUp) {
    this.onTold = onTold;
    this.onUp = onUp;
    this.open();
  }

  open() {
    const { host, search } = location;
    const socket = new WebSocket(`ws://${host}/socket${search}`);
    this.socket = socket;
    socket.addEventListener("open", () => this.onUp(true));
    socket.addEventListener("message", ({ data }) => this.onTold(JSON.parse(data)));
    // A failure closes it, too.
    socket.addEventListener("close", () => {
      this.onUp(false);
      setTimeout(() => this.open(), AGAIN_MS);
    });
  }

  /** Says a command; it is lost where nobody is there, as is whatever it would have moved. */
  say(command) {
    if (this.socket.readyState === WebSocket.OPEN) this.socket.send(JSON.stringify(command));
  }
}
