// The archive of a run: a heat map of the best machine of each cell, and the best of each mechanism class.

import { el, section, formatNumber, table } from "./dom.js";

/** The section; `choose` is called with the content hash of a machine. Null without an archive. */
export function archiveSection(archive, choose) {
  if (!archive) return null;
  const { axes, cells, classes } = archive;
  const best = Math.max(...cells.map(({ score }) => score), 0) || 1;
  const panels = axes[2] ? axes[2].cells.map((name, index) => [`${axes[2].name}: ${name}`, index]) : [["", null]];
  return section("Kinds of machines",
    el("p", {}, `${cells.length} of ${archive.size} cells have a machine (${formatNumber(100 * archive.coverage, 1)} %). QD score: ${formatNumber(archive.qd_score)}.`),
    el("div", { class: "heats" }, ...panels.map(([title, index]) =>
      heatMap(title, axes, cells.filter(({ cell }) => index === null || cell[2] === index), best, choose))),
    el("p", { class: "quiet" }, "Each coloured cell is the best machine of its kind; stronger colour means a higher score. Numbers at the axes are lower bounds. Select a cell to see its machine."),
    table("Best machine of each mechanism class: what drives, what holds, how it lets go", ["Class", "Best score", "Machine"],
      classes.map(({ mechanism, score, machine }) => [mechanism, score, el("button", { class: "link", click: () => choose(machine) }, machine)])));
}

/** One grid: the first axis across, the second upwards (a single row without one). */
function heatMap(title, [across, up], cells, best, choose) {
  const found = new Map(cells.map((item) => [item.cell.slice(0, 2).join(), item]));
  const rows = up ? up.cells.map((name, index) => [name, index]).reverse() : [["", undefined]];
  return el("table", { class: "heat", "aria-label": title || "Archive" },
    el("caption", {}, title),
    el("tbody", {}, ...rows.map(([name, y]) => el("tr", {},
      el("th", { scope: "row" }, name),
      ...across.cells.map((_, x) => heatCell(found.get(y === undefined ? `${x}` : `${x},${y}`), best, choose))))),
    el("tfoot", {},
      el("tr", {}, el("td", {}), ...across.cells.map((name) => el("th", { scope: "col" }, name))),
      el("tr", {}, el("td", { colspan: across.cells.length + 1 }, up ? `${across.name} (across), ${up.name} (upwards)` : across.name))));
}

function heatCell(item, best, choose) {
  if (!item) return el("td", {});
  const text = `${item.mechanism ?? "unknown mechanism"}: ${formatNumber(item.score)}`;
  const button = el("button", { title: text, "aria-label": text, click: () => choose(item.machine) });
  button.style.opacity = 0.2 + 0.8 * Math.max(0, item.score / best);
  return el("td", {}, button);
}
