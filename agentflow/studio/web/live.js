// The page of one run, in the report's view, while it grows.

import { scoreChart } from "../../report/web/charts.js";
import { el, formatNumber, section } from "../../report/web/dom.js";
import { RunView } from "../../report/web/run.js";
import { address, ask, follow, send } from "./api.js";

const PAUSE = 1500; // least milliseconds between two readings of the record

export async function livePage({ run }) {
  const films = new Map();
  const film = (machine) => {
    if (!films.has(machine)) films.set(machine, ask("/api/machine", { run, machine }));
    films.get(machine).catch(() => films.delete(machine));
    return films.get(machine);
  };
  const view = new RunView(film, ({ machine }) => (machine ? [
    el("a", { class: "button", href: address("build", { run, machine }) }, "Edit in Build"),
  ] : []));
  const live = new Live(run);
  view.main.prepend(live.element);
  view.update(await ask("/api/run", { run }));
  view.top.after(live.chart);
  let reading = null;
  const read = () => (reading ??= new Promise((done) => setTimeout(done, PAUSE)).then(async () => {
    reading = null;
    view.update(await ask("/api/run", { run }));
  }).catch((error) => live.fail(error)));
  let first = true;
  const stop = follow({ run }, (news) => {
    live.hear(news);
    if (!first || news.state !== "done") read();
    first = false;
  });
  return {
    elements: [el("aside", {}, view.player.element), view.main],
    close: () => { stop(); view.player.close(); },
  };
}

/** State, score over time, and the button that stops a design of this studio. */
class Live {
  constructor(run) {
    this.run = run;
    this.points = [];
    this.state = el("span", { class: "state" });
    this.best = el("b", {});
    this.stop = el("button", { hidden: "", click: () => this.end() }, "Stop");
    this.told = el("p", { class: "problem", role: "alert" });
    this.element = el("div", { class: "live" }, el("p", { role: "status" }, this.state, " ", this.best, " ", this.stop), this.told);
    this.chart = el("div", {});
    this.learn();
  }

  /** Ask whether this studio has started the run. */
  async learn() {
    const own = (await ask("/api/designs")).find(({ run }) => run === this.run);
    this.stop.hidden = !own?.running;
    if (own?.problem) this.told.textContent = own.problem;
  }

  hear({ state, points, best, calls, problem }) {
    if (problem) return this.fail(new Error(problem));
    this.points.push(...points);
    this.state.textContent = state;
    this.state.className = `state ${state}`;
    this.best.textContent = best === null ? `${calls} calls, no score yet` : `best ${formatNumber(best)} after ${calls} calls`;
    if (state !== "running") this.learn();
    const finished = state === "done";
    this.element.classList.toggle("over", finished);
    if (this.points.length) this.chart.replaceChildren(section("Score over time", scoreChart("Best score so far, and every score", "seconds", this.points.map(({ at, score }) => [at, score]))));
    return null;
  }

  fail(error) {
    this.told.textContent = error.message;
  }

  async end() {
    this.stop.disabled = true;
    this.stop.textContent = "Stopping …";
    try {
      await send("/api/designs/stop", { run: this.run });
      this.stop.hidden = true;
    } catch (error) {
      this.fail(error);
    }
  }
}
