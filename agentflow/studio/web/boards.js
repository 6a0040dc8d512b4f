// Pages over many runs or tasks: the gallery of best machines, leaderboards of scorecards, results of a sweep, tasks.

import { capitalize, el, section, withUnit } from "../../report/web/dom.js";
import { leaderboardParts } from "../../report/web/leaderboard.js";
import { sweepPage } from "../../report/web/sweep.js";
import { levelParts, listParts } from "../../report/web/tasks.js";
import { shareText, worthText } from "../../report/web/text.js";
import { address, ask } from "./api.js";
import { holds, keep, pictureOf, searchField, shortName } from "./list.js";

const CARD = "card.json"; // the name of a scorecard
const OWN = 3; // of a task's best runs, on its page
const HAND = "by hand"; // the workflow of a person
const FIRST = 7; // cards of a task that are shown at once

/** A run with a machine, as a card. */
const runCard = (row) => el("a", { class: "card", href: address("run", { run: row.run }) }, pictureOf(row, 320, 240, "card"),
  el("b", {}, withUnit(worth(row), row.unit), el("small", { class: row.verified === null ? "unverified" : null }, row.verified === null ? " not verified" : row.fragile ? " verified, fragile" : " verified"), row.workflow === HAND ? el("small", { class: "hand" }, "made by hand") : ""),
  el("span", { title: row.run }, shortName(row.run)), el("small", {}, shareText(row.record, row.task, row.unit)), row.workflow === HAND ? "" : el("small", {}, [row.workflow, row.model].filter(Boolean).join(" · ")));
const worth = ({ verified, score }) => verified ?? score;

/** Runs whose machines differ and score above 0: verified ones first, then by score. */
const bestRuns = (rows) => [...new Map(rows.filter((row) => row.machine && worth(row) > 0).sort((a, b) => (a.verified !== null) - (b.verified !== null) || worth(a) - worth(b)).map((row) => [row.machine, row])).values()].reverse();

/** The best runs of each task, verified ones first, then by score; tasks by the share that is reached. */
export async function galleryPage() {
  const [rows, { tasks: known }] = await Promise.all([ask("/api/runs"), ask("/api/start")]);
  const levels = new Map(known.map((level) => [level.name, level]));
  const scored = rows.filter((row) => row.machine && worth(row) > 0);
  const reached = ([, found]) => Math.max(...found.map(({ share }) => share ?? 0));
  const tasks = [...Map.groupBy(scored, ({ task }) => task)].sort((a, b) => reached(b) - reached(a) || a[0].localeCompare(b[0]));
  const part = ([task, rows]) => {
    const best = bestRuns(rows);
    const cards = el("div", { class: "cards" }, ...best.slice(0, FIRST).map(runCard));
    const more = best.length > FIRST ? el("button", { click: () => { cards.append(...best.slice(FIRST).map(runCard)); more.remove(); } }, `Show all ${best.length}`) : "";
    const level = levels.get(task);
    const whole = el("section", {}, el("h2", {}, level ? `${task} · ${level.title}` : task), level ? el("p", { class: "quiet" }, `${level.objective} `, goodFrom(level)) : "", cards, more);
    whole.style.setProperty("--cards", cards.children.length);
    return whole;
  };
  return { elements: [el("main", { class: "alone wall gallery" }, el("header", {}, el("h1", {}, "Gallery"), el("p", { class: "lede" }, "The best machines of each task, those nearest to a record first. Verified ones come before others; those that score 0 are left out. Open one to see its film and how it was found.")),
    ...(tasks.length ? tasks.map(part) : [el("p", {}, "No run has a machine that scores above 0 yet. ", el("a", { href: "#runs" }, "Start a design"), ".")]))] };
}

/** What a list of levels offers: by family, each with its title. */
export const taskOptions = (tasks, chosen) => [...Map.groupBy(tasks, ({ family }) => family)].map(([family, levels]) => el("optgroup", { label: capitalize(family) },
  ...levels.map(({ name, title }) => el("option", { value: name, selected: name === chosen ? "" : null }, `${name} · ${title}`))));

const levelAddress = (task, on = "card") => `/api/level/picture?${new URLSearchParams({ task, on })}`;

/** The level in 3D. */
export const levelPicture = (task) => el("img", { src: levelAddress(task), alt: "", loading: "lazy", width: 320, height: 240 });

/** From which score on a machine is good, and the record. */
export const goodFrom = (level) => el("small", {}, `${capitalize(worthText(level))}.`);

