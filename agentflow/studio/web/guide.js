// Five steps to a first car, over the view of the Build page. Each is done as soon as the machine shows it;
// until then, only the faces that it means are marked, and the camera looks at them.

import { el, formatNumber } from "../../report/web/dom.js";

const [BLOCK, WHEEL] = [1, 2]; // types
const EYE = [0.6, 0.45, 0.66]; // from the machine to the eye, for the left (in the scene, x points there) and the front
/** The end of the body that is attached to the Starting Block there. */
const body = ({ blocks }, end) => blocks.find((block) => block.type === BLOCK && block.facing === end && block.parents[0]?.[0] === 0);

/** @param parent id of the block that this step attaches to, if it is there
 *  @param end of the machine that this step is about, z+ or z-
 *  @param sides where to attach one each */
const step = (type, parent, end, sides, text) => {
  const belongs = (state, block) => block.type === type && sides.includes(block.facing) && block.parents[0]?.[0] === parent(state);
  const left = (state) => sides.filter((side) => !state.blocks.some((block) => block.facing === side && belongs(state, block)));
  const eye = (state) => [left(state).at(-1) === "x-" ? EYE[0] : -EYE[0], EYE[1], end === "z+" ? EYE[2] : -EYE[2]]; // sees a face that is left
  return { text, eye, type, belongs, done: (state) => !left(state).length, means: (state, { block, facing }) => block === parent(state) && left(state).includes(facing) };
};
const bodyStep = (end, text) => step(BLOCK, () => 0, end, [end], text);
const wheelStep = (end, text) => step(WHEEL, (state) => body(state, end)?.id ?? -1, end, ["x-", "x+"], text);
const STEPS = [
  bodyStep("z+", "Choose Wooden Block in the list of blocks, then click the green mark on the front (z+) of the Starting Block."),
  bodyStep("z-", "Attach a second Wooden Block to the back (z-), opposite the first: the body is done."),
  wheelStep("z+", "Choose Powered Wheel and click the left and the right side of the front block."),
  wheelStep("z-", "Put two more wheels on the left and right of the back block."),
  { text: "Choose Test (P). Physics decides how far the car drives in 5 s.", belongs: () => true, done: () => false },
];

/** @param look turns the camera to a direction */
export function carGuide(editor, look) {
  const list = el("ol", {}, ...STEPS.map(({ text }) => el("li", {}, text)));
  const said = el("p", { role: "status" });
  const close = () => {
    editor.sought = null;
    element.remove();
    editor.tell("spots");
  };
  const element = el("section", { class: "guide", "aria-label": "A first car" }, el("h2", {}, "A first car in five steps"), said, list, el("button", { click: close }, "Close"));
  let score = null;
  let before = -1;
  let count = editor.state.blocks.length;
  const draw = () => {
    const { state } = editor;
    const now = score === null ? STEPS.findIndex(({ done }) => !done(state)) : -1;
    const { type, means, eye, belongs } = STEPS[now] ?? {};
    const astray = now >= 0 && now === before && state.blocks.length > count && !belongs(state, editor.block());
    [...list.children].forEach((item, index) => {
      item.className = index === now ? "now" : "";
      item.setAttribute("aria-current", index === now ? "step" : "false");
    });
    said.textContent = now < 0 ? `Your car drove ${formatNumber(score)} m; ${formatNumber(editor.start.good)} m or more is good. Change one thing, and test again.`
      : `Step ${now + 1} of ${STEPS.length}${astray ? ": that is another face. Undo, and try again." : ""}`;
    editor.sought = means ? (spot) => editor.aim?.add === type && means(state, spot) : null;
    if (eye && !astray && (now !== before || state.blocks.length > count)) look(eye(state));
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
