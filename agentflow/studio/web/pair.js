// The pages that compare runs: two machines side by side and in step, and the best scores of several runs.

import { comparePage } from "../../report/web/compare.js";
import { el, formatNumber, table, withUnit } from "../../report/web/dom.js";
import { bestCharts } from "../../report/web/sections.js";
import { address, ask } from "./api.js";
import { shortName } from "./list.js";

export async function pairPage({ a, b }) {
  const [data, ...runs] = await Promise.all([ask("/api/pair", { a, b }), ask("/api/run", { run: a }), ask("/api/run", { run: b })]);
  const players = [];
  const [main] = comparePage(data, players);
  main.prepend(el("p", { class: "quiet" }, el("a", { href: "#runs" }, "Runs"), " / ",
    el("a", { href: address("run", { run: a }) }, `A: ${a}`), " / ", el("a", { href: address("run", { run: b }) }, `B: ${b}`)));
  const chart = bestCharts("Best score over time", runs.map(({ progress }, side) => ({ name: "AB"[side], progress })), runs[0].task.unit);
  if (chart) main.append(chart);
  return { elements: [main], close: () => players.forEach((player) => player.close()) };
}

/** @param runs names of runs of one task, as a JSON list */
export async function curvesPage({ runs }) {
  const names = JSON.parse(runs);
  const found = await Promise.all(names.map((run) => ask("/api/run", { run })));
  const short = names.map(shortName);
  const { unit } = found[0].task;
  const rows = found.map(({ run }, index) => [el("a", { href: address("run", { run: names[index] }), title: names[index] }, short[index]), run.workflow, withUnit(run.score, unit), withUnit(run.verified?.score, unit), run.verified ? `${run.verified.holds} of ${run.verified.scores.length}` : "–"]);
  return { elements: [el("main", { class: "alone" }, el("p", { class: "quiet" }, el("a", { href: "#runs" }, "Runs"), ` / ${formatNumber(names.length)} runs`),
    el("header", {}, el("h1", {}, `${formatNumber(names.length)} runs compared at ${found[0].run.task}`), el("p", { class: "lede" }, "How their best scores grew.")),
    bestCharts("Best scores", found.map(({ progress }, index) => ({ name: short[index], progress })), unit) ?? "", table("Runs", ["Run", "Workflow", "Score", "Verified", "Holds in"], rows, 2))] };
}
