// Small SVG charts: score curves, lines, bars of counts, means with intervals.

import { el, formatNumber, svg, withUnit } from "./dom.js";
import { save } from "./downloads.js";
import { answering } from "./pointing.js";

const LEFT = 44;
const RIGHT = 12;
const HEIGHT = 190;
const BOTTOM = 34;
const UPPER = 24;
const MOST_DIGITS = 12; // of the number of a tick

/** What an axis is named: a quantity, and its unit if there is one. */
export const named = (quantity, unit) => (unit ? `${quantity}, ${unit}` : quantity);

/** Scores as dots and the best so far as a line; points are [x, score, item]. A point answers to the
 *  pointer and to arrow keys; a click or Enter gives its item to `pick`. `logs` keeps which axes are
 *  logarithmic. Points of the item `ringed` have a ring. */
export function scoreChart(title, across, unit, points, pick = null, logs = {}, ringed = null) {
  let drawn = [];
  const chart = figure(title, (width) => {
    const shown = positive(points, logs);
    const xs = scale(logs.x ? extent(shown, 0) : [0, Math.max(...points.map(([x]) => x)) || 1], [LEFT, width - RIGHT], logs.x);
    const ys = scale(logs.y ? extent(shown, 1) : [Math.min(0, ...points.map(([, y]) => y)), Math.max(...points.map(([, y]) => y), 0)], [HEIGHT - BOTTOM, UPPER], logs.y);
    let best = -Infinity;
    let way = "";
    for (const [x, y] of shown) {
      if (y <= best) continue;
      way += way ? `H${xs(x)}V${ys(y)}` : `M${xs(x)} ${ys(y)}`;
      best = y;
    }
    drawn = shown.map(([x, y, item]) => ({ x: xs(x), y: ys(y), item, text: `score ${withUnit(y, unit)} at ${formatNumber(x, 1)} ${across}` }));
    return [
      ...axes(xs, ys, across, named("score", unit)),
      ...drawn.map(({ x, y }) => svg("circle", { class: "dot", cx: x, cy: y, r: 2.6 })),
      svg("path", { class: "line", d: `${way}H${width - RIGHT}` }),
      ...drawn.filter(({ item }) => ringed && item === ringed).map(({ x, y }) => svg("circle", { class: "ring", cx: x, cy: y, r: 6 })),
    ];
  }, { rows: () => [[across, named("score", unit)], ...points.map(([x, y]) => [x, y])], logs: [logs, points] });
  const picture = chart.querySelector("svg");
  chart.querySelector("figcaption").children[0].after(answering(picture, () => drawn, pick));
  picture.classList.toggle("clickable", Boolean(pick));
  return chart;
}

const COLOURS = 6; // lines with a colour of their own; further ones begin again
const SINGLE = 60; // fewest points of a line that are not marked one by one

/** Numbers over steps, a line each: {name, points, marks, label}, where points are [x, y] in order of x, marks those that
 *  get a dot (by default all of few), and label a letter at the end of the line. */
