// Answers requests with the module, apart from the page, which stays responsive meanwhile. It is a script of its own and imports
// nothing.
//
// ◄ { module }            the module's bytes
// ◄ { number, request }   a request
// ► { number, stage, part }            how far it is
// ► { number, header, data }           its answer
// ► { number, failure }                there is none: the module stopped

/** The module keeps what an answer was made from; from this size on the next request gets a new one [bytes]. */
const MEMORY_MAX = 400e6;
/** Time between two tellings of the progress [ms]. */
const TELL_MS = 100;

let compiled = null;
let instance = null;

/** Bytes in the module's memory. */
const at = (place, length) => new Uint8Array(instance.exports.memory.buffer, place, length);

function answer(number, request) {
  if (!instance || instance.exports.memory.buffer.byteLength > MEMORY_MAX) instance = new WebAssembly.Instance(compiled);
  const module = instance.exports;
  const bytes = new TextEncoder().encode(JSON.stringify(request));
  at(module.request(bytes.length), bytes.length).set(bytes);
  module.begin();
  let told = performance.now();
  while (module.advance()) {
    if (performance.now() - told < TELL_MS) continue;
    told = performance.now();
    postMessage({ number, stage: module.stage(), part: module.part() });
  }
  const all = at(module.answer(), module.answer_length()).slice();
  const length = new DataView(all.buffer).getUint32(0, true);
  const header = JSON.parse(new TextDecoder().decode(all.subarray(4, 4 + length)));
  const data = all.slice(4 + length);
  postMessage({ number, header, data }, [data.buffer]);
}

/** What the module said when it stopped. */
function lastWords() {
  const words = new TextDecoder().decode(at(instance.exports.panicked(), instance.exports.panicked_length()));
  instance = null;
  return words;
}

let ready = Promise.resolve();
onmessage = ({ data: { module, number, request } }) => {
  if (module) {
    ready = WebAssembly.compile(module).then((made) => {
      compiled = made;
    });
    return;
  }
  ready.then(() => answer(number, request)).catch((error) => {
    postMessage({ number, failure: instance ? lastWords() || error.message : error.message });
  });
};
