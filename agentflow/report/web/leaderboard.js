// The page of a leaderboard: models ranked by bars with intervals, families and machines as heat maps, failures, tables.

import { lineChart, shareChart } from "./charts.js";
import { capitalize, el, formatNumber, isNarrow, section, withUnit } from "./dom.js";
import { Player } from "./player.js";
import { compactTable, tableSection } from "./sweep.js";

// How each try can end; only the first two count as a share.
const OUTCOMES = {
  scored: "Scored", invalid: "Invalid machine", diverged: "Diverged", simulation_failed: "Simulation failed",
  unverified: "Not verified", stopped: "Budget used up", missing: "Missing",
};

const WIDE = 900; // CSS pixels of a window that fits a column for each family

export function leaderboardPage(data) {
  return [el("main", { class: "alone" }, el("header", {}, el("p", { class: "kind" }, "Models side by side, on the fixed items of a benchmark"), el("h1", {}, "Leaderboard"), el("p", { class: "lede" }, `${data.about}.`)), ...leaderboardParts(data))];
}

/** Everything below the heading.
 *  @param actions makes elements for what can be done with a machine, by content hash */
export function leaderboardParts(data, actions = () => [], players = []) {
  const { cards, parts, words, tables } = data;
  const [all, ...others] = tables;
  const lines = cards.filter(({ course }) => course.length).map(({ model, course }) => ({ name: model, points: course }));
  return [
    section("Ranking", el("p", {}, verdict(cards, parts[0], words), ` All machines are simulated on ${data.engine}${data.engine.startsWith("pybullet") ? "" : "; records on other pages are mostly of PyBullet, and scores of two engines do not compare"}.`), data.pars ? el("p", {}, "A share of 100 % is as good as a long search of the built-in designer or a known machine, 0 % no better than random machines.") : "", shareChart("Mean share over all items, with 95 % intervals", cards.map((card, index) => ranked(card, index, parts, words))), ...all.notes.map((note) => el("p", { class: note.startsWith("INCOMPLETE") ? "problem" : "quiet" }, note))),
    section("Families", heatMap("Mean shares by family", "family", Object.keys(cards[0].families), cards, ({ families }, name) => familyCell(families[name], parts), isNarrow() || (innerWidth < WIDE && cards.length < Object.keys(cards[0].families).length)),
      el("p", { class: "quiet" }, `${parts[1] ? `Large: ${words[parts[0]]}; small: ${words[parts[1]]}. ` : ""}Stronger colour means a greater share.`)),
    machinesSection(data, actions, players),
    lines.length ? section("Share over simulations", lineChart("Mean share of the best machine so far, by plain score", "", "simulations", lines)) : null,
    section("How it ended", compactTable("Number of machines by how their simulation ended", "", ["machines of", "model"], Object.values(OUTCOMES).map((name) => ["", name]), parts.flatMap((part) => cards.map((card) => [words[part], shortName(card.model, cards), ...Object.keys(OUTCOMES).map((name) => card.outcomes[part][name] ?? 0)])), "machines of")),
    tableSection({ ...all, notes: [] }, "All numbers"), ...others.map((item) => el("details", {}, el("summary", {}, item.title), compactTable(item.title, "", item.heads, item.columns, item.rows))),
    el("p", { class: "quiet" }, `${data.title}.`),
  ].filter(Boolean);
}

/** Which model is first, and whether its interval is apart from that of the next. */
function verdict([first, next], part, words) {
  const told = ({ model, total }) => `${model} with a mean share of ${percent(total[part].mean)}`;
  if (!next) return `By ${words[part]}: ${told(first)}.`;
  const [own, other] = [first, next].map(({ total }) => total[part].interval);
  const apart = own && other && own[0] > other[1];
  return `By ${words[part]}, ${told(first)} comes before ${told(next)}; ${apart ? "their intervals are apart" : own && other ? "their intervals overlap, so the order may be chance" : "without intervals, the order may be chance"}.`;
}

