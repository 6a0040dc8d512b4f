// The colours of blocks: their own, that of a break, of their load, or of what users mark.

const BROKEN = [0.85, 0.1, 0.1];
const UNLOADED = [0.62, 0.64, 0.66]; // blocks without a connection
const LOADS = [[0.6, 0.66, 0.7], [0.55, 0.72, 0.6], [0.93, 0.77, 0.3], [0.88, 0.42, 0.16]]; // from no load to breaking
export const MARKED = [0.93, 0.55, 0.12];
export const FADED = [0.62, 0.64, 0.66];
const FADING = 0.65; // how far the colours of other blocks fade beside marked ones

/** The colour of any solid at a time.
 *  @param load of each connection as a share of what breaks it, to colour by load; else null
 *  @param paint gives some blocks another colour than their own */
export function colorsAt({ breaks, connections }, time, load, paint) {
  const loads = load && greatestLoads(connections, load);
  return (item) => {
    if (item.block === null) return item.color;
    const broken = breaks[item.block];
    if (broken !== undefined && time >= broken) return BROKEN;
    if (loads) return loadColor(loads.get(item.block));
    return paint?.(item) ?? item.color;
  };
}

/** Paint that marks blocks and fades the others. */
export function markPaint(blocks) {
  const marked = new Set(blocks);
  const fade = (part, i) => part + FADING * (FADED[i] - part);
  return ({ block, color }) => (marked.has(block) ? MARKED : color.map(fade));
}

/** Greatest load of each block's connections. */
function greatestLoads(connections, load) {
  const found = new Map();
  connections.forEach((block, row) => found.set(block, Math.max(found.get(block) ?? 0, load[row])));
  return found;
}

/** From grey at a load of 0 through amber to nearly red at 1, where it breaks. */
function loadColor(load) {
  if (load === undefined) return UNLOADED;
  const place = Math.min(Math.max(load, 0), 1) * (LOADS.length - 1);
  const from = Math.min(Math.floor(place), LOADS.length - 2);
  return LOADS[from].map((value, i) => value + (place - from) * (LOADS[from + 1][i] - value));
}
