// Where a page has its runs from. A source gives `{ runs: [{ data, program }] }`: the first run is the page's own, a second one
// is shown beside it. `data` is a `Data`; `program` is `{ text, times }`, or null where it is not known.

import { Data, inflate } from "page/data.js";

/** The runs that are embedded in the page itself. */
export async function embedded() {
  const runs = [];
  for (const role of ["", "against-"]) {
    const run = document.getElementById(`${role}run`);
    if (!run) continue;
    const program = document.getElementById(`${role}program`);
    runs.push({
      data: new Data(await inflate(run.textContent)),
      program: program && JSON.parse(new TextDecoder().decode(await inflate(program.textContent))),
    });
    // Their text is as long as the page.
    run.remove();
    program?.remove();
  }
  return { runs };
}
