// The parts of a run's page in words, tables and charts; each is null if there is nothing to show.

import { barChart, lineChart, named, scoreChart } from "./charts.js";
import { capitalize, el, section, formatNumber, table, withUnit } from "./dom.js";
import { taskDetails, callDetails, toolDetails, scoreTable, worthText } from "./text.js";

const FALL = 0.9; // share of its score below which a machine is warned of when verified
const PLURAL = { reply: "replies", machine: "machines" };

/** `pick` gets a machine. */
export function header(data, pick) {
  const { run } = data;
  const trusted = run.verified?.score ?? null;
  const shown = trusted ?? run.score;
  const budget = run.trajectories === 1 ? "1 trajectory" : `${run.trajectories} trajectories`;
  const attempts = !run.trajectories ? "" : run.begun > run.trajectories ? ` · ${run.begun} first designs` : ` · ${budget}`;
  return el("header", {},
    el("p", { class: "kind" }, `agentflow run · ${run.workflow} · seed ${run.seed}${attempts}`),
    el("h1", {}, run.task),
    el("p", { class: "kind" }, data.task.title),
    el("p", { class: "score" }, shown === null ? "no score" : el("b", {}, withUnit(shown, data.task.unit), data.task.greatest ? ` of ${withUnit(data.task.greatest, data.task.unit)}` : ""), trusted === null ? " " : " (verified) ", run.sentence),
    passedOver(data, pick),
    worth(data, shown),
    trusted !== null && trusted < FALL * run.score ? el("p", { class: "failing" }, `Its score of ${withUnit(run.score, data.task.unit)} falls to ${withUnit(trusted, data.task.unit)} when verified: small changes of physics cost this machine as much.`) : null,
    failing(data),
    run.verified ? verification(run.verified, data.task.unit) : null,
    el("p", { class: "lede" }, run.about),
    taskDetails(data.task));
}

/** What the score is worth: from where on one is good, the record, and how much of it is reached. */
function worth({ task }, shown) {
  const { good, record } = task;
  const share = Number.isFinite(record?.share) && `this is ${formatNumber(100 * record.share, 0)}\u00a0% of the ${record.of}`;
  const told = [worthText(task), share].filter(Boolean).join(" · ");
  if (!told) return null;
  const mark = (kind, value) => {
    const item = el("i", { class: kind });
    item.style.setProperty("--at", `${Math.min(100, (100 * Math.max(0, value)) / Math.max(record?.verified ?? 0, good ?? 0))}%`);
    return item;
  };
  return el("div", { class: "worth" }, el("div", { "aria-hidden": "true" }, mark("reached", shown ?? 0), good ? mark("mark", good) : null), el("p", { class: "quiet" }, capitalize(told)));
}

/** Why a machine with a higher score was not chosen, if one was not. */
function passedOver({ run: { passed }, task: { unit } }, pick) {
  if (!passed) return null;
  const { machine, score, title, holds, of, verified, mean, chosen } = passed;
  const found = verified === null ? "but some of the simulations that verify it failed" : `but ${of ? `holds in ${holds} of ${of} simulations` : "was verified"} (median ${withUnit(verified, unit)}, mean ${withUnit(mean, unit)})`;
  return el("p", { class: "passed" }, `${withUnit(score, unit)} was reached by `, el("button", { class: "link", click: () => pick(machine) }, title),
    `, ${found}. The best machine is the one with the highest mean when verified, ${withUnit(chosen, unit)}.`);
}

/** Why no machine scored, if none did: the most frequent failure. */
function failing({ progress, failures: kinds }) {
  if (!progress.length || progress.some(({ score }) => score !== 0)) return null;
  const count = new Set(progress.map(({ machine }) => machine)).size;
  const [most] = kinds.filter((kind) => kind.count).sort((a, b) => b.count - a.count);
  return el("p", { class: "failing" }, count === 1 ? "The only machine scores 0. " : `All ${count} machines score 0. `,
    most ? `Most frequent failure: ${most.name}, in ${formatNumber(most.count)} ${most.count === 1 ? most.unit : PLURAL[most.unit]} (${most.rule.split(";")[0]}).` : "No failure of a known kind was found.",
    " What each machine did is under Simulation feedback.");
}

