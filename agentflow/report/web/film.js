// Unpacks motion packed by agentflow/report/film.py: the pose of every body over time.
// The game frame is left-handed, three.js right-handed: the sign of x is flipped on reading.

const COMPONENTS = 7; // x, y, z and the quaternion's x, y, z, w

/** Decode base64 text and inflate it. */
export async function inflate(text) {
  const packed = Uint8Array.from(atob(text), (letter) => letter.charCodeAt(0));
  const stream = new Blob([packed]).stream().pipeThrough(new DecompressionStream("deflate"));
  return new Uint8Array(await new Response(stream).arrayBuffer());
}

/** Inflate and parse JSON. */
export async function unpackJson(text) {
  return JSON.parse(new TextDecoder().decode(await inflate(text)));
}

export class Film {
  /** @param packed {samples, times, bodies, low, step, loads, data} */
  static async of(packed) {
    return new Film(packed, await inflate(packed.data));
  }

  constructor(packed, bytes) {
    this.samples = packed.samples;
    this.times = packed.times;
    this.bodies = packed.bodies;
    this.duration = packed.times[packed.samples - 1];
    this.low = packed.low;
    this.step = packed.step;
    const rows = COMPONENTS * packed.bodies;
    this.values = undoDeltas(bytes, rows, packed.samples);
    this.loads = undoByteDeltas(bytes.subarray(2 * rows * packed.samples), packed.loads, packed.samples);
    this.position = new Float32Array(3 * packed.bodies);
    this.rotation = new Float32Array(4 * packed.bodies);
    this.load = new Float32Array(packed.loads);
  }

  /** Fill `position`, `rotation` and `load` for one moment, in three.js's frame. */
  sample(time) {
    const [index, share] = this.place(time);
    for (let body = 0; body < this.bodies; body++) {
      for (let axis = 0; axis < 3; axis++) {
        const value = this.low[axis] + (this.at(axis, body, index, share) + 32768) * this.step[axis];
        this.position[3 * body + axis] = axis === 0 ? -value : value;
      }
      this.turn(body, index, share);
    }
    for (let row = 0; row < this.load.length; row++) {
      this.load[row] = this.loads[row * this.samples + index] / 200; // loads are stored in units of 1/200
    }
  }

  /** Index of the sample at or before a time, and the fraction of the way to the next. */
  place(time) {
    let index = 0;
    for (let end = this.samples - 2; index < end; ) {
      const middle = (index + end + 1) >> 1;
      if (this.times[middle] <= time + 1e-9) index = middle;
      else end = middle - 1;
    }
    const span = this.samples > 1 ? this.times[index + 1] - this.times[index] : 0;
    return [index, span ? Math.min(Math.max((time - this.times[index]) / span, 0), 1) : 0];
  }

  /** One component between two samples: positions along a curve, rotations linearly. */
  at(component, body, index, share) {
    const row = (component * this.bodies + body) * this.samples + index;
    const here = this.values[row];
    if (share <= 0) return here;
    const next = this.values[row + 1];
    if (component > 2) return here + share * (next - here);
    const span = this.times[index + 1] - this.times[index];
    return hermite(here, next, span * this.slope(row, index), span * this.slope(row + 1, index + 1), share);
  }

  /** Rate of change of a component at a sample, exact for motion with constant acceleration. */
  slope(row, index) {
    const change = (i) => (this.values[row + i + 1] - this.values[row + i]) / (this.times[index + i + 1] - this.times[index + i]);
    if (index === 0) return change(0) / 2; // it starts and ends at rest
    if (index === this.samples - 1) return change(-1) / 2;
    const before = this.times[index] - this.times[index - 1];
    const after = this.times[index + 1] - this.times[index];
    return (change(-1) * after + change(0) * before) / (before + after);
  }

  turn(body, index, share) {
    const at = (component) => this.at(3 + component, body, index, share);
    const turned = [at(0), -at(1), -at(2), at(3)];
    const length = Math.hypot(...turned) || 1;
    turned.forEach((value, i) => (this.rotation[4 * body + i] = value / length));
  }
}

/** Cubic between two values with the given changes per interval at its start and end. */
function hermite(here, next, first, last, share) {
  const rest = next - here;
  return here + share * (first + share * (3 * rest - 2 * first - last + share * (first + last - 2 * rest)));
}

/** Rows of 16-bit numbers from their differences over time; all low bytes precede all high bytes. */
function undoDeltas(bytes, rows, samples) {
  const count = rows * samples;
  const values = new Int16Array(count);
  for (let i = 0; i < count; i++) {
    const change = bytes[i] | (bytes[count + i] << 8);
    values[i] = i % samples ? values[i - 1] + change : change;
  }
  return values;
}

function undoByteDeltas(bytes, rows, samples) {
  const values = new Uint8Array(rows * samples);
  for (let i = 0; i < values.length; i++) values[i] = i % samples ? values[i - 1] + bytes[i] : bytes[i];
  return values;
}
