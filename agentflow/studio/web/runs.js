// The page of all runs: a list that grows by itself, and the form of a new design.

import { el } from "../../report/web/dom.js";
import { ask, follow } from "./api.js";
import { designForm } from "./design.js";
import { firstVisit, links } from "./first.js";
import { RunList } from "./list.js";

/** What the form cannot take from a run, and the command that repeats the whole of it. */
function leftOut({ form, left }, run, folder) {
  const settings = Object.entries(left).map(([key, value]) => `${key} = ${JSON.stringify(value)}`);
  return settings.length ? el("p", { class: "quiet", role: "note" }, `Filled in from ${run}, but the form has no place for some of its settings: ${settings.join(", ")}. For a run with all of them, enter in a terminal: `,
    el("code", {}, `agentflow design --config '${folder}/${run}/run.yaml'${"seed" in form ? ` --seed ${form.seed}` : ""}`)) : "";
}

/** @param design the task of a new design, whose form is then open
 *  @param again a run, with which the form is filled in */
export async function runsPage({ again, design: task, ...fields }) {
  const [start, given] = await Promise.all([ask("/api/start"), again ? ask("/api/designs/again", { run: again }) : { form: task ? { task } : {}, left: {} }]);
  const before = given.form;
  const list = new RunList(fields);
  const first = firstVisit();
  const form = designForm(start, () => (before.machine ? { machine: before.machine } : {}), undefined, before);
  const design = el("details", { class: "design", open: again || task ? "" : null, toggle: () => form.dispatchEvent(new Event("input")) }, el("summary", {}, "New design"), leftOut(given, again, start.runs), form);
  const hint = el("p", { class: "quiet" }, "New here? ", ...links());
  const show = (empty) => {
    first.hidden = !empty;
    for (const element of [hint, ...list.elements.slice(0, 2)]) element.hidden = empty;
  };
  show(false);
  const stop = follow({}, (news) => {
    if (news.problem) return void (list.count.textContent = news.problem);
    list.hear(news);
    show(!list.rows.size);
  });
  return {
    elements: [el("main", { class: "alone runs" }, el("header", {}, el("h1", {}, "Runs"), el("p", { class: "lede" }, `Language models design machines from blocks; physics scores them. These are the runs and sweeps in the folder ${start.runs}.`), hint), first, design, ...list.elements)],
    close: stop,
  };
}
