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

function shownTable({ title, head, labels, rows, published, publishedTitle, notes }) {
  return section(title, table("Measured", head, rows, labels),
    published.length ? table(publishedTitle, head, published, labels) : null,
    ...notes.map((note) => el("p", { class: "quiet" }, note)));
}
