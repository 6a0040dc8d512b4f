// Makes the points of a chart answer: the nearest one says what it is, a click or Enter picks it.

import { el, svg } from "./dom.js";

const NEAR = 40; // pixels within which a point answers to the pointer

/** @param picture the chart
 *  @param places gives [{x, y, text, item}] as they are drawn now, from left to right
 *  @param pick gets the item of a point; null if nothing can be picked
 *  @returns what says what the point is */
export function answering(picture, places, pick) {
  const said = el("span", { class: "answer", "aria-live": "polite" });
  const mark = svg("circle", { class: "answered", r: 5 });
  let at = -1;
  const show = (index) => {
    const found = places();
    at = Math.max(-1, Math.min(index, found.length - 1));
    if (at < 0) mark.remove();
    else picture.append(mark);
    said.textContent = at < 0 ? "" : found[at].text;
    if (at >= 0) Object.entries({ cx: found[at].x, cy: found[at].y }).forEach(([key, value]) => mark.setAttribute(key, value));
  };
  const nearest = ({ clientX, clientY }) => {
    const box = picture.getBoundingClientRect();
    const far = places().map(({ x, y }) => Math.hypot(x - (clientX - box.left), y - (clientY - box.top)));
    const least = Math.min(...far);
    return least <= NEAR ? far.indexOf(least) : -1;
  };
  const choose = () => at >= 0 && pick?.(places()[at].item);
  picture.setAttribute("tabindex", "0");
  picture.addEventListener("pointermove", (event) => show(nearest(event)));
  picture.addEventListener("pointerleave", () => show(-1));
  picture.addEventListener("click", (event) => { show(nearest(event)); choose(); });
  picture.addEventListener("blur", () => show(-1));
  picture.addEventListener("keydown", (event) => {
    const steps = { ArrowRight: at + 1, ArrowLeft: Math.max(0, at - 1), Home: 0, End: Infinity };
    if (event.key in steps) show(steps[event.key]);
    else if (event.key === "Enter") choose();
    else return;
    event.preventDefault();
  });
  return said;
}
