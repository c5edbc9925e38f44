// Values in their order.

/** The index of the last of sorted values that is not above `wanted`, or −1. */
export function lastNotAbove(values, wanted) {
  let [from, to] = [0, values.length];
  while (from < to) {
    const middle = (from + to) >> 1;
    if (values[middle] <= wanted) from = middle + 1;
    else to = middle;
  }
  return from - 1;
}
