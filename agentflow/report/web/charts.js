// Small SVG charts: score curves, lines, bars of counts, means with intervals.

import { el, formatNumber, svg } from "./dom.js";
import { save } from "./downloads.js";
import { answering } from "./pointing.js";

const LEFT = 44;
const RIGHT = 12;
const HEIGHT = 190;
const BOTTOM = 34;
const UPPER = 24;

/** Scores as dots and the best so far as a line; points are [x, score, item]. A point answers to the
 *  pointer and to arrow keys; a click or Enter gives its item to `pick`. */
export function scoreChart(title, across, points, pick = null) {
  let drawn = [];
  const chart = figure(title, (width) => {
    const xs = scale([0, Math.max(...points.map(([x]) => x)) || 1], [LEFT, width - RIGHT]);
    const ys = scale([Math.min(0, ...points.map(([, y]) => y)), Math.max(...points.map(([, y]) => y), 0)], [HEIGHT - BOTTOM, UPPER]);
    let best = -Infinity;
    let way = "";
    for (const [x, y] of points) {
      if (y <= best) continue;
      way += way ? `H${xs(x)}V${ys(y)}` : `M${xs(x)} ${ys(y)}`;
      best = y;
    }
    drawn = points.map(([x, y, item]) => ({ x: xs(x), y: ys(y), item, text: `score ${formatNumber(y)} at ${formatNumber(x, 1)} ${across}` }));
    return [
      ...axes(xs, ys, across, "score"),
      ...drawn.map(({ x, y }) => svg("circle", { class: "dot", cx: x, cy: y, r: 2.6 })),
      svg("path", { class: "line", d: `${way}H${width - RIGHT}` }),
    ];
  });
  const picture = chart.querySelector("svg");
  chart.querySelector("figcaption").append(answering(picture, () => drawn, pick),
    el("button", { class: "csv", title: "Save these points", click: () => save("scores.csv", [`${across},score`, ...points.map(([x, y]) => `${x},${y}`)].join("\n")) }, ".csv"));
  picture.classList.toggle("clickable", Boolean(pick));
  return chart;
}

const COLOURS = 6; // lines with a colour of their own; further ones begin again
const SINGLE = 60; // fewest points of a line that are not marked one by one

/** Numbers over steps, a line each: {name, points}, where points are [x, y] in order of x. */
export function lineChart(title, up, across, lines) {
  const every = lines.flatMap(({ points }) => points);
  const hue = (index) => `hue${index % COLOURS}`;
  const chart = figure(title, (width) => {
    const xs = scale([Math.min(...every.map(([x]) => x)), Math.max(...every.map(([x]) => x))], [LEFT, width - RIGHT]);
    const [low, high] = valueRange(every.map(([, y]) => y));
    const ys = scale(low === high ? [Math.min(0, 2 * low), Math.max(0, 2 * high)] : [low, high], [HEIGHT - BOTTOM, UPPER]);
    return [
      ...axes(xs, ys, across, up),
      ...lines.flatMap(({ name, points }, index) => [
        svg("path", { class: `line ${hue(index)}`, d: points.map(([x, y], i) => `${i ? "L" : "M"}${xs(x)} ${ys(y)}`).join("") }, svg("title", {}, name)),
        ...(points.length < SINGLE ? points : []).map(([x, y]) => svg("circle", { class: `point ${hue(index)}`, cx: xs(x), cy: ys(y), r: 2.4 },
          svg("title", {}, `${name}, ${across} ${x}: ${y}`))),
      ]),
    ];
  });
  if (lines.length > 1) chart.append(el("p", { class: "key" }, ...lines.map(({ name }, index) => el("span", { class: hue(index) }, el("i", {}), name))));
  return chart;
}

