// Numbers as people read them: the digits that carry meaning, a true minus, thousands apart.

/** Narrow no-break space: no comma, which some read as a decimal point. */
const GROUP = "\u202f";

function grouped(text) {
  const [whole, decimals] = text.split(".");
  const apart = whole.replace(/\B(?=(\d{3})+(?!\d))/g, GROUP);
  return decimals === undefined ? apart : `${apart}.${decimals}`;
}

/** With a fixed number of decimals. */
export function fixed(value, decimals) {
  if (!Number.isFinite(value)) return "–";
  const text = grouped(Math.abs(value).toFixed(decimals));
  return value < 0 && /[1-9]/.test(text) ? `−${text}` : text;
}

/** To so many significant digits, without zeros at the end. */
export function figure(value, digits) {
  if (!Number.isFinite(value)) return "–";
  if (value === 0) return "0";
  const decimals = digits - 1 - Math.floor(Math.log10(Math.abs(value)));
  const text = fixed(value, Math.min(12, Math.max(0, decimals)));
  return text.includes(".") ? text.replace(/\.?0+$/, "") : text;
}

/** A value, or the two between which all values of a sample lie. */
export function span(low, high, digits) {
  const [a, b] = [figure(low, digits), figure(high, digits)];
  return a === b ? a : `${a} … ${b}`;
}

/** A step of 1, 2 or 5 times a power of ten that divides `range` into about `parts`. */
export function roundStep(range, parts) {
  const least = range / Math.max(1, parts);
  const decade = 10 ** Math.floor(Math.log10(least));
  return [1, 2, 5, 10].map((part) => part * decade).find((step) => step >= least * 0.999);
}

/** Multiples of a round step from `from` to `to`, and the decimals that tell them apart. */
export function marks(from, to, parts) {
  if (!(to > from)) return { values: [], decimals: 0 };
  let step = roundStep(to - from, parts);
  let values = [];
  // One mark is no scale.
  for (let tries = 0; tries < 2 && values.length < 2; tries += 1) {
    if (tries) step = roundStep(to - from, 2 * parts);
    values = [];
    for (let n = Math.ceil(from / step - 1e-9); n * step <= to + 1e-9 * step; n += 1) values.push(n * step);
  }
  return { values, decimals: Math.max(0, -Math.floor(Math.log10(step) + 1e-9)) };
}

/** With an exponent: 1.2·10⁻⁷. */
export function scientific(value, digits) {
  if (value === 0 || !Number.isFinite(value)) return figure(value, digits);
  const exponent = Math.floor(Math.log10(Math.abs(value)) + 1e-12);
  const superscript = String(exponent).replace(/[-0-9]/g, (c) => (c === "-" ? "⁻" : "⁰¹²³⁴⁵⁶⁷⁸⁹"[c]));
  return `${figure(value / 10 ** exponent, digits)}·10${superscript}`;
}

/** A value as a cursor tells it: with an exponent where zeros would hide its digits. */
export function reading(value, digits) {
  const isSmall = value !== 0 && Math.abs(value) < 1e-4;
  return isSmall || Math.abs(value) >= 1e7 ? scientific(value, digits) : figure(value, digits);
}

/** Marks of a logarithmic axis between two logarithms: 1, 2, 5, 10, …, or every decade; round steps where there are too few. */
export function decades(from, to, parts) {
  const [first, last] = [Math.floor(from), Math.ceil(to)];
  const of = (steps) => {
    const values = [];
    for (let decade = first; decade <= last; decade += 1) {
      for (const step of steps) {
        const value = step * 10 ** decade;
        if (Math.log10(value) >= from - 1e-9 && Math.log10(value) <= to + 1e-9) values.push(value);
      }
    }
    return values;
  };
  const [fine, coarse] = [of([1, 2, 5]), of([1])];
  if (fine.length < 3) return marks(10 ** from, 10 ** to, Math.min(6, parts));
  return { values: fine.length <= parts ? fine : coarse, isOwn: true };
}
