// Beside the 3D view: blocks to choose from, faces that fit, the tree, problems, size and balance.

import { el, formatNumber } from "../../report/web/dom.js";
import { byKey } from "./api.js";
import { Listbox } from "./listbox.js";

const NARROW = 600; // CSS pixels of a phone, where the list of faces is far below what was chosen
const GROUPS = ["Structure", "Wheel", "Powered joint", "Joint", "Payload", "Weight", "Elastic connector", "Support"]; // what comes first; others follow

/** The blocks of the task, found by typing. */
export function blockPalette(editor) {
  const rank = ({ category }) => (GROUPS.indexOf(category) + 1 || GROUPS.length + 1);
  const kinds = [...editor.library].sort((a, b) => rank(a) - rank(b));
  const list = new Listbox("Blocks", ({ type, name, picture, required, category }) => {
    const there = editor.state.blocks.filter((block) => block.type === type).length;
    return { text: el("span", { class: "block-kind" }, el("img", { src: picture, alt: "", width: 28, height: 28 }), el("span", {}, el("span", { class: "kind-id" }, `${type} `), name, required ? el("small", {}, ` ${there} of ${required}`) : null)), key: type, disabled: there === required, group: category };
  }, { active: card, pick: aim });
  const about = el("div", { class: "about-block", "aria-live": "polite" });
  const words = el("input", { type: "search", placeholder: `Find a block${byKey("B")}`, "aria-label": "Find a block", input: () => draw(), keydown: (event) => {
    if (event.key === "Enter" && list.items.length) aim((list.items[list.at] ?? list.items[0]).item);
    else if (event.key === "ArrowDown" || event.key === "ArrowUp") list.move(list.at + (event.key === "ArrowDown" ? 1 : -1));
    else return;
    event.preventDefault();
  } });
  const fits = ({ type, name, category }) => words.value.toLowerCase().split(/\s+/).every((word) => `${type} ${name} ${category}`.toLowerCase().includes(word));

  function card({ name, does, mass, size, strength: [force, moment] }) {
    about.replaceChildren(el("b", {}, name), el("p", {}, `${does[0].toUpperCase()}${does.slice(1)}.`),
      el("p", { class: "quiet" }, `${formatNumber(mass)} kg${size ? ` · ${size.map((side) => formatNumber(side, 1)).join(" × ")} m` : ""} · breaks off at ${formatNumber(force)} N or ${formatNumber(moment)} N m`));
  }
  function draw() {
    list.set(kinds.filter(fits));
    if (words.value && list.items.length) list.mark(0);
  }
  function aim(kind) {
    words.value = "";
    draw();
    list.mark(list.items.findIndex(({ key }) => key === kind.type));
    card(kind);
    editor.aimAt({ add: kind.type }).then(() => document.querySelector("#faces .list")?.focus({ preventScroll: innerWidth <= NARROW }));
  }
  draw();
  if (kinds.some(({ required }) => required)) editor.addEventListener("state", draw); // for their numbers
  return { element: el("section", { class: "palette", "aria-label": "Blocks" }, words, list.element, about), focus: () => { words.focus(); words.select(); } };
}

/** The faces of what was aimed at: those that fit first. */
export function faceList(editor) {
  const list = new Listbox("Faces", (spot) => ({
    text: `${spot.block}.${spot.face} ${spot.name}, ${spot.facing}${spot.why_not ? " – does not fit" : ""}`, disabled: Boolean(spot.why_not), key: `${spot.block}.${spot.face}`,
  }), { active: (spot) => editor.point(spot), pick: (spot) => editor.pick(spot) });
  list.element.addEventListener("focus", () => list.at < 0 && list.move(0)); // so that Enter chooses what is shown
  const title = el("h2", {}, "Faces");
  editor.on(["spots"], () => {
    list.set([...editor.spots].sort((a, b) => Boolean(a.why_not) - Boolean(b.why_not)));
    const { add, first, move, copy_of: copied } = editor.aim ?? {};
    const kind = editor.library.find(({ type }) => type === add);
    title.textContent = move !== undefined ? `Move block ${move} to` : copied !== undefined ? `Copy block ${copied} to` : kind ? `${kind.name}${first ? ", second end" : kind.two_ended ? ", first end" : ""} on` : "Faces";
  });
  const hint = el("p", { class: "quiet" }, "Choose a block; the faces where it fits light up.");
  editor.on(["spots"], () => (hint.hidden = Boolean(editor.aim)));
  return el("section", { id: "faces" }, title, hint, list.element);
}

