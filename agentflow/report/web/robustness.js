// How robust a design is: scores by what was varied, and the block whose edits cost most.

import { intervalChart, named } from "./charts.js";
import { el, section, formatNumber, table, withUnit } from "./dom.js";
import { scoreTable } from "./text.js";

/** The page of one machine. */
export function robustnessPage(data) {
  return [el("main", { class: "alone" },
    el("header", {}, el("p", { class: "kind" }, "agentflow robustness"), el("h1", {}, data.task), el("p", { class: "lede" }, data.about)),
    robustnessSection(data.robustness, data.unit))];
}

/** The Pareto front of a run; `choose` is called with the content hash of a machine. Null without one. */
export function frontSection(front, choose) {
  if (!front?.length) return null;
  return section("Pareto front",
    table("Machines that no other simulated machine beats in robust score, score, blocks and mass together", ["Machine", "Robust score", "Score", "Blocks", "Mass, kg"],
      front.map(({ machine, robust, score, blocks, mass }) => [el("button", { class: "link", click: () => choose(machine) }, machine), robust, score, blocks, mass])));
}

/** The section; null without data. */
export function robustnessSection(found, unit) {
  if (!found) return null;
  const { score, robust, kept, neighbours, rows, conditions, others, blocks, faces, picture } = found;
  const share = kept === null ? "" : ` ${formatNumber(100 * kept, 0)} % of ${neighbours} machines one edit away keep at least half of the score.`;
  const told = robust === null ? "No robust score: some simulations failed." : `Robust score ${withUnit(robust, unit)}, the 10 % quantile of ${formatNumber(conditions.length)} conditions.`;
  return section("Robustness",
    el("p", {}, `${told}${share}`),
    intervalChart("Score by what was varied", named("score", unit), rows, { value: score, name: `score ${withUnit(score, unit)}` }),
    el("p", { class: "quiet" }, "Each dot is a simulation; the bar below is their mean. The dashed line is the score without a change. Other engines do not count for the robust score."),
    el("details", {}, el("summary", {}, "Score under each condition"), scoreTable("Score of the design in each world", "Condition", [...conditions, ...others])),
    picture ? sensitive(blocks, faces, picture) : null);
}

function sensitive(blocks, faces, picture) {
  const [worst] = blocks;
  const told = `Most sensitive: block ${worst.block} (${worst.name}), red. Machines in which it is changed or removed score ${formatNumber(worst.mean)} on average.`;
  return el("div", {},
    el("figure", {}, el("figcaption", {}, told), el("img", { class: "still", src: picture, alt: told, width: 640, height: 480 })),
    el("details", {}, el("summary", {}, "Most sensitive blocks and faces"),
      table("Mean score of the machines that differ there", ["Where", "Mean score"], [
        ...blocks.map(({ block, name, mean }) => [`block ${block} (${name})`, mean]),
        ...faces.map(({ block, name, face, mean }) => [`face ${face} of block ${block} (${name})`, mean])])));
}