/** Bars of counts; items are [name, count, detail]. */
export function barChart(title, items) {
  const most = Math.max(...items.map(([, count]) => count), 1);
  return el("dl", { class: "bars", "aria-label": title },
    ...items.flatMap(([name, count, detail]) => {
      const bar = el("i", {});
      bar.style.width = `${(100 * count) / most}%`;
      return [el("dt", {}, name), el("dd", {}, el("span", { class: "bar" }, bar), el("b", {}, formatNumber(count)),
        detail ? el("small", {}, detail) : null)];
    }));
}

const BAND = 58; // height of a row: name, dots, interval
const DOT = 3;
const NEAR = 0.6; // if all values exceed this share of the greatest, the axis does not start at 0
const [LETTER, SMALL] = [6.9, 5.8]; // width of a character of a name and of a number, pixels
const PILE = [0, -4, 4, -8, 8]; // vertical offsets of dots that would overlap

/** Values as dots, one row each, with mean and interval: {name, values, count, invalid, failed, mean, low, high};
 *  a dashed line at `mark`, if it is given: {value, name}. */
export function intervalChart(title, unit, rows, mark) {
  const every = [...rows.flatMap((row) => [...row.values, row.low, row.high]), mark?.value].filter(Number.isFinite);
  const height = BOTTOM + 6 + BAND * rows.length;
  return figure(title, (width) => {
    const xs = scale(valueRange(every), [LEFT / 2, width - RIGHT]);
    const lines = ticks(xs.low, xs.high, 5).map((value) => svg("path", { class: "grid", d: `M${xs(value)} 4V${height - BOTTOM + 8}` }));
    const marks = rows.flatMap((row, index) => {
      const y = 34 + BAND * index;
      const below = y + 16;
      return [
        svg("text", { class: "name", x: xs.from, y: y - 15 }, svg("title", {}, row.name), truncate(row.name, xs.to - xs.from - SMALL * statistics(row).length)),
        svg("text", { class: "tick end", x: xs.to, y: y - 15 }, statistics(row)),
        ...stackDots(row.values.map(xs)).map(([x, off]) => svg("circle", { class: "dot", cx: x, cy: y + off, r: DOT })),
        Number.isFinite(row.low) && Number.isFinite(row.high)
          ? svg("path", { class: "interval", d: `M${xs(row.low)} ${below}H${xs(row.high)}M${xs(row.low)} ${below - 3}v6M${xs(row.high)} ${below - 3}v6` }) : null,
        Number.isFinite(row.mean)
          ? svg("path", { class: "mean", d: `M${xs(row.mean)} ${below - 6}v12` }) : null,
      ];
    });
    const line = rows.map((_, index) => `M${xs(mark?.value)} ${34 + BAND * index - 10}v30`).join(""); // not over the names
    if (Number.isFinite(mark?.value)) lines.push(svg("path", { class: "mark", d: line }, svg("title", {}, mark.name)));
    return [...lines, ...ticksBelow(xs, height - BOTTOM + 8, unit), ...marks];
  }, height);
}