/** The verified score, in how many simulations it holds, and the scores that it is the median of. */
function verification({ score, low, high, holds, fails, fragile, scores }, unit) {
  const summary = score === null ? "No verified score: some simulations failed"
    : `The median of ${scores.length} simulations that scored ${formatNumber(low)} to ${formatNumber(high)}; `
      + `${fragile ? "fragile, " : ""}holds in ${holds} of ${scores.length}`;
  return el("details", { class: "printed" }, el("summary", {}, summary),
    el("p", { class: "quiet" }, "The best machine was simulated again with a finer time step, and with slightly different masses, friction and drives. The verified score is the median. It holds where a score is above 0 and at least half of it."),
    scoreTable("Scores of the best machine", "Simulation", scores.map((item) => (fails?.includes(item.variation) ? { ...item, variation: `${item.variation}: fails` } : item))));
}

export function legend() {
  return el("p", { class: "quiet" }, "Each dot is a machine; a line leads to it from the one that it was edited from, and columns tell after how many edits. Stronger colour means a higher score. ",
    "Ring: something broke. Hollow: invalid. Cross: rejected edit. Arrow keys move the selection.");
}

/** That what shows the highest plain score is not about the machine that was chosen, if so. */
const unverified = ({ passed }, what) => (passed ? el("p", { class: "quiet" }, `${what} is by scores before verification, of which the highest was not chosen.`) : null);

const SPENT = ["seconds", "calls", "tokens", "expansions"];

/** The scores over time, calls, tokens or expansions. `chosen` keeps what was chosen; `pick` gets a machine. */
export function scoreCharts({ progress, task, run, nodes }, chosen = {}, pick = null) {
  if (progress.length < 2) return null;
  chosen.logs ??= {};
  const found = overSpent([progress], chosen, (name) => scoreChart(`Score over ${name}`, name, task.unit, progress.map((point) => [point[name], point.score, point.machine]), pick, chosen.logs, run.passed && nodes.find(({ best }) => best)?.machine));
  return found && section("Score", ...found, unverified(run, "Ring: the best machine when verified. The line"));
}

/** The best scores of several runs so far in one chart, from the first to the last: {name, label, progress}. */
export function bestCharts(title, runs, unit, logs = {}) {
  const line = ({ progress, ...run }, name) => {
    let best = -Infinity;
    const rises = progress.filter(({ score }) => score > best && ((best = score), true));
    const marks = rises.map((point) => [point[name], point.score]);
    const points = marks.flatMap(([x, y], index) => (index ? [[x, marks[index - 1][1]], [x, y]] : [[x, y]]));
    return { ...run, marks, points: [...points, [progress.at(-1)[name], marks.at(-1)[1]]] };
  };
  const scored = runs.filter(({ progress }) => progress.length);
  const found = scored.length && overSpent(scored.map(({ progress }) => progress), {}, (name) =>
    lineChart(`Best score so far over ${name}`, named("score", unit), name, scored.map((run) => line(run, name)), logs));
  return found ? section(title, ...found) : null;
}

/** A chart over one of what runs spend, and what chooses which. */
function overSpent(progresses, chosen, make) {
  const spent = SPENT.filter((name) => progresses.some((progress) => progress.at(-1)[name] > 0));
  if (!spent.length) return null;
  const place = el("div", {});
  const draw = (name) => {
    chosen.over = name;
    place.replaceChildren(make(name));
  };
  draw(spent.includes(chosen.over) ? chosen.over : spent[0]);
  const picker = el("select", { "aria-label": "Score over", change: () => draw(picker.value) }, ...spent.map((name) => el("option", { value: name, selected: name === chosen.over ? "" : null }, `over ${name}`)));
  return [spent.length > 1 ? picker : null, place];
}

export function stages({ stages: rows, run }) {
  if (!rows.length) return null;
  const costs = nonzeroColumns(rows, { Calls: "calls", Tokens: "tokens", Simulations: "rollouts" });
  const head = ["Stage", "Valid", "Mean", "Mean, invalid\u00a0=\u00a00", "Best", "Std", ...costs.map(([name]) => name)];
  const shown = table("Scores of the machine of each first design at the end of a stage, whether made in that stage or earlier", head, rows.map((row) => [
    row.words, `${row.valid} of ${row.trajectories}`, row.mean, row.mean_all, row.max, row.std,
    ...costs.map(([, key]) => row[key])]));
  shown.classList.add("stacked"); // where there is little room, each cell names its column
  for (const { cells } of shown.querySelectorAll("tbody tr")) [...cells].forEach((cell, column) => { cell.dataset.head = head[column]; });
  return section("Stages", shown, unverified(run, "Each number"));
}

