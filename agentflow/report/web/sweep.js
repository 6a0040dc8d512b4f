// The page of a sweep: distribution of scores, tables, runs.

import { intervalChart, named as axisName } from "./charts.js";
import { capitalize, el, formatNumber, isNarrow, section, table, verifiedText, withUnit } from "./dom.js";
import { shareText, worthText } from "./text.js";

/** @param linked makes an element of the name of a run, and of what is shown in its place
 *  @param still makes a picture of the best machine of a variant, {run, machine} */
export function sweepPage(data, linked = (name, ...parts) => (parts.length ? el("div", { class: "card" }, ...parts) : name), still = ({ picture }) => picture && el("img", { src: picture, alt: "", width: 320, height: 240 })) {
  const going = stillRunning(data.runs);
  const main = el("main", { class: "alone" },
      el("header", {}, el("p", { class: "kind" }, "agentflow sweep"), el("h1", {}, data.title), el("p", { class: "lede" }, data.about),
        data.warning ? el("p", { class: "problem" }, data.warning) : null,
        ...data.notes.map((note) => (note.startsWith("INCOMPLETE") ? el("p", { class: going ? "score" : "problem", role: "status" }, going || note) : el("p", { class: "quiet" }, note)))),
      data.spreads.length ? scoreDistributions(data.spreads, (run) => openRun(main, run), going) : null,
      bestMachines(data.spreads.filter(({ best }) => best), linked, still),
      ...data.tables.filter(({ columns }) => columns.length).map((item, index) => tableSection({ ...item, unit: unitOf(item, data.spreads) }, item.title === data.title ? "Results" : item.title, index > 0)),
      data.runs.length ? runsSection(data.runs, linked) : null);
  return [main];
}

/** Whether runs are still running, and how many; "" if none is. */
function stillRunning(runs) {
  const count = (state) => runs.filter((run) => run.state === state).length;
  const [running, waiting] = [count("running"), count("not started")];
  return running ? `${running} of ${runs.length} runs ${running === 1 ? "is" : "are"} still running${waiting ? `, ${waiting} not started` : ""}: no verdict yet.` : "";
}

/** Follow the link of a run, or else show it in the list of runs. */
function openRun(main, run) {
  const cell = [...main.querySelectorAll("td:first-child")].find(({ textContent }) => textContent === run);
  if (!cell) return; // a name that a page shows otherwise
  const link = cell.querySelector("a");
  if (link) return link.click();
  cell.closest("details").open = true;
  cell.scrollIntoView({ block: "center" });
  getSelection().selectAllChildren(cell.parentElement);
}

/** The unit of the scores in a table; "" if it has none, or if tasks differ in it. */
function unitOf({ scored }, spreads) {
  const units = new Set(spreads.map(({ unit }) => unit));
  return scored && units.size === 1 ? [...units][0] : "";
}

/** The best machine of each variant; the same machine of several once. */
function bestMachines(rows, linked, still) {
  if (!rows.length) return null;
  const same = [...Map.groupBy(rows, ({ task, best }) => `${task} ${best.machine ?? best.run}`).values()];
  return section("Best machines", el("p", { class: "quiet" }, "By verified score, where there is one. Tables and dots are of scores before verification, so they may show higher ones."), el("div", { class: "cards" }, ...same.map((found) => {
    const [{ task, unit, best, level, record }] = found;
    const names = listed(found.map(({ name }) => name).filter(Boolean));
    return linked(best.run, still(best) || null, el("b", {}, withUnit(best.score, unit), best.verified ? " (verified)" : ""), el("span", {}, [task, names].filter(Boolean).join(", ")), el("small", {}, shareText(record, level, unit)));
  })));
}

/** One chart per task, because each task has its own unit. */
function scoreDistributions(rows, pick, going) {
  const tasks = [...new Set(rows.map((row) => row.task))].map((task) => rows.filter((row) => row.task === task));
  const known = rows.some((row) => Number.isFinite(row.low));
  const about = `Each dot is a machine of the last stage, and leads to its run; n counts them, and one run may have many. Invalid machines count as 0. Below: the mean${known ? " with its 95% bootstrap confidence interval" : ""}.`;
  return section("Distribution of scores",
    ...tasks.map((found) => answer(found, going)),
    el("p", { class: "quiet" }, about),
    ...tasks.map((found) => intervalChart(found[0].task, axisName("score", found[0].unit), found, null, found.some(({ runs }) => runs.length) ? pick : null)));
}

