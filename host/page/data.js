// What `report/page/data.rs` wrote, as numbers again: a header in JSON, and columns of whole numbers of steps.

const FORMAT = 1;

/** Bytes of a text in base64, inflated. */
export function inflate(text) {
  const letters = atob(text);
  const bytes = new Uint8Array(letters.length);
  for (let i = 0; i < bytes.length; i += 1) bytes[i] = letters.charCodeAt(i);
  return inflateBytes(bytes);
}

/** Bytes, inflated. */
export async function inflateBytes(bytes) {
  const stream = new Blob([bytes]).stream().pipeThrough(new DecompressionStream("deflate"));
  return new Uint8Array(await new Response(stream).arrayBuffer());
}

/** A run's data. */
export class Data {
  constructor(bytes) {
    const length = new DataView(bytes.buffer, bytes.byteOffset).getUint32(0, true);
    this.header = JSON.parse(new TextDecoder().decode(bytes.subarray(4, 4 + length)));
    if (this.header.format !== FORMAT) {
      throw new Error(`found data of format ${this.header.format}, expected format ${FORMAT}`);
    }
    this.bytes = bytes.subarray(4 + length);
    this.columns = new Map(this.header.columns.map((column) => [column.name, column]));
  }

  has(name) {
    return this.columns.has(name);
  }

  /** What a number of the column stands for, in the quantity's unit. */
  step(name) {
    return this.columns.get(name).step;
  }

  /** The column's numbers. */
  numbers(name) {
    const { offset, count, planes, order } = this.columns.get(name);
    const numbers = new Int32Array(count);
    for (let plane = 0; plane < planes; plane += 1) {
      const bytes = this.bytes.subarray(offset + plane * count, offset + (plane + 1) * count);
      for (let i = 0; i < count; i += 1) numbers[i] |= bytes[i] << (8 * plane);
    }
    // 0, 1, 2, 3, … stand for 0, −1, 1, −2, …
    for (let i = 0; i < count; i += 1) numbers[i] = (numbers[i] >>> 1) ^ -(numbers[i] & 1);
    for (let round = 0; round < order; round += 1) {
      let sum = 0;
      for (let i = 0; i < count; i += 1) {
        sum = (sum + numbers[i]) | 0;
        numbers[i] = sum;
      }
    }
    return numbers;
  }

  /** The column's values in the quantity's unit; the greatest number stands for none. */
  values(name) {
    const step = this.step(name);
    return Float64Array.from(this.numbers(name), (number) => (number === 0x7fffffff ? NaN : number * step));
  }
}
