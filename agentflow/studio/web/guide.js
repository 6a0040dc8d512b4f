// Five steps to a first car, over the view of the Build page. Each is done as soon as the machine shows it.

import { el, formatNumber } from "../../report/web/dom.js";

const [BLOCK, WHEEL] = [1, 2]; // types
const count = ({ blocks }, type) => blocks.filter((block) => block.type === type).length;

const STEPS = [
  { text: "Choose Wooden Block in the list of blocks, then click the green front face (z+) of the Starting Block.", done: (state) => count(state, BLOCK) >= 1 },
  { text: "Attach a second Wooden Block to the back (z-), opposite the first: the body is done.", done: (state) => count(state, BLOCK) >= 2 },
  { text: "Choose Powered Wheel and click the left and the right side of the front block.", done: (state) => count(state, WHEEL) >= 2 },
  { text: "Put two more wheels on the left and right of the back block.", done: (state) => count(state, WHEEL) >= 4 },
  { text: "Choose Test (P). Physics decides how far the car drives in 5 s.", done: (_state, score) => score !== null },
];

export function carGuide(editor) {
  const list = el("ol", {}, ...STEPS.map(({ text }) => el("li", {}, text)));
  const said = el("p", { role: "status" });
  const close = el("button", { click: () => element.remove() }, "Close");
  const element = el("section", { class: "guide", "aria-label": "A first car" }, el("h2", {}, "A first car in five steps"), said, list, close);
  let score = null;
  const draw = () => {
    const now = STEPS.findIndex(({ done }) => !done(editor.state, score));
    [...list.children].forEach((item, index) => {
      item.className = index === now ? "now" : "";
      item.setAttribute("aria-current", index === now ? "step" : "false");
    });
    said.textContent = now < 0 ? `Your car drove ${formatNumber(score)} m. Undo, change one thing, and test again.` : `Step ${now + 1} of ${STEPS.length}`;
  };
  editor.on(["state"], draw);
  editor.addEventListener("event", () => {
    if (editor.event.kind !== "trial" || editor.event.score === null) return;
    score = editor.event.score;
    draw();
  });
  return element;
}
