// Tests of the machine: the film with loads and breaks, and a strip of all trials with their scores.

import { el, formatNumber, withUnit } from "../../report/web/dom.js";
import { Player } from "../../report/web/player.js";
import { address, byKey, send } from "./api.js";

const signed = (change) => `${change < 0 ? "−" : "+"}${formatNumber(Math.abs(change))}`;

export class Trials {
  constructor(editor, showFilm) {
    this.editor = editor;
    this.showFilm = showFilm;
    this.films = new Map();
    this.list = [];
    this.name = ""; // of the run that the tests are recorded in; the first one begins it
    this.player = new Player();
    this.strip = el("ol", { class: "strip", "aria-label": "Tests" });
    this.run = el("p", { class: "quiet" });
    this.element = el("section", { class: "trials-strip" }, this.strip, this.run);
    this.draw();
  }

  /** Simulate the machine as it is now, and play its film. */
  async test() {
    const { editor } = this;
    await editor.working;
    if (!(await editor.settle())) return null;
    const { state, given } = editor;
    if (!state.valid) return editor.say(state.problems[0]?.message ?? "The machine is not complete.", true);
    editor.say("Simulating …");
    const trial = { number: this.list.length + 1, state, score: null, status: "running" };
    this.list.push(trial);
    this.draw();
    this.film(state, given);
    const begun = performance.now();
    try {
      const found = await send("/api/build/test", { ...given, run: this.name });
      Object.assign(trial, found);
      const ended = this.name && this.name !== found.run ? " The earlier run has ended, so this test began another one." : "";
      this.name = found.run;
      editor.tellTrial({ machine: given.machine, seconds: (performance.now() - begun) / 1000, score: found.score, status: found.status, run: found.run });
      editor.say(`Test ${trial.number}: ${this.told(trial)}${ended}`);
    } catch (error) {
      trial.status = "failed";
      editor.say(error.message, true);
    }
    this.draw();
    editor.tell("trials");
    return this.open(trial, false);
  }

  /** The best score; null without one. */
  get best() {
    return this.list.reduce((best, { score }) => (score !== null && score > (best ?? -Infinity) ? score : best), null);
  }

  /** What a draft keeps. */
  get kept() {
    const bare = ({ state: { machine, count, digest }, ...trial }) => ({ ...trial, state: { machine, count, digest } });
    return { trials: this.list.map(bare), run: this.name, best: this.best };
  }

  /** Take over what a draft has kept. */
  resume({ trials, run }) {
    this.list = trials.map((trial) => (trial.status === "running" ? { ...trial, status: "interrupted" } : trial));
    this.name = run;
    this.draw();
  }

  /** Score with unit, change, share, and what the simulation tells first about its cause. */
  told({ number, score, status, feedback }) {
    if (score === null) return `${status}. ${feedback.split("\n")[0]}`;
    const cause = (feedback.split("\n")[1] ?? "").replace(/^Root:/, "Starting Block:");
    const before = this.list.findLast((other) => other.number < number && other.score !== null);
    const { record, good } = this.editor.start;
    const [share, of] = record?.full > 0 ? [score / record.full, `the ${record.of}`] : [score / good, "a good score"];
    return [`score ${withUnit(score, this.editor.start.unit)}`, ...(before ? [`${signed(score - before.score)} on test ${before.number}`] : []), `${formatNumber(Math.round(100 * share))} % of ${of}`].join(", ") + `. ${cause}`;
  }

  film(state, given) {
    if (!this.films.has(state.digest)) {
      const coming = send("/api/build/film", given);
      this.films.set(state.digest, coming);
      coming.catch(() => this.films.delete(state.digest));
    }
    return this.films.get(state.digest);
  }

  /** Play the film of a trial; its machine is what is built on, if that is wanted. */
  async open(trial, build = true) {
    const { editor } = this;
    if (build && editor.state.digest !== trial.state.digest) await editor.queue(async () => editor.take(await editor.whole(trial.state), "open", 0));
    this.shown = trial;
    this.draw();
    try {
      const { machine, shapes, files } = await this.film(trial.state, { task: editor.task, machine: trial.state.machine });
      if (this.shown !== trial) return;
      if (editor.state.digest === trial.state.digest) this.showFilm();
      editor.record("watch");
      this.player.use(shapes, files);
      await this.player.show(machine, `Test ${trial.number}`, machine.remark);
      this.player.play();
    } catch (error) {
      editor.say(error.message, true);
    }
  }

  draw() {
    const { best } = this;
    this.strip.replaceChildren(...this.list.map((trial) => el("li", {}, el("button", {
      "aria-current": trial === this.shown ? "true" : null, class: trial.score === best && this.list.length > 1 ? "best" : null, title: trial.feedback, click: () => this.open(trial),
    }, el("small", {}, `#${trial.number} · ${trial.state.count} blocks`), el("span", {}, el("b", {}, trial.score === null ? trial.status : withUnit(trial.score, this.editor.start.unit)))))));
    this.run.replaceChildren(...(this.name ? ["Recorded in ", el("a", { href: address("run", { run: this.name }) }, this.name), " ", el("button", { title: "Complete the run with its best machine as the result; the next test begins another run", click: () => this.finish() }, "Finish this run")]
      : this.ended ? ["Complete: ", el("a", { href: address("run", { run: this.ended }) }, this.ended), ". The next test begins another run."]
      : [`Choose Test${byKey("P")} to simulate this machine. Each test stays here, and in a run of the list.`]));
  }

  /** Complete the run; the next test begins another one. */
  async finish() {
    try {
      const { run, score } = await send("/api/build/finish", { run: this.name });
      this.name = "";
      this.ended = run;
      this.draw();
      this.editor.tell("trials");
      this.editor.say(`${run} is complete${score === null ? "" : `: its best score is ${withUnit(score, this.editor.start.unit)}`}.`);
    } catch (error) {
      this.editor.say(error.message, true);
    }
  }
}
