// What a path is coloured by: the feed of its cutting moves, what limits that, or an error.

import { figure } from "page/format.js";
import { ink, shade } from "page/theme.js";

/** Colours between slow and fast. */
const SHADES = 32;
/** The feed that is at its ceiling: plans keep off by less. */
const AT_CEILING = 0.999;

/**
 * The colours of a run's path: each with its `name`, the class of the ticks from one to another (`classOf`), the ink of a class
 * (`inkOf`), and what the classes mean (`legend`, `words`).
 */
export function coloursOf(run) {
  const { blocks } = run;
  const greatest = (values, isOf) => values.reduce((most, value, i) => (isOf(i) && value > most ? value : most), 0);
  const feed = run.quantity("feed");
  const cutting = greatest(blocks.peak, (i) => !blocks.isRapid[i]);
  const scale = (name, unit, words, most, value) => ({
    name,
    classOf: (from, to) => Math.min(SHADES - 1, Math.floor((value(from, to) / most) * SHADES)),
    inkOf: (number) => shade((number + 0.5) / SHADES),
    legend: () => [{ isScale: true, from: "0", to: `${figure(most, 3)} ${unit}` }],
    words,
  });
  const whole = feed.range(0, run.samples) ? feed.high : 1;
  const samples = (from, to) => [run.sampleOf(from), Math.max(run.sampleOf(from) + 1, run.sampleOf(to))];
  const list = [
    scale("Feed", "mm/s", "Lowest feed of each part.", cutting || whole || 1, (from, to) => {
      feed.range(...samples(from, to));
      return feed.low;
    }),
  ];
  if (blocks.count) {
    const { reasons } = run.header;
    const changing = reasons.length;
    list.push({
      name: "Limit",
      classOf: (from, to) => {
        const block = run.blockAt(run.pathMm((from + to) / 2));
        feed.range(...samples(from, to));
        const isAt = feed.high >= AT_CEILING * blocks.ceiling[block];
        return isAt && reasons[blocks.reason[block]][1] !== "unreached" ? blocks.reason[block] : changing;
      },
      inkOf: (number) => ink(number === changing ? "unreached" : reasons[number][1]),
      legend: () => [
        ...reasons.filter(([, of]) => of !== "unreached").map(([name, of]) => ({ ink: of, name })),
        { ink: "unreached", name: "feed changes" },
      ],
      words: "What holds the feed down: a ceiling, or the way to the next one.",
    });
  }
  const errors = (name, columns, words) => {
    const quantities = columns.map((column) => run.quantity(column)).filter(Boolean);
    const value = (from, to) => quantities.reduce((most, quantity) =>
      quantity.range(...samples(from, to)) ? Math.max(most, -quantity.low, quantity.high) : most, 0);
    const most = value(0, run.ticks);
    if (quantities.length && most > 0) list.push(scale(name, "µm", words, most, value));
  };
  const axes = run.header.axes.map((axis, i) => ({ ...axis, i })).filter((axis) => axis.is_on_path);
  errors("Following error", axes.map((axis) => `error ${axis.i}`), "Greatest following error of an axis in each part.");
  errors("Contour error", ["contour"], "Greatest contour error of each part.");
  return list;
}
