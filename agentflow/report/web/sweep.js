// The page of a sweep: its tables, and how the scores of its runs are spread.

import { intervals } from "./charts.js";
import { el, section, table } from "./dom.js";

export function sweepPage(data) {
  return [
    el("main", { class: "alone" },
      el("header", {}, el("p", { class: "kind" }, "agentflow sweep"), el("h1", {}, data.title), el("p", { class: "lede" }, data.about)),
      ...data.spreads.map(({ title, unit, rows }) => section(title, intervals(title, unit, rows))),
      ...data.tables.map(({ title, head, rows }) => section(title, table(title, head, rows)))),
  ];
}
