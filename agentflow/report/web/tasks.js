// The pages of tasks: a card for each level, by family, and one level in full.

import { el, formatNumber, section, svg, table, verifiedText, withUnit } from "./dom.js";
import { list, worthText } from "./text.js";

/** A page in a file: the part of the address after # chooses a level: tasks.html#throwing/3. */
export function tasksPage({ levels }) {
  const main = el("main", { class: "alone" });
  const draw = () => {
    const wanted = decodeURIComponent(location.hash.slice(1));
    const level = levels.length === 1 ? levels[0] : levels.find(({ name }) => name === wanted);
    const back = levels.length > 1 ? el("p", { class: "quiet" }, el("a", { href: "#" }, "Tasks"), ` / ${wanted}`) : "";
    main.replaceChildren(...(level ? [back, ...levelParts(level)] : listParts(levels, ({ name }) => `#${name}`)));
    scrollTo(0, 0);
  };
  addEventListener("hashchange", draw);
  draw();
  return [main];
}

/** All levels as cards.
 *  @param linked the address of a level */
export function listParts(levels, linked) {
  const families = [...Map.groupBy(levels, ({ family }) => family)];
  const parts = families.map(([family, items]) => {
    const [{ objective }] = items;
    return el("section", { "aria-label": family }, el("h2", {}, family), el("p", { class: "quiet" }, objective),
      el("div", { class: "cards" }, ...items.map((level) => el("a", { class: "card", href: linked(level), "data-task": level.name },
        el("img", { src: level.picture, alt: "", loading: "lazy", width: 400, height: 300 }),
        el("b", {}, level.title), el("span", {}, level.name),
        level.objective === objective ? "" : el("small", {}, level.objective),
        el("small", {}, worthText(level))))));
  });
  const jump = (index) => () => parts[index].scrollIntoView();
  return [
    el("header", {}, el("p", { class: "kind" }, "agentflow tasks"), el("h1", {}, "Tasks"),
      el("p", { class: "lede" }, `What machines are built for: ${formatNumber(families.length)} families of tasks, which differ in their goal, and ${formatNumber(levels.length)} levels, which differ in scene and rules. Open a level to see it in full, and to build for it.`),
      el("p", { class: "quiet" }, `Pictures show a machine at its start. Record: the score of the best known machine, verified by simulations with small changes of masses, friction, drives and time step.${levels.some((level) => level.record?.fragile) ? " Fragile: it fails in some of them." : ""}`)),
    el("p", { class: "picks" }, ...families.map(([family], index) => el("button", { click: jump(index) }, family))),
    ...parts,
  ];
}

const record = ({ record: best, unit }) => best && verifiedText(best.verified, best.fragile, unit);

/** One level in full.
 *  @param actions elements that lead on from it
 *  @param own an element about what was reached here */
export function levelParts(level, actions = [], own = "") {
  const best = level.record;
  const facts = [
    ["Scored time", `${formatNumber(level.window)} s`],
    ["Good score", `from ${withUnit(level.good, level.unit)}`],
    level.greatest === null ? null : ["Greatest score", withUnit(level.greatest, level.unit)],
    best && ["Record", `${record(level)}, verified on ${best.engine}, with ${formatNumber(best.blocks)} blocks; ${best.how}`],
    ["Blocks", `${formatNumber(level.blocks.length)} types${level.most_blocks === null ? "" : `, at most ${formatNumber(level.most_blocks)} blocks`}`],
    level.note ? ["Note", level.note] : null,
  ].filter(Boolean);
  return [
    el("header", {}, el("p", { class: "kind" }, `agentflow task · ${level.name}`), el("h1", {}, level.title), el("p", { class: "lede" }, level.objective)),
    actions.length ? el("p", { class: "actions" }, ...actions) : "",
    el("div", { class: "pair" },
      el("figure", {}, el("img", { class: "still", src: level.picture, alt: `${level.name} with ${level.machine}`, width: 960, height: 720 }), el("figcaption", {}, `The level, with ${level.machine} at its start.`)),
      el("dl", { class: "facts" }, ...facts.flatMap(([name, text]) => [el("dt", {}, name), el("dd", {}, text)]))),
    own,
    section("Scene and schedule", list([...level.scene, ...level.schedule])),
    section("Score", list(level.score)),
    section("Plan", el("p", { class: "quiet" }, "Dashed: where the machine is built. From the right, what does not cross x = 0 is only outlined."),
      el("div", { class: "pair" }, ...level.drawings.map(drawn))),
    section("Rules", el("details", {}, el("summary", {}, `${formatNumber(level.blocks.length)} types of blocks`), el("p", {}, level.block_names.join(", "))),
      el("details", {}, el("summary", {}, `${formatNumber(level.knobs.length)} knobs, which change the level`),
        table("", ["Knob", "Value", "Range", "What it does"], level.knobs.map(({ name, value, range, help }) => [name, JSON.stringify(value), range, help])))),
  ];
}

/** A drawing from [name, attributes, ...children]. */
const drawn = ([name, attributes, ...children]) => svg(name, attributes, ...children.map((child) => (typeof child === "string" ? child : drawn(child))));