export function lineChart(title, up, across, lines, logs = {}) {
  const hue = (index) => `hue${index % COLOURS}`;
  const chart = figure(title, (width) => {
    const shown = lines.map(({ points, marks = points.length < SINGLE ? points : [], ...line }) => ({ ...line, points: positive(points, logs), marks: positive(marks, logs) }));
    const every = shown.flatMap(({ points }) => points);
    const xs = scale(logs.x ? extent(every, 0) : valueRange(every.map(([x]) => x)), [LEFT, width - RIGHT - (lines[0].label ? RIGHT : 0)], logs.x);
    const [low, high] = logs.y ? extent(every, 1) : valueRange(every.map(([, y]) => y));
    const ys = scale(low === high && !logs.y ? [Math.min(0, 2 * low), Math.max(0, 2 * high)] : [low, high], [HEIGHT - BOTTOM, UPPER], logs.y);
    return [
      ...axes(xs, ys, across, up),
      ...shown.flatMap(({ name, points, marks, label = "" }, index) => [
        svg("path", { class: `line ${hue(index)}`, d: points.map(([x, y], i) => `${i ? "L" : "M"}${xs(x)} ${ys(y)}`).join("") }, svg("title", {}, name)),
        ...marks.map(([x, y]) => svg("circle", { class: `point ${hue(index)}`, cx: xs(x), cy: ys(y), r: 2.4 },
          svg("title", {}, `${name}, ${across} ${x}: ${y}`))),
        ...points.slice(-1).map(([x, y]) => svg("text", { class: "name", x: xs(x) + 6, y: ys(y) + 4 }, label)),
      ]),
    ];
  }, { rows: () => [["line", across, up], ...lines.flatMap(({ name, points }) => points.map(([x, y]) => [name, x, y]))], logs: [logs, lines.flatMap(({ points }) => points)] });
  if (lines.length > 1) chart.append(el("p", { class: "key" }, ...lines.map(({ name }, index) => el("span", {}, svg("svg", { width: 30, height: 10 }, svg("path", { class: `line ${hue(index)}`, d: "M0 5H26" })), name))));
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

const BAND = 62; // height of a row: name, dots, interval
const DOT = 3;
const NEAR = 0.6; // if all values exceed this share of the greatest, the axis does not start at 0
const pen = document.createElement("canvas").getContext("2d"); // measures texts
const PILE = [0, -4, 4, -8, 8]; // vertical offsets of dots that would overlap

/** Values as dots over an axis, one row each, with mean and interval: {name, values, runs, count, invalid, failed, mean, low, high};
 *  a dashed line at `mark`, if it is given: {value, name}. A click on a dot, or Enter, gives its run to `pick`. */
export function intervalChart(title, axis, rows, mark, pick = null) {
  const every = [...rows.flatMap((row) => [...row.values, row.low, row.high]), mark?.value].filter(Number.isFinite);
  const height = BOTTOM + 6 + BAND * rows.length;
  let drawn = [];
  const chart = figure(title, (width) => {
    const xs = scale(valueRange(every), [LEFT / 2, width - RIGHT]);
    drawn = rows.flatMap(({ values, runs }, index) => stackDots(values.map(xs)).map(([x, off], place) => ({ x, y: 38 + BAND * index + off, item: runs?.[place], text: `${formatNumber(values[place])} in ${runs?.[place]}` })));
    const lines = ticks(xs.low, xs.high, 5).map((value) => svg("path", { class: "grid", d: `M${xs(value)} 4V${height - BOTTOM + 8}` }));
    const marks = rows.flatMap((row, index) => {
      const y = 38 + BAND * index;
      const below = y + 16;
      const room = xs.to - xs.from - 16;
      const whole = statistics(row); // without the range where it would meet the name: it is drawn
      const told = widthOf(row.name, 13) + widthOf(whole, 11) > room ? statistics({ ...row, low: NaN }) : whole;
      return [
        svg("text", { class: "name", x: xs.from, y: y - 19 }, svg("title", {}, row.name), truncate(row.name, room - widthOf(told, 11))),
        svg("text", { class: "tick end", x: xs.to, y: y - 19 }, told),
        ...stackDots(row.values.map(xs)).map(([x, off]) => svg("circle", { class: "dot", cx: x, cy: y + off, r: DOT })),
        Number.isFinite(row.low) && Number.isFinite(row.high)
          ? svg("path", { class: "interval", d: `M${xs(row.low)} ${below}H${xs(row.high)}M${xs(row.low)} ${below - 3}v6M${xs(row.high)} ${below - 3}v6` }) : null,
        Number.isFinite(row.mean)
          ? svg("path", { class: "mean", d: `M${xs(row.mean)} ${below - 6}v12` }) : null,
      ];
    });
    const line = rows.map((_, index) => `M${xs(mark?.value)} ${38 + BAND * index - 10}v30`).join(""); // not over the names
    if (Number.isFinite(mark?.value)) lines.push(svg("path", { class: "mark", d: line }, svg("title", {}, mark.name)));
    return [...lines, ...ticksBelow(xs, height - BOTTOM + 8, axis), ...marks];
  }, { height, rows: () => [["name", axis], ...rows.flatMap(({ name, values }) => values.map((value) => [name, value]))] });
  if (pick) {
    const picture = chart.querySelector("svg");
    picture.classList.add("clickable");
    chart.querySelector("figcaption").children[0].after(answering(picture, () => drawn, pick));
  }
  return chart;
}

// What tells the bars of a row apart, besides colour: full, hollow, ending in a disc, ending in a diamond.
const THICK = [5, 5, 1.5, 1.5]; // half of it, pixels
const ENDS = [null, null, "m-5 0a5 5 0 1 0 10 0a5 5 0 1 0 -10 0z", "m0 -6l6 6l-6 6l-6 -6z"];

/** A bar from x to `to` with what lies `over` it but under its end. */
function ratio(index, x, to, y, over = []) {
  const kind = index % THICK.length;
  const thick = THICK[kind];
  const shape = (d) => svg("path", { class: `ratio hue${kind}`, d });
  return [shape(`M${x} ${y - thick}H${Math.max(to, x + 1)}v${2 * thick}H${x}z`), ...over, ENDS[kind] && shape(`M${to} ${y}${ENDS[kind]}`)];
}

/** Shares from 0 to 1.5 as bars with intervals: {name, bars: [{name, value, low, high}]}, all rows with the same bars. */
export function shareChart(title, rows) {
  const [bar, head] = [15, 20];
  const tall = head + Math.max(...rows.map(({ bars }) => bars.length)) * bar + 14;
  const height = rows.length * tall + BOTTOM;
  const chart = figure(title, (width) => {
    const most = Math.max(...rows.flatMap(({ bars }) => bars.flatMap(({ value, high }) => [value ?? 0, high ?? 0])), 0.01);
    const xs = scale([0, Math.min(1.5, Math.ceil(10 * most) / 10)], [4, width - 64]);
    const percent = (value) => (Number.isFinite(value) ? `${formatNumber(100 * value, 1)} %` : "no share");
    return [
      ...ticks(xs.low, xs.high, 5).flatMap((value) => [svg("path", { class: "grid", d: `M${xs(value)} 4V${height - BOTTOM + 4}` }),
        svg("text", { class: "tick middle", x: xs(value), y: height - BOTTOM + 18 }, `${Math.round(100 * value)} %`)]),
      svg("text", { class: "tick end", x: xs.to, y: height - BOTTOM + 32 }, "mean share"),
      ...rows.flatMap(({ name, bars }, row) => [
        svg("text", { class: "name", x: xs.from, y: row * tall + 14 }, svg("title", {}, name), truncate(name, width - 20)),
        ...bars.flatMap((item, index) => {
          const middle = row * tall + head + (index + 0.5) * bar;
          const interval = (Number.isFinite(item.low) ? ["halo", "interval"] : []).map((kind) => svg("path", { class: kind, d: `M${xs(item.low)} ${middle}H${xs(item.high)}M${xs(item.low)} ${middle - 3}v6M${xs(item.high)} ${middle - 3}v6` }));
          return [
            ...(Number.isFinite(item.value) ? ratio(index, xs.from, xs(item.value), middle, interval) : []),
            svg("text", { class: "tick", x: xs(Math.max(item.value ?? 0, item.high ?? 0)) + 10, y: middle + 4 }, percent(item.value), svg("title", {}, item.name)),
          ];
        }),
      ]),
    ];
  }, { height, rows: () => [["name", "bar", "value", "low", "high"], ...rows.flatMap(({ name, bars }) => bars.map((item) => [name, item.name, item.value, item.low, item.high]))] });
  chart.append(el("p", { class: "key" }, ...rows[0].bars.map(({ name }, index) => el("span", {}, svg("svg", { width: 28, height: 12 }, ...ratio(index, 1, 18, 6)), name))));
  return chart;
}

/** Range of an axis: from 0 to the greatest value, or without 0 if all values are far from it. */
function valueRange(values) {
  const [low, high] = [Math.min(0, ...values), Math.max(...values, 0)];
  const least = Math.min(...values);
  return least > NEAR * high ? [least - (high - least) / 10, high] : [low, high];
}

function statistics({ mean, low, high, count, invalid, failed }) {
  const range = Number.isFinite(low) && Number.isFinite(high) ? ` (${formatNumber(low)} – ${formatNumber(high)})` : "";
  return `mean ${formatNumber(mean)}${range}, n = ${formatNumber(count)}${invalid ? `, ${formatNumber(invalid)} invalid` : ""}${failed ? `, ${formatNumber(failed)} failed` : ""}`;
}

/** How wide a text is in letters of a size, pixels. */
function widthOf(text, size) {
  pen.font = `${size}px ${getComputedStyle(document.body).fontFamily}`;
  return pen.measureText(text).width;
}

/** A name cut to a width in pixels. */
function truncate(name, width) {
  const most = Math.max(8, Math.floor((name.length * width) / widthOf(name, 13)));
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

/** A chart that is drawn for its width.
 *  @param rows gives its numbers for a CSV file, heads first
 *  @param logs [which axes are logarithmic as {x, y}, points that tell whether an axis can be] */
function figure(title, draw, { height = HEIGHT, rows, logs: [logs, points] = [{}, []] } = {}) {
  const picture = svg("svg", { class: "chart", role: "img", "aria-label": title, height });
  const file = (suffix) => `${title.toLowerCase().replace(/[^a-z0-9]+/g, "-")}${suffix}`;
  const redraw = () => picture.replaceChildren(...draw(width).filter(Boolean));
  const axis = (name, words, index) => {
    if (points.filter((point) => point[index] > 0).length < 2) return null;
    const button = el("button", { title: `${words} axis logarithmic; values of 0 or less are left out`, "aria-pressed": String(Boolean(logs[name])), click: () => {
      logs[name] = !logs[name];
      button.setAttribute("aria-pressed", logs[name]);
      redraw();
    } }, `log ${name}`);
    return button;
  };
  let width = 0;
  new ResizeObserver(() => {
    if (!picture.clientWidth || picture.clientWidth === width) return;
    width = picture.clientWidth;
    picture.setAttribute("viewBox", `0 0 ${width} ${height}`);
    redraw();
  }).observe(picture);
  return el("figure", {}, el("figcaption", {}, el("span", {}, title), el("span", { class: "exports" }, axis("x", "Horizontal", 0), axis("y", "Vertical", 1),
    el("button", { title: "Save the numbers", click: () => save(file(".csv"), csv(rows())) }, ".csv"),
    el("button", { title: "Save the picture", click: () => save(file(".svg"), standing(picture, title)) }, ".svg"))), picture);
}

/** Rows as a CSV file: cells with a comma, quote or line break are quoted. */
const csv = (rows) => rows.map((row) => row.map((cell) => (/[",\n\r]/.test(cell) ? `"${String(cell).replaceAll('"', '""')}"` : cell ?? "")).join(",")).join("\n");

const LOOKS = ["fill", "stroke", "stroke-width", "stroke-dasharray", "stroke-linejoin", "opacity", "font-family", "font-size", "font-weight", "text-anchor"];

/** A chart as a file of its own, in the colours in which it is seen. */
function standing(picture, title) {
  const copy = picture.cloneNode(true);
  const parts = (root) => [root, ...root.querySelectorAll("*")];
  const [seen, made] = [parts(picture), parts(copy)];
  seen.forEach((item, index) => {
    const style = getComputedStyle(item);
    for (const name of LOOKS) made[index].setAttribute(name, style.getPropertyValue(name));
    made[index].removeAttribute("class");
  });
  copy.setAttribute("width", picture.clientWidth);
  copy.removeAttribute("tabindex");
  copy.prepend(svg("title", {}, title), svg("rect", { width: "100%", height: "100%", fill: getComputedStyle(document.body).backgroundColor }));
  return new XMLSerializer().serializeToString(copy);
}

/** The points that logarithmic axes can show. */
const positive = (points, { x, y }) => points.filter((point) => (!x || point[0] > 0) && (!y || point[1] > 0));

/** Least and greatest x (0) or y (1) of points. */
const extent = (points, index) => [Math.min(...points.map((point) => point[index])), Math.max(...points.map((point) => point[index]))];

function scale([low, high], [from, to], log = false) {
  const span = high - low || 1;
  const share = log ? (value) => Math.log(value / low) / (Math.log(high / low) || 1) : (value) => (value - low) / span;
  const map = (value) => Math.round(10 * (from + share(value) * (to - from))) / 10;
  return Object.assign(map, { low, high: low + span, from, to, log });
}

function axes(xs, ys, across, up) {
  const rungs = ticksOf(ys, 4);
  const texts = tickTexts(rungs);
  return [
    ...rungs.flatMap((value, index) => [
      svg("path", { class: "grid", d: `M${xs.from} ${ys(value)}H${xs.to}` }),
      svg("text", { class: "tick end", x: xs.from - 6, y: ys(value) + 4 }, texts[index]),
    ]),
    ...ticksBelow(xs, ys.from, across, 1),
    svg("text", { class: "tick", x: 2, y: 9 }, up),
  ];
}

function ticksBelow(xs, y, name, least = 0) {
  const places = ticksOf(xs, 5, least);
  const texts = tickTexts(places);
  return [
    ...places.map((value, index) => svg("text", { class: "tick middle", x: xs(value), y: y + 15 }, texts[index])),
    svg("text", { class: "tick end", x: xs.to, y: y + 29 }, name),
  ];
}

/** Numbers for ticks, with as many digits as tell them apart. */
function tickTexts(values) {
  const texts = (digits) => values.map((value) => value.toLocaleString("en", { notation: Math.abs(value) >= 10000 ? "compact" : "standard", maximumSignificantDigits: digits }));
  let digits = 3;
  while (new Set(texts(digits)).size < values.length && digits < MOST_DIGITS) digits += 1;
  return texts(digits);
}

/** Where an axis has numbers: about `count` round ones, or powers of ten and a few between. */
function ticksOf({ low, high, log }, count, least = 0) {
  if (!log) return ticks(low, high, count, least);
  const decades = Math.log10(high / low);
  const steps = decades > 4 ? [1] : decades > 1 ? [1, 3] : [1, 1.5, 2, 3, 5, 7];
  const first = Math.floor(Math.log10(low));
  const found = Array.from({ length: Math.ceil(decades) + 2 }, (_, index) => steps.map((step) => step * 10 ** (first + index))).flat();
  const inside = found.filter((value) => value >= low * 0.999 && value <= high * 1.001);
  return inside.length > 1 ? inside : [low, high];
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