/** The tree of blocks. */
export function blockTree(editor) {
  const list = new Listbox("Tree", ({ id, name, facing, parents, depth, given }) => ({
    text: `${id} ${name}${facing ? ` ${facing}` : ` to ${parents[1]?.[0]}`}${given ? " (given)" : ""}`, level: depth, key: id,
  }), { active: ({ id }) => editor.choose(id) }, "tree");
  editor.on(["state"], () => list.set(inOrder(editor.state.blocks), editor.chosen));
  editor.on(["choice"], () => list.mark(list.items.findIndex(({ key }) => key === editor.chosen)));
  return el("section", { class: "blocks" }, el("h2", {}, "Tree"), list.element);
}

/** Every block behind its parent, with its depth. */
function inOrder(blocks) {
  const below = new Map();
  for (const block of blocks) {
    const parent = block.parents[0]?.[0] ?? -1;
    below.set(parent, [...(below.get(parent) ?? []), block]);
  }
  const walk = (parent, depth) => (below.get(parent) ?? []).flatMap((block) => [{ ...block, depth }, ...walk(block.id, depth + 1)]);
  return walk(-1, 1);
}

/** What can be done about a problem: see its blocks, and move the last of them, or look for what is missing. */
function remedies(editor, { code, blocks, message }, bad) {
  const button = (text, title, click) => el("button", { title, click }, text);
  const missing = code === "required_count" && editor.library.find(({ type, required }) => required > blocks.length && message.includes(`type ${type} (`));
  return [
    blocks.length ? button("Show", "Mark these blocks", () => editor.choose(blocks.at(-1), blocks)) : null,
    bad && blocks.length > 1 ? button("Fix", `Move block ${blocks.at(-1)} to a free face`, () => editor.edit("fix", { block: blocks.at(-1) })) : null,
    missing ? button("Fix", `Choose a face for a ${missing.name}`, () => editor.aimAt({ add: missing.type })) : null,
  ].filter(Boolean).flatMap((each) => [" ", each]);
}

/** Problems, size, mass and balance. */
export function facts(editor) {
  const element = el("section", { class: "facts-panel" });
  editor.on(["state"], () => {
    const { start, state } = editor;
    const { problems, size, mass, centre, stands, count, most, support, machine } = state;
    const warnings = [...state.warnings, ...(start.designed && Array.isArray(machine) ? [{ message: `No control yet: Example, in Control, writes one. ${start.scene.find((line) => line.startsWith("Without control"))}`, blocks: [] }] : [])];
    const rows = [
      ["Blocks", most === null ? `${count}` : `${count} of ${most}`], ["Size", `${size.map((side) => formatNumber(side)).join(" × ")} m`], ["Mass", `${formatNumber(mass)} kg`],
      ["Centre of mass, the ball", `${centre.map((part) => formatNumber(part)).join(", ")} m`],
      ["Support", `${support.length > 2 ? `${support.length} corners` : support.length === 2 ? "a line" : "a point"}, ${stands ? "stands" : "tips over"}`],
    ];
    element.replaceChildren(
      el("h2", {}, "Problems"),
      problems.length + warnings.length ? el("ul", { class: "problems" }, ...[...problems, ...warnings].map((item) =>
        el("li", { class: problems.includes(item) ? "bad" : "warned" }, item.message, ...remedies(editor, item, problems.includes(item)))))
        : el("p", { class: "quiet" }, "None: ready to test."),
      el("h2", {}, "Balance"),
      el("dl", { class: "facts" }, ...rows.flatMap(([name, value]) => [el("dt", {}, name), el("dd", {}, value)])));
  });
  return element;
}