/** Shares from 0 to 1 as bars with intervals: {name, bars: [{name, value, low, high}]}. */
export function shareChart(title, rows) {
  const [bar, head] = [15, 20];
  const tall = head + Math.max(...rows.map(({ bars }) => bars.length)) * bar + 14;
  const height = rows.length * tall + BOTTOM;
  return figure(title, (width) => {
    const most = Math.max(...rows.flatMap(({ bars }) => bars.flatMap(({ value, high }) => [value ?? 0, high ?? 0])), 0.01);
    const xs = scale([0, Math.min(1, Math.ceil(10 * most) / 10)], [4, width - 130]);
    const percent = (value) => (Number.isFinite(value) ? `${formatNumber(100 * value, 1)} %` : "no share");
    return [
      ...ticks(xs.low, xs.high, 5).flatMap((value) => [svg("path", { class: "grid", d: `M${xs(value)} 4V${height - BOTTOM + 4}` }),
        svg("text", { class: "tick middle", x: xs(value), y: height - BOTTOM + 18 }, `${Math.round(100 * value)} %`)]),
      ...rows.flatMap(({ name, bars }, row) => [
        svg("text", { class: "name", x: xs.from, y: row * tall + 14 }, svg("title", {}, name), truncate(name, width - 20)),
        ...bars.flatMap((item, index) => {
          const y = row * tall + head + index * bar;
          const middle = y + bar / 2;
          return [
            svg("rect", { class: index ? "ratio lesser" : "ratio", x: xs.from, y: y + 2, width: Math.max(1, xs(item.value ?? 0) - xs.from), height: bar - 4, rx: 2 }),
            Number.isFinite(item.low) ? svg("path", { class: "interval", d: `M${xs(item.low)} ${middle}H${xs(item.high)}M${xs(item.low)} ${middle - 3}v6M${xs(item.high)} ${middle - 3}v6` }) : null,
            svg("text", { class: "tick", x: xs(Math.max(item.value ?? 0, item.high ?? 0)) + 8, y: middle + 4 }, `${item.name} ${percent(item.value)}`),
          ];
        }),
      ]),
    ];
  }, height);
}

/** Range of an axis: from 0 to the greatest value, or without 0 if all values are far from it. */
function valueRange(values) {
  const [low, high] = [Math.min(0, ...values), Math.max(...values, 0)];
  const least = Math.min(...values);
  return least > NEAR * high ? [least - (high - least) / 10, high] : [low, high];
}

function statistics({ mean, low, high, count, invalid, failed }) {
  const range = Number.isFinite(low) && Number.isFinite(high) ? ` (${formatNumber(low)} to ${formatNumber(high)})` : "";
  return `mean ${formatNumber(mean)}${range}, n = ${formatNumber(count)}${invalid ? `, ${formatNumber(invalid)} invalid` : ""}${failed ? `, ${formatNumber(failed)} failed` : ""}`;
}

/** A name cut to a width in pixels. */
function truncate(name, width) {
  const most = Math.max(8, Math.floor(width / LETTER));
  return name.length > most ? `${name.slice(0, most - 1)}…` : name;
}

/** [x, vertical offset] of dots in order of x, so that close ones do not overlap while there is room. */
function stackDots(places) {
  const last = PILE.map(() => -Infinity);
  return [...places].sort((a, b) => a - b).map((x) => {
    const free = last.findIndex((other) => x - other >= 2 * DOT);
    const row = free >= 0 ? free : last.indexOf(Math.min(...last));
    last[row] = x;
    return [x, PILE[row]];
  });
}

function figure(title, draw, height = HEIGHT) {
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
      svg("text", { class: "tick end", x: xs.from - 6, y: ys(value) + 4 }, compactNumber(value)),
    ]),
    ...ticksBelow(xs, ys.from, across, 1),
    svg("text", { class: "tick", x: 2, y: 9 }, up),
  ];
}

function ticksBelow(xs, y, name, least = 0) {
  return [
    ...ticks(xs.low, xs.high, 5, least).map((value) => svg("text", { class: "tick middle", x: xs(value), y: y + 15 }, compactNumber(value))),
    svg("text", { class: "tick end", x: xs.to, y: y + 29 }, name),
  ];
}

/** About `count` round numbers from low to high, at least `least` apart. */
function ticks(low, high, count, least = 0) {
  const raw = Math.max((high - low) / count, least);
  const power = 10 ** Math.floor(Math.log10(raw));
  const step = [1, 2, 5, 10].map((factor) => factor * power).find((size) => size >= raw * 0.999);
  const found = [];
  for (let value = Math.ceil(low / step) * step; value <= high * 1.0001; value += step) found.push(value || 0); // never -0
  return found;
}

function compactNumber(value) {
  return value.toLocaleString("en", { notation: Math.abs(value) >= 10000 ? "compact" : "standard", maximumSignificantDigits: 3 });
}
