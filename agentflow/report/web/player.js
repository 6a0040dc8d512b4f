// The film player: it shows a machine in a view, plays its films, and has controls, keys and a timeline.

import { Clock } from "./clock.js";
import { el } from "./dom.js";
import { downloads } from "./downloads.js";
import { Film } from "./film.js";
import { Timeline } from "./timeline.js";
import { Transport, press } from "./transport.js";
import { View } from "./view.js";

const NARROW = 420; // CSS pixels

export class Player {
  /** @param shapes the solids that machines share, by index
   *  @param packed the files of all machines, one after another, deflated */
  constructor(shapes = [], packed = "") {
    this.use(shapes, packed);
    this.clock = new Clock();
    this.timeline = new Timeline((time) => this.seek(time));
    this.transport = new Transport(this, this.timeline.ticks);
    this.byLoad = false;
    this.span = 0; // least length of the slider, seconds
    this.making = []; // buttons that write further files of the machine
    this.element = this.built();
    this.print = () => {
      this.element.dispatchEvent(new CustomEvent("paper"));
      if (!this.film) return;
      const time = this.clock.time || this.scored; // with the whole way to it, unless a moment was chosen
      this.title.dataset.moment = this.film.samples > 1 ? ` · at ${time.toFixed(2)} s` : "";
      document.documentElement.style.setProperty("--printed", JSON.stringify(new Date().toLocaleDateString("en-GB", { dateStyle: "long" })));
      this.view.print(this.paper, this.film, time, this.byLoad, !this.clock.time);
    };
    addEventListener("beforeprint", this.print);
    new ResizeObserver(() => this.fold(this.element.clientWidth <= NARROW)).observe(this.element);
  }

  /** Take the shapes and files of the next machine. */
  use(shapes, packed) {
    this.shapes = shapes;
    this.packed = packed;
  }

  /** Give the memory of the picture back. */
  close() {
    this.pause();
    this.film = null;
    removeEventListener("beforeprint", this.print);
    this.view.close();
  }

  /** Show a machine, or say why there is none, above `still`, a picture of it. Resolves when it is visible. */
  async show(machine, title, remark = "", still = "") {
    this.pause();
    const asked = (this.asked = {});
    this.title.textContent = title;
    this.remark.textContent = machine ? remark : "";
    this.element.classList.toggle("empty", !machine || !this.view.picture);
    if (this.view.picture) this.view.nothing.replaceChildren(still, remark && !machine ? remark : "No machine to show.");
    if (!machine || !this.view.picture) return;
    if (!(await this.load(machine, asked))) return;
    this.choices(machine);
    this.files.replaceChildren("Download: ", ...downloads(machine.files, () => this.packed), ...this.making);
    this.view.eye.reset();
  }

  /** Load one film of a machine; false if another was requested in the meantime. */
  async load(machine, asked) {
    const film = await Film.of(machine.film);
    if (this.asked !== asked) return false;
    this.film = film;
    this.view.show(machine, this.shapes, film);
    const span = (this.clock.duration = Math.max(film.duration, this.span));
    this.scored = Math.min(machine.flag?.time ?? film.duration, film.duration);
    this.transport.setDuration(span);
    this.element.classList.toggle("still", film.samples < 2);
    this.timeline.show(machine, span);
    this.seek(0);
    return true;
  }

  /** Fill the selector of trials, for machines with several films. */
  choices(machine) {
    const { trials } = machine;
    this.trials.parentElement.hidden = !trials.length;
    this.trials.replaceChildren(...trials.map((trial) =>
      el("option", { value: trial.number, selected: trial.shown ? "" : null, disabled: trial.shown || trial.film ? null : "" },
        `${trial.number} of ${trials.length} ${trial.success ? "✓" : "✗"} ${trial.outcome}`)));
    this.chosen = () => {
      this.pause();
      this.load({ ...machine, ...trials[this.trials.selectedIndex] }, (this.asked = {}));
    };
  }

  play() {
    if (!this.film || this.film.samples < 2) return;
    this.clock.start();
    this.label();
    this.ask();
  }

  pause() {
    this.clock.stop();
    this.label();
    this.view.sharpness?.rest();
  }

  toggle() {
    if (this.clock.running) this.pause();
    else this.play();
  }

  label() {
    this.transport.setPlaying(this.clock.running);
    this.element.classList.toggle("playing", this.clock.running);
  }

  seek(time) {
    if (!this.film) return;
    this.clock.seek(time);
    this.ask();
  }

  setSpeed(speed) {
    this.clock.speed = speed;
    this.transport.setSpeed(speed);
  }

  /** Show the moment and the view of another player. */
  follow({ clock, byLoad, view: { eye } }) {
    if (!this.film) return;
    if (Boolean(eye.wide) !== Boolean(this.view.eye.wide)) this.setWide(Boolean(eye.wide));
    if (clock.speed !== this.clock.speed) this.setSpeed(clock.speed);
    if (byLoad !== this.byLoad) this.setLoads(byLoad);
    this.view.eye.take(eye);
    this.seek(clock.time);
  }

  /** Mark blocks, and fade the others; null marks none. */
  setMarked(blocks) {
    this.view.mark(blocks);
    this.ask();
  }

  setLoads(on) {
    this.byLoad = on;
    this.transport.setLoads(on);
    this.element.classList.toggle("loads", on);
    this.ask();
  }

  /** Show the whole course, or follow the action. */
  setWide(on) {
    this.transport.setWide(on);
    this.view.eye.setWide(on);
    this.ask();
  }

  resetView() {
    this.setWide(false);
    this.view.eye.reset();
    this.ask();
  }

  /** Request one frame. */
  ask() {
    this.wanted ??= requestAnimationFrame((now) => {
      this.wanted = null;
      this.step(now);
    });
  }

  step(now) {
    if (!this.film) return;
    if (this.clock.running) this.advance(now);
    this.view.draw(this.film, this.clock.time, this.byLoad);
    this.transport.setTime(this.clock.time);
    this.element.dispatchEvent(new CustomEvent("frame"));
    if (this.clock.running) this.ask();
  }

  /** Where it is narrow, all but the film, its slider and its remark is behind one line that opens. */
  fold(narrow) {
    if (narrow === this.narrow) return;
    this.narrow = narrow;
    this.element.classList.toggle("narrow", narrow);
    this.timeline.fold(narrow);
    if (narrow) return this.timeline.folded.append(this.transport.extras, this.view.under, this.files);
    this.transport.element.append(this.transport.extras);
    this.view.nothing.before(this.view.under);
    return this.timeline.element.before(this.files);
  }

  /** Advance to a frame, and stop at the end. */
  advance(now) {
    const passed = this.clock.advance(now);
    if (passed !== null) this.view.sharpness.note(passed);
    if (this.clock.over) this.pause();
  }

  built() {
    this.title = el("p", { class: "title", "aria-live": "polite" });
    this.trials = el("select", { change: () => this.chosen() });
    this.remark = el("p", { class: "remark" });
    this.files = el("p", { class: "files" });
    this.paper = el("canvas", { class: "paper", role: "img", "aria-label": "The shown machine" });
    this.view = new View([this.title, el("label", { class: "trials", hidden: "" }, "Trial ", this.trials)], () => this.ask());
    return el("div", { class: this.view.picture ? "player" : "player empty", role: "group", "aria-label": "Film", keydown: (event) => press(this, event) },
      this.view.element, this.transport.element, this.timeline.lanes, this.remark, this.files, this.timeline.element, this.paper);
  }
}