/** The machines that count, by item and model: a share opens its machine. */
function machinesSection({ cards, parts, words, machines, shapes, files }, actions, players) {
  if (!Object.keys(machines).length) return null;
  const player = new Player(shapes, files);
  players.push(player);
  const told = el("p", { class: "actions" });
  const choose = (button, { model }, { item, title, about, machine, share, score, full, unit }) => {
    player.show(machines[machine], `${item} · ${percent(share)} · ${model}`);
    told.replaceChildren(el("span", {}, `${[capitalize(title), about].filter(Boolean).join(": ")}. Score ${withUnit(score, unit)}; 100 % is ${withUnit(full, unit)}.`), ...actions(machine));
    for (const other of map.querySelectorAll("[aria-pressed=true]")) other.setAttribute("aria-pressed", "false");
    button.setAttribute("aria-pressed", "true");
  };
  const cell = (card, name) => {
    const found = card.items.find(({ item }) => item === name);
    const button = el("button", { disabled: found.machine ? null : "", "aria-pressed": "false", "aria-label": `${name}, ${card.model}: ${percent(found.share)}`, click: () => choose(button, card, found) }, percent(found.share), el("small", {}, found.machine ? withUnit(found.score, found.unit) : "no valid machine"));
    return shaded(el("td", {}, button), found.share);
  };
  const titles = Object.fromEntries(cards[0].items.map(({ item, title, about }) => [item, [title, about]]));
  const map = heatMap("Machines by item", "item", Object.keys(titles), cards, cell, true, titles);
  map.querySelector("button:enabled").click();
  return section("Machines", el("p", {}, `The machine that counts for each item, of “${words[parts[0]]}”. Select a share to see its machine as built.`), el("div", { class: "shown" }, player.element), told, map);
}

const ranked = ({ model, complete, total }, index, parts, words) => ({
  name: `${complete ? `${index + 1}. ` : "Incomplete: "}${model}`,
  bars: parts.map((part) => ({ name: words[part], value: total[part].mean, low: total[part].interval?.[0], high: total[part].interval?.[1] })),
});

/** The name of a model without what is in brackets, where that is clear and the whole name is shown elsewhere. */
const shortName = (model, cards) => {
  const short = (name) => name.replace(/^none \((.*)\)$/, "$1").replace(/ \([^)]*\)$/, "");
  return isNarrow() && cards.filter((card) => short(card.model) === short(model)).length === 1 ? short(model) : model;
};

/** Models against families or items, every one of them, also where nothing was scored; `turned` has a column for each model.
 *  @param titles what names mean: [title, details] */
function heatMap(title, kind, names, cards, cell, turned = false, titles = {}) {
  const head = (scope, text) => el("th", { scope, title: titles[text]?.filter(Boolean).join(": ") }, text, titles[text]?.[0] ? el("small", {}, titles[text][0]) : "");
  const models = cards.map(({ model }) => shortName(model, cards));
  const rows = turned ? names.map((name) => [name, cards.map((card) => cell(card, name))]) : cards.map((card, index) => [models[index], names.map((name) => cell(card, name))]);
  return el("div", { class: "table", role: "region", tabindex: "0", "aria-label": title }, el("table", { class: turned ? "heat shares turned" : "heat shares" },
    el("thead", {}, el("tr", {}, turned ? head("col", kind) : el("td", {}), ...(turned ? models : names).map((name) => head("col", name)))),
    el("tbody", {}, ...rows.map(([name, cells]) => el("tr", {}, head("row", name), ...cells)))));
}

const percent = (share) => (share === null ? "–" : `${formatNumber(Math.round(100 * share))} %`);

function shaded(cell, share) {
  cell.style.setProperty("--share", `${Math.round(45 * Math.min(share ?? 0, 1))}%`);
  return cell;
}

const familyCell = (shares, [main, lesser]) =>
  shaded(el("td", {}, el("b", {}, percent(shares[main].mean)), lesser ? el("small", {}, percent(shares[lesser].mean)) : ""), shares[main].mean);
