// The page of a run: the film, and how the machine in it was found.

import { el, section, withUnit } from "./dom.js";
import { unpackJson } from "./film.js";
import { kindsSection } from "./kinds.js";
import { Player } from "./player.js";
import { frontSection, robustnessSection } from "./robustness.js";
import { conversations, failures, header, legend, makersSection, scoreCharts, settings, stages, tools, usage } from "./sections.js";
import { STATUS, callDetails, explain, plain, problem } from "./text.js";
import { Tree } from "./tree.js";
import { PAGE } from "./view.js";

export function runPage(data) {
  const shown = new RunView((digest) => data.machines[digest] && { machine: data.machines[digest], shapes: data.shapes, files: data.files });
  shown.update(data);
  const bare = !Object.keys(data.machines).length; // without films, the text takes the whole page
  shown.main.classList.toggle("alone", bare);
  return [bare ? "" : el("aside", {}, shown.player.element), shown.main];
}

/** A run in two parts, `player` and `main`; it may grow. */
export class RunView {
  /** @param film gives {machine, shapes, files} of a machine by content hash, or a promise of it
   *  @param actions makes elements for what can be done with the machine of a node
   *  @param still makes a picture of a machine, shown until its film is there */
  constructor(film, actions = () => [], still = () => "") {
    this.film = film;
    this.still = still;
    this.actions = actions;
    this.player = new Player();
    this.chosen = el("section", { class: "chosen", "aria-label": "Selected machine" });
    this.parts = new Map();
    this.axis = {}; // of the chart of scores
    this.following = false; // whether the best machine is shown as soon as there is a better one
    this.growing = false; // whether the run goes on: then the film of a better machine plays
    this.whole = false; // whether a tree that is higher than its box is shown whole
    this.level = ""; // a picture of it, shown until there is a machine
    this.picking = () => {}; // called when somebody picks a machine
    this.top = el("div", {});
    this.rest = el("div", {});
    this.main = el("main", {}, this.top, this.chosen, this.rest);
    this.player.element.addEventListener("paper", () => {
      this.tree.draw(PAGE[0]);
      addEventListener("afterprint", () => this.tree.draw(), { once: true });
    });
  }

  /** Show the data as they are now. What has not changed stays; so does a part that is being read. */
  update(data) {
    this.data = data;
    this.calls = once(() => readCalls(data.calls));
    const first = data.nodes.find((node) => node.best) ?? data.nodes.at(-1);
    this.put("header", [data.run, data.task, data.failures], this.top, () => header(data, (machine) => this.pick(machine)));
    this.put("search", data.nodes, this.rest, () => this.search());
    this.put("kinds", [data.archive, data.classes], this.rest, () => kindsSection(data, (machine) => this.pick(machine)));
    this.put("makers", data.makers, this.rest, () => makersSection(data.makers));
    this.put("front", data.front, this.rest, () => frontSection(data.front, (machine) => this.pick(machine)));
    this.put("robustness", data.robustness, this.rest, () => robustnessSection(data.robustness, data.task.unit));
    this.put("score", [data.progress, data.run.passed], this.rest, () => scoreCharts(data, this.axis, (machine) => this.pick(machine)));
    const begun = first || !this.growing; // before, these are tables of zeros
    this.put("stages", [begun, data.stages, data.run.passed], this.rest, () => begun && stages(data));
    this.put("tools", [data.stages, data.tools], this.rest, () => tools(data));
    this.put("failures", [begun, data.validity, data.reasons, data.failures], this.rest, () => begun && failures(data));
    this.put("usage", [begun, data.usage], this.rest, () => begun && usage(data));
    this.put("talk", data.calls, this.rest, () => conversations(data, this.calls));
    this.put("facts", data.facts, this.rest, () => settings(data));
    if (!first) this.player.show(null, "", ...(this.growing ? ["The level. The first machine appears here when it has been simulated.", this.level] : []));
    else if (!this.picked || (this.following && this.picked !== first.id)) {
      this.tree.select(first.id);
      this.show(first, true);
    }
  }

