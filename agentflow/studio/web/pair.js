// The pages that compare runs: two machines side by side and in step, and the best scores of several runs.

import { comparePage } from "../../report/web/compare.js";
import { el, formatNumber, section, table, withUnit } from "../../report/web/dom.js";
import { bestCharts } from "../../report/web/sections.js";
import { address, ask } from "./api.js";
import { pictureOf, shortName } from "./list.js";

export async function pairPage({ a, b }) {
  const [data, ...runs] = await Promise.all([ask("/api/pair", { a, b }), ask("/api/run", { run: a }), ask("/api/run", { run: b })]);
  const players = [];
  const [one, other] = [a, b].map(shortName);
  data.machines.forEach((machine) => { if (one !== other) machine.source = shortName(machine.source); });
  const [main] = comparePage(data, players);
  main.prepend(el("p", { class: "quiet" }, el("a", { href: "#runs" }, "Runs"), " / ",
    el("a", { href: address("run", { run: a }) }, `A: ${data.machines[0].source}`), " / ", el("a", { href: address("run", { run: b }) }, `B: ${data.machines[1].source}`)));
  const chart = bestCharts("Best score over time", runs.map(({ progress }, side) => ({ name: "AB"[side], label: "AB"[side], progress })), runs[0].task.unit);
  if (chart) main.append(chart);
  return { elements: [main], close: () => players.forEach((player) => player.close()) };
}

/** @param runs names of runs of one task, as a JSON list */
export async function curvesPage({ runs }) {
  const names = JSON.parse(runs);
  const [listed, ...found] = await Promise.all([ask("/api/runs"), ...names.map((run) => ask("/api/run", { run }))]);
  const { run: { task }, task: { unit } } = found[0];
  const items = found.map(({ run, progress }, index) => ({ ...listed.find((row) => row.run === names[index]), verification: run.verified, progress, label: (index + 10).toString(36).toUpperCase() }));
  const card = (item) => el("a", { class: "card", href: address("run", { run: item.run }) }, item.machine ? pictureOf(item, 320, 240, "card") : el("span", { class: "blank" }, "no machine"),
    el("b", {}, `${item.label} · ${withUnit(item.score, unit)}`), el("span", { title: item.run }, shortName(item.run)), el("small", {}, [item.workflow, item.model].join(" · ")));
  const rows = items.map((item) => [`${item.label} · ${item.workflow}`, item.score, item.verified, item.verification ? `${item.verification.holds} of ${item.verification.scores.length}` : "–", item.progress.length, item.calls]);
  const [best, next] = items.filter(({ machine, state }) => machine && state !== "running" && state !== "open").sort((a, b) => b.score - a.score);
  const measure = unit ? `, ${unit}` : "";
  return { elements: [el("main", { class: "alone wall" }, el("p", { class: "quiet" }, el("a", { href: "#runs" }, "Runs"), ` / ${formatNumber(names.length)} runs`),
    el("header", {}, el("h1", {}, `${formatNumber(names.length)} runs compared at ${task}`), el("p", { class: "lede" }, found[0].task.objective)),
    el("div", { class: "cards" }, ...items.map(card)),
    next ? el("p", {}, el("a", { class: "button", href: address("pair", { a: best.run, b: next.run }) }, `Films of ${best.label} and ${next.label} side by side`)) : "",
    bestCharts("Best scores", items.map(({ run, label, progress }) => ({ name: `${label} ${shortName(run)}`, label, progress })), unit) ?? "",
    section("Runs", table("", ["Run", `Score${measure}`, `Verified${measure}`, "Holds in", "Simulations", "Calls"], rows, 1)))] };
}
