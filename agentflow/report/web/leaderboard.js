// The page of a leaderboard: models ranked by bars with intervals, families as a heat map, failures, tables.

import { shareChart } from "./charts.js";
import { el, formatNumber, section, table } from "./dom.js";
import { tableSection } from "./sweep.js";

// How each try can end; only the first two count as a share.
const OUTCOMES = {
  scored: "Scored", invalid: "Invalid machine", diverged: "Diverged", simulation_failed: "Simulation failed",
  unverified: "Not verified", stopped: "Budget used up", missing: "Missing",
};

export function leaderboardPage(data) {
  return [el("main", { class: "alone" }, el("header", {}, el("p", { class: "kind" }, "agentflow leaderboard"), el("h1", {}, data.title), el("p", { class: "lede" }, data.about)), ...leaderboardParts(data))];
}

/** Everything below the heading. */
export function leaderboardParts({ cards, tables, notes }) {
  return [
    section("Ranking", shareChart("Share of the best known scores, with 95 % intervals", cards.map(ranked)), ...notes.map((note) => el("p", { class: note.startsWith("INCOMPLETE") ? "problem" : "quiet" }, note))),
    section("Families", heatMap(cards), el("p", { class: "quiet" }, "Large: the share after two rounds of feedback; small: of first replies without feedback. Stronger colour means a greater share.")),
    section("How it ended", table("Best machines of refined runs, one per item", ["Model", ...Object.values(OUTCOMES)], outcomes(cards, "refined")),
      table("Machines of first replies", ["Model", ...Object.values(OUTCOMES)], outcomes(cards, "first"))),
    tableSection(tables[0], "All numbers"), ...tables.slice(1).map((item) => el("details", {}, el("summary", {}, item.title), tableSection(item, item.title))),
  ];
}

const ranked = ({ model, complete, total }, index) => ({
  name: `${complete ? `${index + 1}. ` : "Incomplete: "}${model}`,
  bars: [["refined", total.refined], ["first", total.first]].map(([name, { mean, interval }]) => ({ name, value: mean, low: interval?.[0], high: interval?.[1] })),
});

/** A row for each model, a column for each family: every family, also where nothing was scored. */
function heatMap(cards) {
  const families = Object.keys(cards[0].families);
  return el("div", { class: "table", role: "region", tabindex: "0", "aria-label": "Families and models" }, el("table", { class: "heat shares" },
    el("thead", {}, el("tr", {}, el("td", {}), ...families.map((name) => el("th", { scope: "col" }, name)))),
    el("tbody", {}, ...cards.map(({ model, families: shares }) => el("tr", {}, el("th", { scope: "row" }, model), ...families.map((name) => heatCell(shares[name])))))));
}

function heatCell({ first, refined }) {
  const percent = ({ mean }) => (mean === null ? "–" : `${formatNumber(Math.round(100 * mean))} %`);
  const cell = el("td", {}, el("b", {}, percent(refined)), el("small", {}, percent(first)));
  cell.style.setProperty("--share", `${Math.round(70 * Math.min(refined.mean ?? 0, 1))}%`);
  return cell;
}

const outcomes = (cards, part) => cards.map((card) => [card.model, ...Object.keys(OUTCOMES).map((name) => card[part][name] ?? 0)]);
