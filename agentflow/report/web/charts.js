// Small SVG charts: score curves, bars of counts, means with intervals.

import { el, shown, svg } from "./dom.js";

const LEFT = 44;
const RIGHT = 12;
const HEIGHT = 190;
const BOTTOM = 34;
const UPPER = 24;

/** Every score as a dot and the best so far as a line: points are [x, score]. */
export function climb(title, across, points) {
  return drawn(title, (width) => {
    const xs = scale([0, Math.max(...points.map(([x]) => x), 1)], [LEFT, width - RIGHT]);
    const ys = scale([Math.min(0, ...points.map(([, y]) => y)), Math.max(...points.map(([, y]) => y), 0)], [HEIGHT - BOTTOM, UPPER]);
    let best = -Infinity;
    let way = "";
    for (const [x, y] of points) {
      if (y <= best) continue;
      way += way ? `H${xs(x)}V${ys(y)}` : `M${xs(x)} ${ys(y)}`;
      best = y;
    }
    return [
      ...axes(xs, ys, across, "score"),
      ...points.map(([x, y]) => svg("circle", { class: "dot", cx: xs(x), cy: ys(y), r: 2.6 })),
      svg("path", { class: "line", d: `${way}H${width - RIGHT}` }),
    ];
  });
}

/** Counts by name: items are [name, count, detail]. */
export function bars(title, items) {
  const most = Math.max(...items.map(([, count]) => count), 1);
  return el("dl", { class: "bars", "aria-label": title },
    ...items.flatMap(([name, count, detail]) => {
      const bar = el("i", {});
      bar.style.width = `${(100 * count) / most}%`;
      return [el("dt", {}, name), el("dd", {}, el("span", { class: "bar" }, bar), el("b", {}, shown(count)),
        detail ? el("small", {}, detail) : null)];
    }));
}

const BAND = 58; // of a row of dots with its name above and its interval below
const DOT = 3;
const NEAR = 0.6; // share of the greatest value above which all are close together
const [LETTER, SMALL] = [6.9, 5.8]; // pixels of a letter of a name, and of a number
const PILE = [0, -4, 4, -8, 8]; // where dots go that would lie on others

/** Rows of values as dots, with a mean and its interval: {name, values, count, invalid, mean, low, high}. */
export function intervals(title, unit, rows) {
  const every = rows.flatMap((row) => [...row.values, row.low, row.high]).filter(Number.isFinite);
  const height = BOTTOM + 6 + BAND * rows.length;
  return drawn(title, (width) => {
    const xs = scale(reach(every), [LEFT / 2, width - RIGHT]);
    const lines = ticks(xs.low, xs.high, 5).map((value) => svg("path", { class: "grid", d: `M${xs(value)} 4V${height - BOTTOM + 8}` }));
    const marks = rows.flatMap((row, index) => {
      const y = 34 + BAND * index;
      const below = y + 16;
      return [
        svg("text", { class: "name", x: xs.from, y: y - 15 }, svg("title", {}, row.name), fitted(row.name, xs.to - xs.from - SMALL * numbers(row).length)),
        svg("text", { class: "tick end", x: xs.to, y: y - 15 }, numbers(row)),
        ...piled(row.values.map(xs)).map(([x, off]) => svg("circle", { class: "dot", cx: x, cy: y + off, r: DOT })),
        Number.isFinite(row.low) && Number.isFinite(row.high)
          ? svg("path", { class: "interval", d: `M${xs(row.low)} ${below}H${xs(row.high)}M${xs(row.low)} ${below - 3}v6M${xs(row.high)} ${below - 3}v6` }) : null,
        Number.isFinite(row.mean)
          ? svg("path", { class: "mean", d: `M${xs(row.mean)} ${below - 6}v12` }) : null,
      ];
    });
    return [...lines, ...ticksBelow(xs, height - BOTTOM + 8, unit), ...marks];
  }, height);
}

/** From 0 to the greatest value; where all lie close together far from 0, as far as they reach. */
function reach(values) {
  const [low, high] = [Math.min(0, ...values), Math.max(...values, 0)];
  const least = Math.min(...values);
  return least > NEAR * high ? [least - (high - least) / 10, high] : [low, high];
}

function numbers({ mean, low, high, count, invalid }) {
  const range = Number.isFinite(low) && Number.isFinite(high) ? ` (${shown(low)} to ${shown(high)})` : "";
  return `mean ${shown(mean)}${range}, n = ${shown(count)}${invalid ? `, ${shown(invalid)} invalid` : ""}`;
}

/** As much of a name as goes into so many pixels. */
function fitted(name, width) {
  const most = Math.max(8, Math.floor(width / LETTER));
  return name.length > most ? `${name.slice(0, most - 1)}…` : name;
}

/** Dots in order of x with their offsets, so that equal ones can be told apart as far as there is room. */
function piled(places) {
  const last = PILE.map(() => -Infinity);
  return [...places].sort((a, b) => a - b).map((x) => {
    const free = last.findIndex((other) => x - other >= 2 * DOT);
    const row = free >= 0 ? free : last.indexOf(Math.min(...last));
    last[row] = x;
    return [x, PILE[row]];
  });
}

function drawn(title, draw, height = HEIGHT) {
  const picture = svg("svg", { class: "chart", role: "img", "aria-label": title, height });
  let width = 0;
  new ResizeObserver(() => {
    if (!picture.clientWidth || picture.clientWidth === width) return;
    width = picture.clientWidth;
    picture.setAttribute("viewBox", `0 0 ${width} ${height}`);
    picture.replaceChildren(...draw(width).filter(Boolean));
  }).observe(picture);
  return el("figure", {}, el("figcaption", {}, title), picture);
}

function scale([low, high], [from, to]) {
  const span = high - low || 1;
  const map = (value) => Math.round(10 * (from + ((value - low) / span) * (to - from))) / 10;
  return Object.assign(map, { low, high: low + span, from, to });
}

function axes(xs, ys, across, up) {
  return [
    ...ticks(ys.low, ys.high, 4).flatMap((value) => [
      svg("path", { class: "grid", d: `M${xs.from} ${ys(value)}H${xs.to}` }),
      svg("text", { class: "tick end", x: xs.from - 6, y: ys(value) + 4 }, brief(value)),
    ]),
    ...ticksBelow(xs, ys.from, across, 1),
    svg("text", { class: "tick", x: 2, y: 9 }, up),
  ];
}

function ticksBelow(xs, y, name, least = 0) {
  return [
    ...ticks(xs.low, xs.high, 5, least).map((value) => svg("text", { class: "tick middle", x: xs(value), y: y + 15 }, brief(value))),
    svg("text", { class: "tick end", x: xs.to, y: y + 29 }, name),
  ];
}

/** Round numbers from low to high, at least so far apart. */
function ticks(low, high, count, least = 0) {
  const raw = Math.max((high - low) / count, least);
  const power = 10 ** Math.floor(Math.log10(raw));
  const step = [1, 2, 5, 10].map((factor) => factor * power).find((size) => size >= raw * 0.999);
  const found = [];
  for (let value = Math.ceil(low / step) * step; value <= high * 1.0001; value += step) found.push(value);
  return found;
}

function brief(value) {
  return value.toLocaleString("en", { notation: Math.abs(value) >= 10000 ? "compact" : "standard", maximumSignificantDigits: 3 });
}
