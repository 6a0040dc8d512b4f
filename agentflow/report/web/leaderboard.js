// The page of a leaderboard: models ranked by bars with intervals, families as a heat map, failures, tables.

import { lineChart, shareChart } from "./charts.js";
import { el, formatNumber, section, table } from "./dom.js";
import { tableSection } from "./sweep.js";

// How each try can end; only the first two count as a share.
const OUTCOMES = {
  scored: "Scored", invalid: "Invalid machine", diverged: "Diverged", simulation_failed: "Simulation failed",
  unverified: "Not verified", stopped: "Budget used up", missing: "Missing",
};

const WORDS = { first: "one reply, no feedback", refined: "refined with feedback" };
/** What a part of the benchmark is called. */
const wordsOf = (part) => WORDS[part] ?? part;

export function leaderboardPage(data) {
  return [el("main", { class: "alone" }, el("header", {}, el("p", { class: "kind" }, "agentflow leaderboard"), el("h1", {}, data.title), el("p", { class: "lede" }, data.about)), ...leaderboardParts(data))];
}

/** Everything below the heading. */
export function leaderboardParts({ cards, parts, tables, notes }) {
  const words = (note) => (note === `Cards are ranked by ${parts[0]}.` ? `Models are ranked by the share of “${wordsOf(parts[0])}”.` : note);
  const all = { ...tables[0], notes: tables[0].notes.map(words) };
  const lines = cards.filter(({ course }) => course.length).map(({ model, course }) => ({ name: model, points: course }));
  return [
    section("Ranking", el("p", {}, "Each model designs machines for the same tasks. The notes below the chart say what a share is."), shareChart("Mean shares, with 95 % intervals", cards.map((card, index) => ranked(card, index, parts))), ...notes.map((note) => el("p", { class: note.startsWith("INCOMPLETE") ? "problem" : "quiet" }, words(note)))),
    section("Families", heatMap(cards, parts), el("p", { class: "quiet" }, `${parts[1] ? `Large: ${wordsOf(parts[0])}; small: ${wordsOf(parts[1])}. ` : ""}Stronger colour means a greater share.`)),
    lines.length ? section("Share over simulations", lineChart("Mean share of the best machine so far, by plain score", "", "simulations", lines)) : null,
    section("How it ended", ...parts.map((part) => table(`Machines: ${wordsOf(part)}`, ["Model", ...Object.values(OUTCOMES)], outcomes(cards, part)))),
    tableSection(all, "All numbers"), ...tables.slice(1).map((item) => el("details", {}, el("summary", {}, item.title), tableSection(item, item.title))),
  ].filter(Boolean);
}

const ranked = ({ model, complete, total }, index, parts) => ({
  name: `${complete ? `${index + 1}. ` : "Incomplete: "}${model}`,
  bars: parts.map((part) => ({ name: wordsOf(part), value: total[part].mean, low: total[part].interval?.[0], high: total[part].interval?.[1] })),
});

/** A row for each model, a column for each family: every family, also where nothing was scored. */
function heatMap(cards, parts) {
  const families = Object.keys(cards[0].families);
  return el("div", { class: "table", role: "region", tabindex: "0", "aria-label": "Families and models" }, el("table", { class: "heat shares" },
    el("thead", {}, el("tr", {}, el("td", {}), ...families.map((name) => el("th", { scope: "col" }, name)))),
    el("tbody", {}, ...cards.map(({ model, families: shares }) => el("tr", {}, el("th", { scope: "row" }, model), ...families.map((name) => heatCell(name, shares[name], parts)))))));
}

function heatCell(name, shares, [main, lesser]) {
  const percent = (part) => (shares[part].mean === null ? "–" : `${formatNumber(Math.round(100 * shares[part].mean))} %`);
  const cell = el("td", { "data-family": name }, el("b", {}, percent(main)), lesser ? el("small", {}, percent(lesser)) : "");
  cell.style.setProperty("--share", `${Math.round(45 * Math.min(shares[main].mean ?? 0, 1))}%`);
  return cell;
}

const outcomes = (cards, part) => cards.map((card) => [card.model, ...Object.keys(OUTCOMES).map((name) => card.outcomes[part][name] ?? 0)]);
