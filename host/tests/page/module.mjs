// Answers requests with the module in node: the module's file is the argument, requests come in JSON on standard input.
// Prints what the module imports, and the answers without their data.

import { readFileSync } from "node:fs";

const module = new WebAssembly.Module(readFileSync(process.argv[2]));
const { exports } = new WebAssembly.Instance(module);
const at = (place, length) => new Uint8Array(exports.memory.buffer, place, length);

const answers = JSON.parse(readFileSync(0, "utf8")).map((request) => {
  const bytes = new TextEncoder().encode(JSON.stringify(request));
  at(exports.request(bytes.length), bytes.length).set(bytes);
  exports.begin();
  while (exports.advance());
  const answer = at(exports.answer(), exports.answer_length()).slice();
  const length = new DataView(answer.buffer).getUint32(0, true);
  return JSON.parse(new TextDecoder().decode(answer.subarray(4, 4 + length)));
});
console.log(JSON.stringify({ imports: WebAssembly.Module.imports(module), answers }));
