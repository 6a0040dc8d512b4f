// Five steps to a first car, over the view of the Build page. Each is done as soon as the machine shows it;
// until then, only the faces that it means are marked, and the camera turns if none of them is in sight.

import { el, formatNumber } from "../../report/web/dom.js";
import { byKey } from "./api.js";

const [BLOCK, WHEEL] = [1, 2]; // types
const NEAR = 0.1; // m
/** The end of the body that is attached to the Starting Block there. */
const body = ({ blocks }, end) => blocks.find((block) => block.type === BLOCK && block.facing === end && block.parents[0]?.[0] === 0);

/** @param parent gives the id of the block that this step attaches to, if it is there
 *  @param sides where to attach one each */
const step = (type, parent, sides, text) => {
  const belongs = (state, block) => block.type === type && sides.includes(block.facing) && block.parents[0]?.[0] === parent(state);
  const left = (state) => sides.filter((side) => !state.blocks.some((block) => block.facing === side && belongs(state, block)));
  const opposite = (state, [, , z]) => state.blocks.every((block) => !belongs(state, block) || Math.abs(block.position[2] - z) < NEAR); // a straight axle
  return { text, left, type, belongs, done: (state) => !left(state).length, means: (state, { block, facing, position }) => block === parent(state) && left(state).includes(facing) && opposite(state, position) };
};
const bodyStep = (end, text) => step(BLOCK, () => 0, [end], text);
const wheelStep = (end, text) => step(WHEEL, (state) => body(state, end)?.id ?? -1, ["x-", "x+"], text);
const STEPS = [
  bodyStep("z+", "Choose Wooden Block in the list of blocks, then the mark Here on the front (z+) of the Starting Block."),
  bodyStep("z-", "Attach a second Wooden Block to the back (z-), opposite the first: the body is done."),
  wheelStep("z+", "Choose Powered Wheel, then one side of the front block, then the mark opposite."),
  wheelStep("z-", "Put two more wheels on both sides of the back block."),
  { text: `Choose Test${byKey("P")}. Physics decides how far the car drives in 5 s.`, belongs: () => true, done: () => false },
];

/** @param look turns the camera so that it sees faces with one of these directions */
export function carGuide(editor, look) {
  const list = el("ol", {}, ...STEPS.map(({ text }) => el("li", {}, text)));
  const said = el("p", { role: "status" });
  const close = () => {
    element.remove();
    if (!editor.sought) return;
    editor.sought = null;
    editor.tell("spots");
  };
  const element = el("section", { class: "guide", "aria-label": "A first car" }, el("h2", {}, "A first car in five steps"), said, list, el("button", { click: close }, "Close"));
  let score = null;
  let before = -1;
  let count = editor.state.blocks.length;
  const draw = () => {
    const { state } = editor;
    const now = score === null ? STEPS.findIndex(({ done }) => !done(state)) : -1;
    const { type, means, left, belongs } = STEPS[now] ?? {};
    const astray = now >= 0 && now === before && state.blocks.length > count && !belongs(state, editor.block());
    [...list.children].forEach((item, index) => {
      item.className = index === now ? "now" : "";
      item.setAttribute("aria-current", index === now ? "step" : "false");
    });
    said.textContent = now < 0 ? `Your car drove ${formatNumber(score)} m; ${formatNumber(editor.start.good)} m or more is good. Change one thing, and test again.`
      : `Step ${now + 1} of ${STEPS.length}${astray ? ": that is another face. Undo, and try again." : ""}`;
    editor.sought = means ? (spot) => editor.aim?.add === type && means(state, spot) : null;
    if (left && !astray && (now !== before || state.blocks.length > count)) look(left(state));
    if (now > before && before >= 0 && editor.aim && editor.aim.add !== type) editor.aimAt(null);
    [before, count] = [now, state.blocks.length];
  };
  editor.on(["state"], draw);
  editor.addEventListener("event", () => {
    if (editor.event.kind !== "trial" || editor.event.score === null) return;
    score = editor.event.score;
    draw();
  });
  return element;
}
