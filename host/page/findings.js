// A page of figures: draws what is embedded in it.

import { complain } from "page/dom.js";
import { drawEmbedded } from "page/figures.js";

try {
  // For those who look behind the page, and for its tests.
  window.figures = await drawEmbedded();
  document.documentElement.dataset.state = "ready";
} catch (error) {
  complain(`The page cannot show its figures: ${error.message}`);
  document.documentElement.dataset.state = "failed";
  throw error;
}