/** Which variants have the highest mean at a task as far as their intervals tell, and what scores are worth there. */
function answer(rows, going) {
  const sorted = rows.filter(({ mean }) => mean !== null).sort((a, b) => b.mean - a.mean);
  const [{ task, unit, good } = {}] = rows;
  const worth = good === undefined ? "" : el("small", {}, `${capitalize(worthText(rows[0]))}.`);
  const decided = sorted.length > 1 && !going;
  return !decided && !worth ? null : el("p", {}, decided ? `At ${task}, ${verdict(sorted, unit)} ${budgets(sorted)}` : `At ${task}: `, worth);
}

const UNEVEN = 1.5; // times as many calls, from which the page names the budgets

/** What a run of each variant spent, where that differs. */
function budgets(rows) {
  const [least, most] = [Math.min(...rows.map(({ calls }) => calls)), Math.max(...rows.map(({ calls }) => calls))];
  return most > UNEVEN * least ? `Their budgets differ: ${listed(rows.map(({ name, calls }) => `a run of ${name} makes ${formatNumber(calls, 0)} calls`))}. ` : "";
}

const MOST_NAMES = 4; // variants that are named one by one
const listed = (parts) => (parts.length > MOST_NAMES ? [...parts.slice(0, MOST_NAMES - 1), `${parts.length - MOST_NAMES + 1} more`] : parts).join(", ").replace(/, ([^,]*)$/, " and $1");

function verdict([best, next, ...others], unit) {
  const means = (found) => listed(found.map(({ mean }) => withUnit(mean, unit)));
  if (best.mean === next.mean) {
    const same = [best, next, ...others].filter(({ mean }) => mean === best.mean);
    return `${listed(same.map(({ name }) => name))} are alike: their means are equal, ${withUnit(best.mean, unit)}.`;
  }
  const first = `${best.name} has the highest mean, ${withUnit(best.mean, unit)}, before ${next.name} with ${withUnit(next.mean, unit)}.`;
  if (best.low === null || next.low === null) return `${first} A mean without an interval rests on too few runs: another seed could reverse the order.`;
  const close = [best, next, ...others].filter((row) => row.high === null || row.high >= best.low);
  return close.length === 1 ? `${first} Their intervals are apart.`
    : `${listed(close.map(({ name }) => name))} are alike as far as these runs tell: their means are ${means(close)}, and ${close.length > 2 ? `the intervals overlap that of ${best.name}` : "their intervals overlap"}.`;
}

const MOST_ROWS = 12; // of a table that is not folded
const MOST_COLUMNS = 9; // most columns of numbers before a table is transposed
const [FEW, BESIDE] = [3, 3]; // on a phone: most columns of numbers before that, and rows that are then beside each other

/** A table under its title, which folds what is long or not asked for first. */
export function tableSection({ heads, columns, rows, published, publishedTitle, notes, unit }, title, folded = rows.length > MOST_ROWS) {
  const parts = [compactTable(title, unit ? `Scores in ${unit}` : published.length ? "Measured" : "", heads, columns, rows),
    published.length ? el("details", {}, el("summary", {}, capitalize(publishedTitle)), compactTable(title, "Published", heads, columns, published)) : null,
    ...notes.map((note) => el("p", { class: "quiet" }, note))];
  const whole = section(capitalize(title), ...(folded ? [] : parts));
  if (folded) whole.append(el("details", {}, el("summary", {}, whole.firstChild), ...parts.filter(Boolean)));
  return whole;
}

/** A table with labels common to all rows in its caption, transposed if that makes it narrower. On a phone, each value of the
 *  label `by` has a table, so that a few conditions are beside each other. */
