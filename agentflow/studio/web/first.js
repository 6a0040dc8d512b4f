// What a list without runs offers instead: a demo, a first machine by hand, an example.

import { el } from "../../report/web/dom.js";
import { address, send } from "./api.js";

const DEMO = { task: "throwing", workflow: "hierarchical", trajectories: 2, model: "procedural" };

/** Links to a guided first machine and to an example. */
export const links = () => [el("a", { href: address("build", { task: "movement", guide: "car" }) }, "Build a car in five steps"), " or ", el("a", { href: address("build", { example: "catapult" }) }, "open an example"), "."];

export function firstVisit() {
  const told = el("p", { class: "problem", role: "alert" });
  const demo = el("button", { class: "play", click: async () => {
    demo.disabled = true;
    demo.textContent = "Starting …";
    try {
      const { run } = await send("/api/designs", DEMO);
      location.hash = address("run", { run });
    } catch (error) {
      told.textContent = error.message;
      demo.disabled = false;
    }
  } }, "Run the demo");
  const offer = (title, words, action) => el("li", {}, el("h2", {}, title), el("p", {}, words), action);
  return el("section", { class: "first", "aria-label": "First steps" },
    el("p", { class: "lede" }, "There are no runs here yet. A run is one attempt to design a machine: what was asked, every machine that was tried, and what physics made of it. Begin with one of these:"),
    el("ol", {},
      offer("Watch a design", "Rules and random choices design a catapult, in a minute or two. No model and no key is needed. You see each machine as it is tried.", demo),
      offer("Build a car yourself", "Five guided steps: put blocks together, test the car, and see how far it drives.", el("a", { class: "button", href: address("build", { task: "movement", guide: "car" }) }, "Build a car")),
      offer("Open an example", "A small catapult, block by block. Take it apart, change it, and test how far it throws.", el("a", { class: "button", href: address("build", { example: "catapult" }) }, "Open the example"))),
    told);
}
