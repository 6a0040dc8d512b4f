// The page of a sweep: how the scores of its runs are spread, and its tables.

import { intervals } from "./charts.js";
import { el, section, table } from "./dom.js";

export function sweepPage(data) {
  return [
    el("main", { class: "alone" },
      el("header", {}, el("p", { class: "kind" }, "agentflow sweep"), el("h1", {}, data.title), el("p", { class: "lede" }, data.about)),
      data.spreads.length ? section("Scores", intervals("Each dot is a machine, invalid ones at 0; the line is the mean of all with its 95 % bootstrap interval", "score", data.spreads)) : null,
      ...data.tables.map(shownTable)),
  ];
}

const MOST_COLUMNS = 7; // of numbers, before a table is turned

function shownTable({ title, head, labels, rows, published, publishedTitle, notes }) {
  return section(title, fitting("Measured", head, rows, labels),
    published.length ? fitting(publishedTitle, head, published, labels) : null,
    ...notes.map((note) => el("p", { class: "quiet" }, note)));
}

/** A table that says once what all its rows share, turned where that makes it narrower. */
function fitting(caption, head, rows, labels) {
  const same = (column) => column < labels && rows.every((row) => row[column] === rows[0][column]);
  const kept = head.map((_, column) => column).filter((column) => !same(column));
  const shared = head.map((_, column) => column).filter(same).map((column) => rows[0]?.[column]).filter(Boolean);
  const left = kept.filter((column) => column < labels).length;
  const told = [caption, ...shared].join(" · ");
  const words = kept.map((column) => head[column].replaceAll("_", " "));
  const cells = rows.map((row) => kept.map((column) => row[column]));
  if (kept.length - left <= MOST_COLUMNS || rows.length >= kept.length - left) return table(told, words, cells, left);
  const names = cells.map((row) => row.slice(0, left).join(", "));
  const turned = words.slice(left).map((word, index) => [word, ...cells.map((row) => row[left + index])]);
  return table(told, ["", ...names], turned, 1);
}
