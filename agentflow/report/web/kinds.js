// Kinds of machines: the archive of a search as heat maps, and the best machine of each mechanism class.

import { el, section, formatNumber, revealHidden, withUnit } from "./dom.js";

const EMPTY = 0.05; // share of cells below which an archive is nearly empty

/** The section; `choose` is called with the content hash of a machine. Null if there is only one kind. */
export function kindsSection({ archive, classes = [], task: { unit } }, choose) {
  if (!archive && classes.length < 2) return null;
  return section("Kinds of machines", ...(archive ? archiveParts(archive, unit, choose) : []),
    classes.length ? el("h3", {}, "Best machine of each mechanism class: what drives / what holds / how it releases") : null,
    el("div", { class: "cards" }, ...classes.map((item) => classCard(item, unit, choose))));
}

function archiveParts({ axes, cells, size, coverage, qd_score }, unit, choose) {
  const best = Math.max(...cells.map(({ score }) => score), 0) || 1;
  const panels = axes[2] ? axes[2].cells.map((name, index) => [`${axes[2].name}: ${name}`, index]) : [["", null]];
  const shown = panels.map(([title, index]) => [title, cells.filter(({ cell }) => index === null || cell[2] === index)])
    .filter(([, found]) => found.length);
  return [
    el("p", {}, `${cells.length} of ${size} cells have a machine (${formatNumber(100 * coverage, 1)} %). The sum of their scores, the QD score, is ${formatNumber(qd_score)}.`),
    coverage < EMPTY ? el("p", {}, "So the archive is nearly empty. Each cell takes at least one simulation, and most machines are of a kind that is there already: in measured runs, 100 simulations filled 5 to 20 % of the cells. Raise settings.max_simulations.") : null,
    el("div", { class: "heats" }, ...shown.map(([title, found]) => heatMap(title, axes, found, best, unit, choose))),
    el("p", { class: "quiet" }, "Each coloured cell is the best machine of its kind; stronger colour means a higher score. ",
      `In a cell, large: the score${unit && ` in ${unit}`} of that machine; small: how many machines fell into the cell. At the axes: lower bounds, or single whole numbers. Select a cell to see its machine.`,
      shown.length < panels.length ? ` Grids without a machine are left out: ${panels.length - shown.length} of ${panels.length}.` : ""),
  ];
}

/** One grid: the first axis across, the second upwards (a single row without one). */
function heatMap(title, [across, up], cells, best, unit, choose) {
  const found = new Map(cells.map((item) => [item.cell.slice(0, 2).join(), item]));
  const columns = across.cells;
  const rows = up ? up.cells.map((name, y) => [name, y]).reverse() : [["", undefined]];
  return el("table", { class: "heat", "aria-label": revealHidden(title) || "Archive" },
    el("caption", {}, title),
    el("tbody", {}, ...rows.map(([name, y], index) => el("tr", {},
      index || !up ? null : el("th", { class: "upwards", rowspan: rows.length }, up.name),
      el("th", { scope: "row" }, name),
      ...columns.map((_, x) => heatCell(found.get(y === undefined ? `${x}` : `${x},${y}`), best, unit, choose))))),
    el("tfoot", {},
      el("tr", {}, el("td", { colspan: up ? 2 : 1 }), ...columns.map((name) => el("th", { scope: "col" }, name))),
      el("tr", {}, el("td", { colspan: up ? 2 : 1 }), el("td", { colspan: columns.length }, across.name))));
}

function heatCell(item, best, unit, choose) {
  if (!item) return el("td", {});
  const text = revealHidden(`${item.mechanism ?? "unknown mechanism"}: ${withUnit(item.score, unit)}, ${machines(item.count)}`);
  const button = el("button", { title: text, "aria-label": text, click: () => choose(item.machine) }, formatNumber(item.score, 1), el("small", {}, `${item.count}`));
  button.style.setProperty("--share", `${Math.round(10 + 33 * Math.max(0, item.score / best))}%`);
  return el("td", {}, button);
}

const machines = (count) => (count === 1 ? "1 machine" : `${count} machines`);

function classCard({ mechanism, score, machine, count, picture }, unit, choose) {
  return el("button", { class: "card", click: () => choose(machine) },
    el("img", { src: picture, alt: "", width: 320, height: 240 }),
    el("b", {}, withUnit(score, unit)),
    el("span", {}, mechanism),
    el("small", {}, machines(count)));
}
