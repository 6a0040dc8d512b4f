// The page of a sweep: distribution of scores, tables, runs.

import { intervalChart, named as axisName } from "./charts.js";
import { el, section, table, verifiedText, withUnit } from "./dom.js";

/** @param linked makes an element of the name of a run, and of what is shown in its place
 *  @param still makes a picture of the best machine of a variant, {run, machine} */
export function sweepPage(data, linked = (name, ...parts) => (parts.length ? el("div", { class: "card" }, ...parts) : name), still = ({ picture }) => picture && el("img", { src: picture, alt: "", width: 320, height: 240 })) {
  const main = el("main", { class: "alone" },
      el("header", {}, el("p", { class: "kind" }, "agentflow sweep"), el("h1", {}, data.title), el("p", { class: "lede" }, data.about),
        ...data.notes.map((note) => el("p", { class: note.startsWith("INCOMPLETE") ? "problem" : "quiet" }, note))),
      data.spreads.length ? scoreDistributions(data.spreads, (run) => openRun(main, run)) : null,
      bestMachines(data.spreads.filter(({ best }) => best), linked, still),
      ...data.tables.filter(({ columns }) => columns.length).map((item) => tableSection({ ...item, unit: unitOf(item, data.spreads) }, item.title === data.title ? "Results" : item.title)),
      data.runs.length ? runsSection(data.runs, linked) : null);
  return [main];
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

/** The best machine of each variant. */
function bestMachines(rows, linked, still) {
  if (!rows.length) return null;
  return section("Best machines", el("p", { class: "quiet" }, "The highest score of all stages. Verified scores, where there are any, count more."), el("div", { class: "cards" }, ...rows.map(({ task, name, unit, best }) =>
    linked(best.run, still(best) || null, el("b", {}, withUnit(best.score, unit)), el("span", {}, [task, name].filter(Boolean).join(", "))))));
}

/** One chart per task, because each task has its own unit. */
function scoreDistributions(rows, pick) {
  const tasks = [...new Set(rows.map((row) => row.task))].map((task) => rows.filter((row) => row.task === task));
  const known = rows.some((row) => Number.isFinite(row.low));
  const about = `Each dot is a machine of the last stage, and leads to its run; invalid machines count as 0. Below: the mean${known ? " with its 95% bootstrap confidence interval" : ""}.`;
  return section("Distribution of scores",
    ...tasks.map(answer),
    el("p", { class: "quiet" }, about),
    ...tasks.map((found) => intervalChart(found[0].task, axisName("score", found[0].unit), found, null, found.some(({ runs }) => runs.length) ? pick : null)));
}

/** Which variant has the highest mean at a task, and whether the intervals tell it from the next. */
function answer(rows) {
  const [best, next] = rows.filter(({ mean }) => mean !== null).sort((a, b) => b.mean - a.mean);
  if (!next) return null;
  return el("p", {}, `At ${best.task}, ${best.name} has the highest mean, ${withUnit(best.mean, best.unit)}, before ${next.name} with ${withUnit(next.mean, next.unit)}. `,
    best.low === null || next.low === null ? "A mean without an interval rests on too few runs: another seed could reverse the order." : best.low > next.high ? "Their intervals are apart." : "Their intervals overlap: these runs do not tell them apart.");
}

const MOST_ROWS = 12; // of a table that is not folded
const NARROW = 600; // CSS pixels of a phone
const MOST_COLUMNS = 9; // most columns of numbers before a table is transposed

export function tableSection({ heads, columns, rows, published, publishedTitle, notes, unit }, title) {
  const measured = compactTable(title, unit ? `Scores in ${unit}` : published.length ? "Measured" : "", heads, columns, rows);
  return section(capitalize(title), rows.length > MOST_ROWS ? el("details", {}, el("summary", {}, `${rows.length} rows`), measured) : measured,
    published.length ? el("details", {}, el("summary", {}, capitalize(publishedTitle)), compactTable(title, "Published", heads, columns, published)) : null,
    ...notes.map((note) => el("p", { class: "quiet" }, note)));
}

/** A table with labels common to all rows in its caption, transposed if that makes it narrower. */
export function compactTable(title, caption, heads, columns, rows) {
  const count = heads.length;
  const same = (place) => rows.length > 1 && rows.every((row) => row[place] === rows[0][place]);
  const shared = heads.map((_, place) => place).filter(same);
  const left = heads.map((_, place) => place).filter((place) => !same(place));
  const told = [caption, ...shared.map((place) => rows[0]?.[place]).filter(Boolean)].join(" · ");
  const labels = rows.map((row) => left.map((place) => row[place]));
  let titles = left.map((place) => heads[place]);
  if (innerWidth < NARROW && left.length > 1) { // one column of labels leaves room for numbers
    titles = [titles.join(", ")];
    labels.forEach((parts) => parts.splice(0, Infinity, parts.filter(Boolean).join(", ")));
  }
  const values = rows.map((row) => row.slice(count));
  if (columns.length <= MOST_COLUMNS || rows.length >= columns.length) {
    return named(title, table(told, [...titles.map((title) => ["", title]), ...columns], rows.map((_, i) => [...labels[i], ...values[i]]), titles.length));
  }
  const names = labels.map((parts) => ["", parts.join(", ")]);
  const grouped = columns.some(([group]) => group);
  const turned = columns.map(([group, name], i) => [...(grouped ? [group] : []), name, ...values.map((row) => row[i])]);
  return named(title, table(told, [...(grouped ? [["", ""]] : []), ["", ""], ...names], turned, grouped ? 2 : 1));
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

const capitalize = (text) => text.charAt(0).toUpperCase() + text.slice(1);