/** Who made the machines of a search over the whole run. Null without one. */
export function makersSection(makers) {
  if (!makers?.length) return null;
  return section("Who made them",
    table("Machines of the search by who made them. Better: than the machine that they were made from; first machines: than all earlier ones", ["Made by", "Machines", "Share, %", "Better", "Gain in total"],
      makers.map(({ maker, machines, share, better, gain }) => [maker, machines, Math.round(100 * share), better, gain])));
}

/** How often an agent called each tool, by stage. */
export function tools({ stages: rows, tools: calls }) {
  if (!calls.length) return null;
  const names = [...new Set(rows.flatMap((row) => Object.keys(row.tools ?? {})))];
  const uses = ({ calls, refused } = { calls: 0, refused: 0 }) => (refused ? `${calls} (${refused} refused)` : calls);
  const counts = names.map((name) => [name, ...rows.map((row) => uses(row.tools?.[name]))]);
  return section("Tools",
    rows.length ? table("Tool calls by stage", ["Tool", ...rows.map((row) => row.words)], counts) : null,
    el("details", { class: "role" }, el("summary", {}, "Calls ", el("small", {}, `${calls.length}`)), ...calls.map(toolDetails)));
}

/** Columns that are not 0 in every row. */
function nonzeroColumns(rows, columns) {
  return Object.entries(columns).filter(([, key]) => rows.some((row) => row[key] !== 0));
}

export function failures({ validity, reasons, failures: kinds }) {
  if (!validity.length) return null;
  const counted = kinds.filter(({ count }) => count > 0);
  return section("Validity and failures",
    table("Replies by role, including retries", ["Role", "Replies", "Parsed", "Valid", "Repaired"],
      validity.map((row) => [readable(row.role), row.attempts, row.parsed, row.valid, row.repaired])),
    el("h3", {}, "Reasons for rejected replies"),
    reasons.length ? barChart("Reasons for rejected replies", reasons.map(({ code, count, example }) => [code, count, example]))
      : el("p", { class: "quiet" }, "No reply was rejected."),
    el("h3", {}, "Failures by kind"),
    counted.length ? barChart("Failures by kind", counted.map(({ name, count, unit, level, rule }) =>
      [name, count, `${rule} (in ${PLURAL[unit]}; ${level})`])) : el("p", { class: "quiet" }, "No failures."));
}

export function usage({ usage: rows, run }) {
  if (!rows.length) return null;
  const costs = nonzeroColumns(rows, {
    Calls: "calls", Prompt: "prompt", Completion: "completion", Reasoning: "reasoning", Cached: "cached", Seconds: "seconds", Cost: "cost",
  });
  return section("Usage", table("Calls, tokens, time and cost by role", ["Role", ...costs.map(([name]) => name)],
    rows.map((row) => [readable(row.role), ...costs.map(([, key]) => row[key])])),
    run.prices ? null : el("p", { class: "quiet" }, "No prices are configured, so the cost is unknown."));
}

export function conversations({ talk }, calls) {
  if (!talk.length) return null;
  const group = ({ role, labels }) => {
    const details = el("details", { class: "role", toggle: async () => {
      if (!details.open || details.dataset.filled) return;
      details.dataset.filled = "yes";
      const known = await calls();
      details.append(...labels.map((label) => callDetails(known.get(label))));
    } }, el("summary", {}, readable(role), " ", el("small", {}, labels.length === 1 ? "1 call" : `${labels.length} calls`)));
    return details;
  };
  return section("Prompts and replies", ...talk.map(group));
}

export function settings({ facts }) {
  return section("Settings and versions", el("dl", { class: "facts" },
    ...facts.flatMap(([name, value]) => [el("dt", {}, name), el("dd", {}, value)])));
}

const readable = (name) => name.replaceAll("_", " ");
