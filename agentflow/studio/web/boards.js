// Pages over many runs: the gallery of best machines, leaderboards of scorecards, and results of a sweep.

import { el, formatNumber, withUnit } from "../../report/web/dom.js";
import { leaderboardParts } from "../../report/web/leaderboard.js";
import { sweepPage } from "../../report/web/sweep.js";
import { address, ask } from "./api.js";
import { pictureOf, shortName } from "./list.js";

const CARD = "card.json"; // the name of a scorecard
const FIRST = 4; // cards of a task that are shown at once

/** The best runs of each task, best verified score first. */
export async function galleryPage() {
  const [rows, { tasks: known }] = await Promise.all([ask("/api/runs"), ask("/api/start")]);
  const levels = new Map(known.map((level) => [level.name, level]));
  const scored = rows.filter(({ machine, score }) => machine && score !== null);
  const worth = ({ verified, score }) => verified ?? score;
  const tasks = [...Map.groupBy(scored, ({ task }) => task)].sort(([a], [b]) => a.localeCompare(b));
  const card = (row) => el("a", { class: "card", href: address("run", { run: row.run }) }, pictureOf(row, 320, 240, "card"),
    el("b", {}, withUnit(worth(row), row.unit), el("small", {}, row.verified === null ? " not verified" : row.fragile ? " verified, fragile" : " verified")),
    el("span", { title: row.run }, shortName(row.run)), el("small", {}, [row.share === null ? "" : `${formatNumber(100 * row.share, 0)}\u00a0% of its record`, row.workflow, row.model].filter(Boolean).join(" · ")));
  const part = ([task, rows]) => {
    const best = [...new Map(rows.sort((a, b) => worth(a) - worth(b)).map((row) => [row.machine, row])).values()].reverse();
    const cards = el("div", { class: "cards" }, ...best.slice(0, FIRST).map(card));
    const more = best.length > FIRST ? el("button", { click: () => { cards.append(...best.slice(FIRST).map(card)); more.remove(); } }, `Show all ${best.length}`) : "";
    const { title = "", objective = "" } = levels.get(task) ?? {};
    return el("section", {}, el("h2", {}, title ? `${task} · ${title}` : task), el("p", { class: "quiet" }, objective), cards, more);
  };
  return { elements: [el("main", { class: "alone wall" }, el("header", {}, el("h1", {}, "Gallery"), el("p", { class: "lede" }, "The best machines of each task. Open one to see its film and how it was found.")),
    ...(tasks.length ? tasks.map(part) : [el("p", {}, "No run has a scored machine yet. ", el("a", { href: "#runs" }, "Start a design"), ".")]))] };
}

/** Every level: what it asks for, and where to begin. */
export async function tasksPage() {
  const { tasks } = await ask("/api/start");
  const card = (level) => el("li", { class: "card" }, levelPicture(level.name), el("b", {}, level.name), level.title, el("small", {}, level.objective), goodFrom(level),
    el("p", { class: "actions" }, el("a", { class: "button", href: address("build", { task: level.name }) }, "Build"), el("a", { class: "button", href: address("runs", { design: level.name }) }, "Design")));
  return { elements: [el("main", { class: "alone wall" }, el("header", {}, el("h1", {}, "Tasks"), el("p", { class: "lede" }, `${formatNumber(tasks.length)} levels. Build a machine by hand, or let a model design one.`)),
    ...[...Map.groupBy(tasks, ({ family }) => family)].map(([family, levels]) => el("section", {}, el("h2", {}, family), el("ul", { class: "cards" }, ...levels.map(card)))))] };
}

/** The level in 3D. */
export const levelPicture = (task) => el("img", { src: `/api/level?${new URLSearchParams({ task })}`, alt: "", loading: "lazy", width: 320, height: 240 });

/** From which score on a machine is good, and the best one that is known. */
export function goodFrom({ good, record, unit }) {
  return el("small", {}, `Good from ${withUnit(good, unit)}${record ? `, best known ${withUnit(record.verified ?? record.score, unit)}` : ""}.`);
}

export async function leaderboardPage() {
  const [boards, { runs }] = await Promise.all([ask("/api/leaderboards"), ask("/api/start")]);
  const command = (words, does) => el("li", {}, el("code", {}, `agentflow benchmark ${words} --out ${runs}`), el("p", {}, does));
  const none = el("section", {}, el("p", {}, "There is no scorecard in the folder ", el("code", {}, runs), ` yet. A scorecard, ${CARD}, tells how well one model designs machines: its scores on the same tasks as all other models. Each of these commands writes one:`),
    el("ul", {}, command("--lite", "The built-in designer on one task of each family: no model and no key is needed."),
      command("--model NAME --base-url URL", "A language model on all tasks, at any OpenAI-compatible endpoint."),
      command("--model NAME --base-url URL --lite", "The same with one task of each family. Only cards of the same tasks are compared.")),
    el("p", { class: "quiet" }, `If you have scorecards already, put each in a folder of its own: ${runs}/NAME/${CARD}.`));
  return { elements: [el("main", { class: "alone" }, el("header", {}, el("h1", {}, boards.length > 1 ? "Leaderboards" : "Leaderboard"), el("p", { class: "lede" }, "Models side by side, on the fixed tasks of the benchmark.")),
    ...(boards.length ? boards.flatMap((board) => [el("p", { class: "quiet" }, board.about), ...leaderboardParts(board)]) : [none]))] };
}

export async function resultsPage({ sweep }) {
  const [main] = sweepPage(await ask("/api/sweep", { sweep }), (name, ...parts) => el("a", { class: parts.length ? "card" : null, href: address("run", { run: `${sweep}/runs/${name}` }) }, ...(parts.length ? parts : [name])),
    ({ run, machine }) => pictureOf({ run: `${sweep}/runs/${run}`, machine }, 320, 240, "card"));
  main.prepend(el("p", { class: "quiet" }, el("a", { href: "#runs" }, "Runs"), " / ", el("a", { href: address("runs", { sweep }) }, `all runs of ${sweep}`)));
  return { elements: [main] };
}
