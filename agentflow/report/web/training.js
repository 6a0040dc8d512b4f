// The page of a training run: the film of a sample, curves, samples by step, diversity by step.

import { intervalChart, lineChart, named as axisName } from "./charts.js";
import { el, section, withUnit } from "./dom.js";
import { Player } from "./player.js";
import { plain } from "./text.js";

const MOST_ROWS = 12; // most steps in a chart of distributions

export function trainingPage(data) {
  const bare = !Object.keys(data.machines).length; // without films, the text takes the whole page
  const player = bare ? null : new Player(data.shapes, data.files);
  const chosen = el("section", { class: "chosen", "aria-label": "Selected sample" });
  const several = new Set(data.steps.map((step) => step.task)).size > 1;
  const choose = (step, sample) => {
    const title = `${nameOf(step, several)} · ${withUnit(sample.score, step.unit)}`;
    player.show(data.machines[sample.machine], title, data.machines[sample.machine].remark);
    chosen.replaceChildren(el("h2", {}, title), el("details", {}, el("summary", {}, "Reply"), plain(sample.text)));
  };
  const best = data.steps.findLast((step) => step.best.length);
  if (best) choose(best, best.best[0]);
  return [
    bare ? "" : el("aside", {}, player.element),
    el("main", { class: bare ? "alone" : null },
      el("header", {}, el("p", { class: "kind" }, `agentflow training · ${data.about}`), el("h1", { class: "folder" }, data.title), el("p", { class: "lede" }, data.label)),
      best ? chosen : null,
      data.charts.length ? section("Curves", ...data.charts.map(curve)) : el("p", { class: "quiet" }, "No step is logged yet."),
      data.zero.length ? el("p", { class: "quiet" }, `Always 0: ${data.zero.map(readable).join(", ")}.`) : null,
      ...data.tasks.filter(({ charts }) => charts.length).map(({ task, charts }) => section(several ? `Sample statistics: ${task}` : "Sample statistics", ...charts.map(curve))),
      data.steps.length ? samples(data.steps, several, choose) : null,
      section("Settings", el("dl", { class: "facts" }, ...data.facts.flatMap(([name, value]) => [el("dt", {}, name), el("dd", {}, value)])))),
  ];
}

const curve = ({ title, unit, lines }) => lineChart(capitalize(readable(title)), unit, "step", lines.map(({ name, points }) => ({ name: readable(name), points })));

/** One part for each step: its numbers, its best machines, and replies without a machine. */
function samples(steps, several, choose) {
  const rows = steps.filter((_, index) => index % Math.ceil(steps.length / MOST_ROWS) === 0 || index === steps.length - 1);
  return section("Samples by step",
    el("p", { class: "quiet" }, "Each dot is a reply; replies without a valid machine count as 0. Below: the mean with its 95% bootstrap confidence interval."),
    ...[...new Set(rows.map((row) => row.task))].map((task) => intervalChart(`Scores: ${task}`, axisName("score", rows.find((row) => row.task === task).unit),
      rows.filter((row) => row.task === task).map((row) => ({ ...row, name: `step ${row.step}`, invalid: row.count - row.valid })))),
    ...steps.toReversed().map((step, index) => el("details", { open: index === 0 && "" },
      el("summary", {}, nameOf(step, several), " ", el("small", {}, counts(step))),
      step.best.length ? el("p", { class: "picks" }, ...step.best.map((sample) =>
        el("button", { click: () => choose(step, sample) }, `Show ${withUnit(sample.score, step.unit)}`))) : null,
      ...step.refused.map((reply) => el("details", { class: "said" },
        el("summary", {}, "Reply without a valid machine ", el("small", {}, reply.problem.replaceAll("_", " "))), plain(reply.text))))));
}

const nameOf = ({ step, task }, several) => `step ${step}${several ? `, ${task}` : ""}`;

function counts({ count, valid, faults, mean, values, unit }) {
  return [`${valid} of ${count} valid`, `mean ${withUnit(mean, unit)}`, values.length ? `best ${withUnit(values.at(-1), unit)}` : null,
    faults ? `${faults} without a score: their simulation crashed or timed out` : null].filter(Boolean).join(" · ");
}

/** The name of a number without its group: "best_at.4" is "Best@4", "seconds_update" is "update". */
const readable = (name) => name.replace("best_at.", "Best@").replace(/^diversity\.|^seconds_|\.share$/g, "").replaceAll("_", " ");

const capitalize = (text) => text.charAt(0).toUpperCase() + text.slice(1);
