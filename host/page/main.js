// A report: shows the runs that are embedded in the page.

import { drawEmbedded } from "page/figures.js";
import { embedded } from "page/source.js";
import { complain } from "page/dom.js";
import { show } from "page/workbench.js";

try {
  // For those who look behind the page, and for its tests.
  window.motion = show((await embedded()).runs);
  window.figures = await drawEmbedded();
  document.documentElement.dataset.state = "ready";
} catch (error) {
  complain(`The page cannot show its data: ${error.message}`);
  document.documentElement.dataset.state = "failed";
  throw error;
}
