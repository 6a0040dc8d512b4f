// The film player: controls, keys and the timeline of events. scene.js does the drawing.

import { el } from "./dom.js";
import { Eye } from "./camera.js";
import { Film, inflate } from "./film.js";
import { traceColor } from "./materials.js";
import { Picture } from "./scene.js";

const SPEEDS = [0.1, 0.25, 0.5, 1, 2];
const STEP = 1 / 30; // seconds per press of an arrow key
const TURN = 0.12; // radians per press
const SLOW = 32; // milliseconds per frame above which the resolution is reduced
const COARSEST = 0.4; // lowest resolution, as a share of the canvas

export class Player {
  /** @param shapes the solids that machines share, by index
   *  @param packed the files of all machines, one after another, deflated */
  constructor(shapes, packed) {
    this.shapes = shapes;
    this.packed = packed;
    this.time = 0;
    this.speed = 1;
    this.playing = this.byLoad = false;
    this.element = this.built();
    this.open();
  }

  /** Show a machine, or say why there is none. Resolves when it is visible. */
  async show(machine, title, remark = "") {
    this.pause();
    const asked = (this.asked = {});
    this.element.querySelector(".title").textContent = title;
    this.element.querySelector(".remark").textContent = remark;
    this.element.classList.toggle("empty", !machine || !this.picture);
    if (!machine || !this.picture) return;
    if (!(await this.load(machine, asked))) return;
    this.choices(machine);
    this.offer(machine.files);
    this.eye.reset();
  }

