// The page of two machines, side by side and in step, with the blocks that differ marked.

import { lineChart } from "../../report/web/charts.js";
import { comparePage } from "../../report/web/compare.js";
import { el, section } from "../../report/web/dom.js";
import { address, ask } from "./api.js";

export async function pairPage({ a, b }) {
  const [data, ...runs] = await Promise.all([ask("/api/pair", { a, b }), ask("/api/run", { run: a }), ask("/api/run", { run: b })]);
  const players = [];
  const [main] = comparePage(data, players);
  main.prepend(el("p", { class: "quiet" }, el("a", { href: "#runs" }, "Runs"), " / ",
    el("a", { href: address("run", { run: a }) }, `A: ${a}`), " / ", el("a", { href: address("run", { run: b }) }, `B: ${b}`)));
  const lines = runs.map(({ progress }, side) => ({ name: "AB"[side], points: bestSoFar(progress) })).filter(({ points }) => points.length > 1);
  if (lines.length) main.append(section("Best score over time", lineChart("Best score so far of both runs", "score", "seconds", lines)));
  return { elements: [main], close: () => players.forEach((player) => player.close()) };
}

/** Steps of the best score, as [seconds, score]. */
function bestSoFar(progress) {
  let best = -Infinity;
  return progress.flatMap(({ seconds, score }) => {
    const before = best;
    best = Math.max(best, score);
    return before === -Infinity || before === best ? [[seconds, best]] : [[seconds, before], [seconds, best]];
  });
}
