// The module in its worker: a request in, an answer out. One request is under way, and one waits: the latest.
//
// A request that is not needed any more is dropped with its worker, if it takes long; another worker is started for the next.

/** A request that has been under way for longer gives way to one that waits [ms]. */
const PATIENCE_MS = 400;

/** What a module does, by its numbers. */
const STAGES = ["reading", "planning", "running", "writing"];

export class Engine {
  /** `bytes` are the module's; `tell` is called with what is done and which part of it. */
  constructor(bytes, tell) {
    Object.assign(this, { bytes, tell, number: 0, current: null, next: null });
    this.start();
  }

  start() {
    // The name stands for the worker's text, or for its place on a server.
    this.worker = new Worker(import.meta.resolve("page/worker.js"));
    this.worker.postMessage({ module: this.bytes });
    this.worker.onmessage = ({ data }) => this.take(data);
    this.worker.onerror = ({ message }) => this.settle({ failure: message || "its worker does not start" });
  }

  /** The answer to a request; null where another one came before it. Fails where the module stops. */
  ask(request) {
    return new Promise((resolve, reject) => {
      this.next?.resolve(null);
      this.next = { request, resolve, reject };
      this.go();
      // Whatever takes longer than this gives way, now or later.
      clearTimeout(this.impatient);
      if (!this.next) return;
      const left = PATIENCE_MS - (performance.now() - this.current.since);
      this.impatient = setTimeout(() => this.next && this.cancel(), Math.max(0, left));
    });
  }

  /** Drops what is under way, and what waits. */
  drop() {
    this.next?.resolve(null);
    this.next = null;
    this.cancel();
  }

  go() {
    if (this.current || !this.next) return;
    this.number += 1;
    this.current = { ...this.next, number: this.number, since: performance.now() };
    this.next = null;
    this.worker.postMessage({ number: this.number, request: this.current.request });
  }

  /** Drops what is under way, and begins with what waits. */
  cancel() {
    if (!this.current) return;
    this.worker.terminate();
    this.start();
    this.current.resolve(null);
    this.current = null;
    this.go();
  }

  take({ number, stage, part, header, data, failure }) {
    if (number !== this.current?.number) return;
    if (stage !== undefined) this.tell(STAGES[stage], part);
    else this.settle({ header, data, failure });
  }

  settle({ header, data, failure }) {
    const { current } = this;
    this.current = null;
    if (failure !== undefined) current?.reject(new Error(failure));
    else current?.resolve({ header, data });
    this.go();
  }
}