  /** Load one film of a machine; false if another was requested in the meantime. */
  async load(machine, asked) {
    const film = await Film.of(machine.film);
    if (this.asked !== asked) return false;
    this.film = film;
    this.machine = machine;
    this.picture.show(machine, this.shapes, film);
    this.eye.begin(film, machine, this.shapes);
    this.slider.max = film.duration;
    this.element.classList.toggle("still", film.samples < 2);
    this.mark();
    this.key();
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

  /** Offer the machine's files for download: name -> where its content begins and ends. */
  offer(files) {
    const buttons = Object.entries(files).map(([name, place]) =>
      el("button", { title: name, click: async () => save(name, (await inflate(this.packed)).slice(...place)) }, name.slice(name.lastIndexOf("."))));
    this.files.replaceChildren("Download this machine: ", ...buttons);
  }

  /** Show the legend of colours. */
  key() {
    const { traces, given, wind } = this.machine;
    const moved = traces.map(({ name }, index) => this.picture.traces[index].moved && entry("dots", traceColor(index), name));
    const dots = moved.filter(Boolean);
    const blocks = given.map(([name, color]) => entry("block", color, name));
    this.keys.replaceChildren(...blocks, ...dots, ...(wind ? [el("span", {}, `wind: ${wind}`)] : []));
  }

  play() {
    if (!this.film || this.film.samples < 2) return;
    if (this.time >= this.film.duration) this.time = 0;
    this.playing = true;
    this.last = this.pace = null;
    this.label();
    this.ask();
  }

  pause() {
    this.playing = false;
    this.label();
    this.sharpen(1);
  }

  toggle() {
    if (this.playing) this.pause();
    else this.play();
  }

  seek(time) {
    if (!this.film) return;
    this.time = Math.min(Math.max(time, 0), this.film.duration);
    this.ask();
  }

  setSpeed(speed) {
    this.speed = speed;
    this.chooser.value = speed;
  }

  setLoads(on) {
    this.byLoad = on;
    this.loads.setAttribute("aria-pressed", on);
    this.element.classList.toggle("loads", on);
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
    if (this.playing) {
      if (this.last !== null) this.advance(now - this.last);
      this.last = now;
      if (this.time >= this.film.duration) {
        this.time = this.film.duration;
        this.pause();
      }
    }
    this.eye.at(this.time);
    this.picture.pose(this.film, this.time, this.byLoad, this.eye.controls.target);
    this.picture.draw();
    this.slider.value = this.time;
    this.clock.textContent = `${this.time.toFixed(2)} s`;
    this.slider.setAttribute("aria-valuetext", `${this.time.toFixed(2)} seconds`);
    this.element.dispatchEvent(new CustomEvent("frame"));
    if (this.playing) this.ask();
  }

  /** Advance by some milliseconds; reduce the resolution if frames are slow. */
  advance(passed) {
    this.time += (this.speed * passed) / 1000;
    this.pace = this.pace === null ? SLOW / 2 : 0.85 * this.pace + 0.15 * passed;
    if (this.pace > SLOW && this.share > COARSEST) {
      this.sharpen(0.8 * this.share);
      this.pace = SLOW / 2;
    }
  }

  /** Set the resolution, as a share of the canvas's width and height. */
  sharpen(share) {
    if (!this.picture || share === this.share) return;
    const { clientWidth, clientHeight } = this.canvas;
    if (!clientWidth || !clientHeight) return;
    this.share = share;
    this.picture.resize(clientWidth, clientHeight, share);
    this.ask();
  }

  /** Show the events of this film along the slider and as a list. */
  mark() {
    const events = this.machine.events;
    const share = (time) => `${(100 * Math.max(time, 0)) / (this.film.duration || 1)}%`;
    this.ticks.replaceChildren(
      ...events.map((event) => {
        const tick = el("i", { class: event.kind, title: event.text });
        tick.style.left = share(event.time);
        return tick;
      }),
    );
    this.list.replaceChildren(
      ...events.map((event) =>
        el("li", {}, el("button", { class: event.kind, click: () => this.seek(event.time) },
          el("span", {}, event.time < 0 ? "settling" : `${event.time.toFixed(2)} s`), ` ${event.text}`)),
      ),
    );
  }

  label() {
    this.button.textContent = this.playing ? "Pause" : "Play";
    this.element.classList.toggle("playing", this.playing);
  }

  press(event) {
    const name = event.target.tagName;
    if (event.altKey || event.ctrlKey || event.metaKey || name === "SELECT") return;
    const own = event.target === this.canvas;
    const act = {
      " ": () => this.toggle(),
      ",": () => this.setSpeed(SPEEDS[Math.max(SPEEDS.indexOf(this.speed) - 1, 0)]),
      ".": () => this.setSpeed(SPEEDS[Math.min(SPEEDS.indexOf(this.speed) + 1, SPEEDS.length - 1)]),
      l: () => this.setLoads(!this.byLoad),
      w: () => this.setWide(!this.eye.wide),
      r: () => this.again(),
      Home: () => this.seek(0),
      End: () => this.seek(this.film.duration),
      ArrowLeft: () => this.seek(this.time - STEP),
      ArrowRight: () => this.seek(this.time + STEP),
      ArrowUp: own && (() => this.eye.turn(0, TURN)),
      ArrowDown: own && (() => this.eye.turn(0, -TURN)),
      a: own && (() => this.eye.turn(-TURN, 0)),
      d: own && (() => this.eye.turn(TURN, 0)),
      "+": own && (() => this.eye.turn(0, 0, 0.9)),
      "-": own && (() => this.eye.turn(0, 0, 1.1)),
    }[event.key];
    if (!act || (name === "BUTTON" && event.key === " ")) return;
    event.preventDefault();
    if (this.film) act();
  }

  /** Show the whole course, or follow the action. */
  setWide(on) {
    this.wide.setAttribute("aria-pressed", on);
    this.eye.setWide(on);
    this.ask();
  }

  again() {
    this.setWide(false);
    this.eye.reset();
    this.ask();
  }

  built() {
    this.canvas = el("canvas", { tabindex: "0", role: "img", "aria-label": "3D view; space plays, arrow keys step and tilt, a and d turn, plus and minus zoom" });
    this.button = el("button", { class: "play", click: () => this.toggle() }, "Play");
    this.slider = el("input", { type: "range", min: 0, max: 1, step: "any", value: 0, "aria-label": "Time", input: () => { this.pause(); this.seek(Number(this.slider.value)); } });
    this.clock = el("output", {}, "0.00 s");
    this.ticks = el("div", { class: "ticks", "aria-hidden": "true" });
    this.chooser = el("select", { "aria-label": "Speed", change: () => this.setSpeed(Number(this.chooser.value)) },
      ...SPEEDS.map((speed) => el("option", { value: speed, selected: speed === 1 ? "" : null }, `${speed}×`)));
    this.loads = el("button", { "aria-pressed": "false", title: "Colour by load (L)", click: () => this.setLoads(!this.byLoad) }, "Loads");
    this.wide = el("button", { "aria-pressed": "false", title: "Show the whole course (W)", click: () => this.setWide(!this.eye.wide) }, "Wide");
    this.trials = el("select", { change: () => this.chosen() });
    this.keys = el("span", { class: "keys" });
    this.files = el("p", { class: "files" });
    this.list = el("ol", { class: "events", "aria-label": "Events" });
    return el("div", { class: "player", role: "group", "aria-label": "Film", keydown: (event) => this.press(event) },
      el("div", { class: "view" }, this.canvas,
        el("div", { class: "over" }, el("p", { class: "title", "aria-live": "polite" }),
          el("label", { class: "trials", hidden: "" }, "Trial ", this.trials)),
        el("p", { class: "under" }, this.keys,
          el("span", { class: "legend" }, el("span", {}, "no load"), el("i", {}), el("span", {}, "breaks"))),
        el("p", { class: "nothing" })),
      el("div", { class: "transport" }, this.button,
        el("div", { class: "track" }, this.slider, this.ticks), this.clock, this.chooser, this.loads, this.wide,
        el("button", { title: "Reset the view (R)", click: () => this.again() }, "Reset")),
      el("p", { class: "remark" }), this.files, this.list);
  }

  open() {
    const nothing = this.element.querySelector(".nothing");
    nothing.textContent = "No machine to show.";
    try {
      this.picture = new Picture(this.canvas);
    } catch {
      nothing.textContent = "This browser does not support WebGL, so there is no 3D view.";
      this.element.classList.add("empty");
      return;
    }
    this.eye = new Eye(this.picture, this.canvas, () => this.ask());
    const dress = () => { this.picture.dress(getComputedStyle(document.documentElement)); this.ask(); };
    matchMedia("(prefers-color-scheme: dark)").addEventListener("change", dress);
    dress();
    new ResizeObserver(() => {
      this.share = null;
      this.sharpen(1);
    }).observe(this.canvas);
  }
}

/** Save content as a file. */
function save(name, content) {
  const url = URL.createObjectURL(new Blob([content]));
  el("a", { href: url, download: name }).click();
  setTimeout(() => URL.revokeObjectURL(url), 1000);
}

/** An entry of the legend: a mark in its colour, and its name. */
function entry(kind, color, name) {
  const mark = el("i", { class: kind });
  mark.style.color = `rgb(${color.map((part) => Math.round(255 * part)).join(" ")})`;
  return el("span", {}, mark, name);
}