/** One leaderboard: scorecards of other benchmarks have others. */
export async function leaderboardPage({ board = 0 }) {
  const [boards, { runs }, rows] = await Promise.all([ask("/api/leaderboards"), ask("/api/start"), ask("/api/runs")]);
  const command = (words, does) => el("li", {}, el("code", {}, `agentflow benchmark ${words} --out ${runs}`), " ", el("button", { click: ({ target }) => navigator.clipboard.writeText(target.parentElement.querySelector("code").textContent).then(() => { target.textContent = "Copied"; }) }, "Copy"), el("p", {}, does));
  const more = el("section", {}, el("h2", {}, "Where cards come from"), el("p", {}, boards.length ? "Shown are the scorecards that agentflow ships, docs/cards in its repository, and those in the folder " : "There is no scorecard in the folder ", el("code", {}, runs), `. A scorecard, ${CARD}, tells how well one model designs machines: its scores on the same tasks as all other models. Each of these commands writes one:`),
    el("ul", {}, command("--lite", "The built-in designer on one task of each family: no model and no key is needed."),
      command("--model NAME --base-url URL", "A language model on all tasks, at any OpenAI-compatible endpoint."),
      command("--model NAME --base-url URL --lite", "The same with one task of each family. Only cards of the same tasks are compared.")),
    el("p", { class: "quiet" }, `If you have scorecards already, put each in a folder of its own: ${runs}/NAME/${CARD}.`));
  const shown = boards[board] ?? boards[0];
  const picks = boards.map((item, index) => el("a", { class: "button", href: address("leaderboard", { board: index }), "aria-current": item === shown ? "page" : null }, item.about));
  const runOf = (machine) => rows.filter((row) => row.machine === machine).slice(0, 1).map(({ run }) => el("a", { class: "button", href: address("run", { run }) }, "Its run, with films"));
  const players = [];
  return { close: () => players.forEach((player) => player.close()), elements: [el("main", { class: "alone" }, el("header", {}, el("p", { class: "kind" }, "Models side by side, on the fixed items of a benchmark"), el("h1", {}, "Leaderboard"), shown ? el("p", { class: "lede" }, `${shown.about}. Each model has a scorecard. To add one: `, el("code", {}, `agentflow benchmark --model NAME --base-url URL --out ${runs}`)) : ""),
    picks.length > 1 ? el("nav", { class: "picks", "aria-label": "Benchmarks" }, ...picks) : "",
    ...(shown ? leaderboardParts(shown, runOf, players) : []), more)] };
}

export async function resultsPage({ sweep }) {
  const [main] = sweepPage(await ask("/api/sweep", { sweep }), (name, ...parts) => el("a", { class: parts.length ? "card" : null, href: address("run", { run: `${sweep}/runs/${name}` }) }, ...(parts.length ? parts : [name])),
    ({ run, machine }) => pictureOf({ run: `${sweep}/runs/${run}`, machine }, 320, 240, "card"));
  main.prepend(el("p", { class: "quiet" }, el("a", { href: "#runs" }, "Runs"), " / ", el("a", { href: address("runs", { sweep }) }, `all runs of ${sweep}`)));
  return { elements: [main] };
}

/** The cards of all levels, and filters in place of what jumps to a family. */
function filtered(levels, { words = "", family = "" }) {
  const [header, , ...parts] = listParts(levels, ({ name }) => address("tasks", { task: name }));
  const search = searchField(words, { input: () => draw() });
  const families = el("select", { "aria-label": "family", change: () => draw() }, el("option", { value: "" }, "any family"), ...[...new Set(levels.map((level) => level.family))].map((name) => el("option", { selected: name === family ? "" : null }, name)));
  const count = el("span", { class: "quiet", role: "status" });
  const clear = el("button", { click: () => { search.value = families.value = ""; draw(); } }, "Clear filters");
  const draw = () => {
    const found = new Set(levels.filter((level) => holds(search.value, [level.name, level.family, level.title, level.objective]) && (families.value || level.family) === level.family).map(({ name }) => name));
    for (const part of parts) {
      for (const card of part.querySelectorAll(".card")) card.hidden = !found.has(card.dataset.task);
      part.hidden = !part.querySelector(".card:not([hidden])");
    }
    clear.hidden = found.size === levels.length;
    count.textContent = !found.size ? "No level fits these filters." : `${clear.hidden ? "" : `${found.size} of `}${levels.length} levels`;
    keep("tasks", { words: search.value, family: families.value });
  };
  draw();
  return [header, el("div", { class: "filters" }, search, families, count, clear), ...parts];
}

/** All tasks, or one: its pictures are drawn when they come into view. */
export async function tasksPage({ task, ...fields }) {
  const pictured = (level, on) => ({ ...level, picture: levelAddress(level.name, on) });
  if (!task) {
    const levels = (await ask("/api/start")).tasks.map((level) => pictured(level, "card"));
    return { elements: [el("main", { class: "alone wall" }, ...filtered(levels, fields))] };
  }
  const [found, rows] = await Promise.all([ask("/api/level", { task }), ask("/api/runs")]);
  const level = pictured(found, "page");
  const own = bestRuns(rows.filter((row) => row.task === task)).slice(0, OWN);
  const lead = (page, fields, words, kind = "button") => el("a", { class: kind, href: address(page, fields) }, words);
  return { elements: [el("main", { class: "alone" }, el("p", { class: "quiet" }, el("a", { href: "#tasks" }, "Tasks"), ` / ${task}`),
    ...levelParts(level, [lead("build", { task }, "Build a machine", "button play"), lead("runs", { design: task }, "Let a model design one"), lead("runs", { task }, "Runs on it"), ...(level.recorded ? [lead("build", { task, record: "yes" }, "Open the machine of the record")] : [])],
      own.length ? section("Your best", el("div", { class: "cards" }, ...own.map(runCard))) : ""))] };
}