export function compactTable(title, caption, heads, columns, rows, by = "task") {
  const place = heads.indexOf(by);
  const names = columns.map(([, name]) => name);
  const groups = [...new Set(columns.map(([group]) => group))];
  const each = names.length / groups.length;
  const crossed = groups.length > 1 && each > 1 && !heads.includes("variant") && columns.every(([group, name], i) => group === groups[Math.floor(i / each)] && name === names[i % each]);
  if (!isNarrow() || columns.length <= FEW || place < 0) return oneTable(title, caption, heads, columns, rows);
  const parts = [...Map.groupBy(rows, (row) => row[place])].map(([name, found]) => {
    const told = [name, caption].filter(Boolean).join(" · ");
    if (!crossed || found.length > 1) return oneTable(`${title}, ${name}`, told, heads.toSpliced(place, 1), columns, found.map((row) => row.toSpliced(place, 1)));
    const values = found[0].slice(heads.length);
    return named(`${title}, ${name}`, table(told, ["", ...groups.map((group) => ["", group])], names.slice(0, each).map((metric, i) => [metric, ...groups.map((_, j) => values[j * each + i])]), 1));
  });
  return el("div", {}, ...parts);
}

function oneTable(title, caption, heads, columns, rows) {
  const count = heads.length;
  const same = (place) => rows.length > 1 && rows.every((row) => row[place] === rows[0][place]);
  const shared = heads.map((_, place) => place).filter(same);
  const left = heads.map((_, place) => place).filter((place) => !same(place));
  const told = [caption, ...shared.map((place) => rows[0]?.[place])].filter(Boolean).join(" · ");
  const labels = rows.map((row) => left.map((place) => row[place]));
  let titles = left.map((place) => heads[place]);
  if (isNarrow() && left.length > 1) { // one column of labels leaves room for numbers
    titles = [titles.join(", ")];
    labels.forEach((parts) => parts.splice(0, Infinity, parts.filter(Boolean).join(", ")));
  }
  const values = rows.map((row) => row.slice(count));
  const beside = isNarrow() && rows.length > 1 && rows.length <= BESIDE && columns.length > FEW;
  if (!beside && (columns.length <= MOST_COLUMNS || rows.length >= columns.length)) {
    return named(title, table(told, [...titles.map((title) => ["", title]), ...columns], rows.map((_, i) => [...labels[i], ...values[i]]), titles.length));
  }
  const names = labels.map((parts) => ["", parts.join(", ")]);
  const grouped = columns.some(([group]) => group);
  const turned = columns.map(([group, name], i) => [...(grouped ? [group] : []), name, ...values.map((row) => row[i])]);
  if (!grouped || !isNarrow()) return named(title, table(told, [...(grouped ? [["", ""]] : []), ["", ""], ...names], turned, grouped ? 2 : 1));
  const under = [...Map.groupBy(turned, ([group]) => group)].flatMap(([group, found], index) => [...(group || index ? [[group || "overall"]] : []), ...found.map((row) => row.slice(1))]);
  return named(title, table(told, [["", ""], ...names], under, 1)); // a group is a line of its own
}

/** A table whose region has a name of its own. */
function named(title, region) {
  region.setAttribute("aria-label", `${title}: ${region.getAttribute("aria-label")}`);
  return region;
}

function runsSection(rows, linked) {
  const failed = rows.filter((row) => row.state !== "done");
  const verified = rows.some((row) => row.verified !== null);
  const list = table("", ["Run", "State", "Best score", ...(verified ? ["Verified score"] : []), ...(failed.length ? ["Reason"] : [])],
    rows.map((row) => [linked(row.name), row.state, row.score, ...(verified ? [row.fragile ? verifiedText(row.verified, true) : row.verified] : []), ...(failed.length ? [row.why ?? ""] : [])]));
  const count = rows.length === 1 ? "1 run" : `${rows.length} runs`;
  const word = failed.length ? `${count}, ${failed.length} not done` : `${count}, all done`;
  const details = el("details", {}, el("summary", {}, word), list);
  details.open = failed.length > 0 || rows.length <= MOST_ROWS;
  return section("Runs", details);
}