  put(name, key, place, make) {
    const text = JSON.stringify(key);
    const before = this.parts.get(name);
    if (before?.text === text || before?.element.querySelector("details[open]:not(.task)")) return;
    const element = explain(el("div", {}, make() || ""));
    if (before?.element.querySelector(".task[open]")) element.querySelector(".task").open = true;
    if (before) before.element.replaceWith(element);
    else place.append(element);
    this.parts.set(name, { text, element });
  }

  search() {
    this.tree = new Tree(this.data.nodes, (node) => this.choose(node));
    if (this.picked) this.tree.select(this.picked);
    if (this.data.nodes.length < 2) return null;
    const box = el("div", { class: this.whole ? "" : "tall" }, this.tree.element);
    const whole = el("button", { hidden: "", click: () => { this.whole = true; box.classList.remove("tall"); whole.hidden = true; } }, "Show the whole tree");
    new ResizeObserver(() => (whole.hidden = box.scrollHeight <= box.clientHeight)).observe(this.tree.element);
    return section("Search", box, whole, legend());
  }

  /** Show a machine by content hash. */
  pick(machine) {
    const node = this.data.nodes.find((item) => item.machine === machine);
    if (!node) return;
    this.tree.select(node.id);
    this.choose(node);
  }

  /** Show a machine of the tree that somebody has picked. */
  choose(node) {
    this.picking();
    return this.show(node);
  }

  /** @param calm whether the machine before stays until this one's film is there */
  async show(node, calm = false) {
    this.picked = node.id;
    const title = heading(node, this.data.task.unit);
    const coming = node.machine && this.film(node.machine);
    if (coming instanceof Promise && !(calm && this.player.film)) {
      this.player.show(null, title, this.growing ? "Simulating …" : "Simulating again, for the film …", this.still(node.machine));
      describe(this.chosen, node, title, null, this.calls, this.actions(node));
    }
    let found = null;
    let fault = "";
    try {
      found = await coming;
    } catch (error) {
      fault = error.message;
    }
    if (this.picked !== node.id) return;
    this.machine = node.machine;
    if (found) this.player.use(found.shapes, found.files);
    this.player.show(found?.machine, title, fault || (found?.machine.remark ?? "")).then(() => this.growing && this.following && !matchMedia("(prefers-reduced-motion)").matches && this.player.play());
    describe(this.chosen, node, title, found?.machine, this.calls, this.actions(node));
  }
}

const heading = (node, unit) => (node.score === null ? node.title : `${node.title} · ${withUnit(node.score, unit)}`);

/** Describe the selected machine: score, edit, feedback, and the calls that produced it. */
async function describe(place, node, title, machine, calls, actions) {
  const talk = el("div", {}, node.calls.length ? el("p", { class: "quiet" }, "Loading calls …") : "");
  place.replaceChildren(
    el("h2", {}, title),
    el("p", { class: "quiet" }, [STATUS[node.status] ?? node.status, node.broken && "broke", machine && `${machine.solids.length} blocks`, node.machine && `hash ${node.machine}`].filter(Boolean).join(" · ")),
    actions.length ? el("p", { class: "actions" }, ...actions) : "",
    node.problem ? problem(node.problem) : "",
    node.edit ? el("div", { class: "edit" }, el("h3", {}, "Edit"), plain(node.told), node.told === node.edit ? null : el("details", {}, el("summary", {}, "As commands"), plain(node.edit))) : "",
    machine?.feedback ? el("details", { class: "printed" }, el("summary", {}, "Simulation feedback"), plain(machine.feedback)) : "",
    talk);
  explain(place);
  const known = node.calls.length ? await calls() : new Map();
  talk.replaceChildren(...node.calls.filter((label) => known.has(label)).map((label) => callDetails(known.get(label))));
}

/** Calls by label, with message texts in place of their indices. */
async function readCalls(packed) {
  const { texts, calls } = await unpackJson(packed);
  return new Map(calls.map((entry) => [entry.label, {
    ...entry,
    messages: entry.messages.map(([role, index]) => ({ role, text: texts[index] })),
  }]));
}

function once(make) {
  let made = null;
  return () => (made ??= make());
}
