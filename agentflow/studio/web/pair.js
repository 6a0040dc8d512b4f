// The pages that compare runs: two machines side by side and in step, and the best scores of several runs.

import { comparePage } from "../../report/web/compare.js";
import { el, formatNumber, table } from "../../report/web/dom.js";
import { bestCharts } from "../../report/web/sections.js";
import { address, ask } from "./api.js";

export async function pairPage({ a, b }) {
  const [data, ...runs] = await Promise.all([ask("/api/pair", { a, b }), ask("/api/run", { run: a }), ask("/api/run", { run: b })]);
  const players = [];
  const [main] = comparePage(data, players);
  main.prepend(el("p", { class: "quiet" }, el("a", { href: "#runs" }, "Runs"), " / ",
    el("a", { href: address("run", { run: a }) }, `A: ${a}`), " / ", el("a", { href: address("run", { run: b }) }, `B: ${b}`)));
  const chart = bestCharts("Best score over time", runs.map(({ progress }, side) => ({ name: "AB"[side], progress })));
  if (chart) main.append(chart);
  return { elements: [main], close: () => players.forEach((player) => player.close()) };
}

/** @param runs names of runs of one task, as a JSON list */
export async function curvesPage({ runs }) {
  const names = JSON.parse(runs);
  const found = await Promise.all(names.map((run) => ask("/api/run", { run })));
  const rows = found.map(({ run }, index) => [el("a", { href: address("run", { run: names[index] }) }, names[index]), run.workflow, run.score, run.verified?.score ?? null, run.verified ? `${run.verified.holds} of ${run.verified.scores.length}` : "–"]);
  return { elements: [el("main", { class: "alone" }, el("p", { class: "quiet" }, el("a", { href: "#runs" }, "Runs"), ` / ${formatNumber(names.length)} runs`),
    el("header", {}, el("h1", {}, found[0].run.task), el("p", { class: "lede" }, "How the best scores of these runs grew.")),
    bestCharts("Best scores", found.map(({ progress }, index) => ({ name: names[index], progress }))) ?? "", table("Runs", ["Run", "Workflow", "Score", "Verified", "Holds in"], rows))] };
}
