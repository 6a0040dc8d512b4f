// The page that replays a session: the machine as it was at each moment, and what was done, on a timeline.

import { Clock } from "../../report/web/clock.js";
import { el, formatNumber } from "../../report/web/dom.js";
import { Player } from "../../report/web/player.js";
import { problem } from "../../report/web/text.js";
import { ask } from "./api.js";
import { moment } from "./list.js";

const SPEEDS = [1, 4, 16, 64];
const SPANS = ["pause", "break", "trial"]; // kinds of events that last

export async function replayPage({ session }) {
  const page = new Replay(session, await ask("/api/session/replay", { session }));
  return { elements: [el("aside", {}, page.player.element), page.main], close: () => page.close() };
}

class Replay {
  constructor(session, data) {
    Object.assign(this, { session, data, player: new Player(), clock: new Clock(), films: new Map() });
    this.clock.duration = data.seconds;
    this.clock.speed = SPEEDS[1];
    this.slider = el("input", { type: "range", min: 0, max: data.seconds, step: 0.1, value: 0, "aria-label": "Moment of the session", input: () => this.seek(Number(this.slider.value)) });
    this.play = el("button", { class: "play", click: () => this.toggle() }, "Play");
    const speed = el("select", { "aria-label": "Speed", change: () => (this.clock.speed = Number(speed.value)) }, ...SPEEDS.map((value) => el("option", { value, selected: value === this.clock.speed ? "" : null }, `${value} ×`)));
    this.time = el("output", { class: "clock" });
    this.film = el("button", { hidden: "", click: () => this.watch() }, "Play the film of this test");
    const share = (time) => `${(100 * time) / (data.seconds || 1)}%`;
    const mark = ({ kind, at, end, text }) => {
      const item = el("i", { class: kind, title: text });
      item.style.left = share(at);
      if (SPANS.includes(kind)) item.style.width = share(end - at);
      return item;
    };
    this.lines = data.events.map(({ at, text, kind }) => el("button", { class: kind, click: () => this.seek(at) }, el("span", {}, spell(at)), ` ${text}`));
    const notes = data.events.filter(({ kind }) => kind === "note").length;
    const about = [data.participant && `participant ${data.participant}`, data.mode, moment(data.began), spell(data.seconds), notes === 1 ? "1 note" : `${notes} notes`];
    const texts = Object.entries({ "Consent text": data.consent, Rationale: data.rationale }).filter(([, text]) => text);
    this.main = el("main", {}, el("header", {}, el("p", { class: "quiet" }, el("a", { href: "#sessions" }, "Sessions"), ` / ${session}`), el("h1", {}, data.task), el("p", { class: "lede" }, about.filter(Boolean).join(" · "))),
      el("section", { class: "replay", "aria-label": "Timeline" }, el("p", {}, this.play, speed, this.time, this.film),
        el("div", { class: "marks", "aria-hidden": "true" }, ...data.events.map(mark)), this.slider,
        el("p", { class: "quiet" }, ...[["note", "note"], ["trial", "test"], ["action", "edit"], ["pause", "nothing done"], ["audio", "microphone"]].map(([kind, name]) => el("span", {}, el("i", { class: kind }), name)))),
      el("ol", { class: "events told", "aria-label": "What happened" }, ...this.lines.map((line) => el("li", {}, line))),
      ...texts.map(([name, text]) => el("details", {}, el("summary", {}, name), ...text.split("\n").map((line) => el("p", {}, line)))));
    this.step = this.step.bind(this);
    this.seek(0);
  }

  /** Show a moment: the machine after the last event before it, and that event in the list. */
  seek(time) {
    this.clock.seek(time);
    const { events } = this.data;
    const at = events.findLastIndex((event) => event.at <= this.clock.time + 1e-6);
    this.slider.value = this.clock.time;
    this.slider.setAttribute("aria-valuetext", spell(this.clock.time));
    this.time.textContent = `${spell(this.clock.time)} of ${spell(this.data.seconds)}`;
    if (at === this.at) return;
    this.at = at;
    this.lines.forEach((line, index) => line.setAttribute("aria-current", index === at ? "step" : "false"));
    const list = this.lines[at]?.closest("ol");
    if (list) list.scrollTop = this.lines[at].offsetTop - list.offsetTop - list.clientHeight / 2;
    this.film.hidden = events[at]?.kind !== "trial";
    this.show(events[at]?.machine ?? this.data.machine, events[at]?.text ?? "the beginning");
  }

  async show(machine, title, film = "") {
    const before = this.shown;
    this.shown = machine + film;
    if (this.shown === before) return void (this.player.title.textContent = title);
    try {
      if (!this.films.has(this.shown)) this.films.set(this.shown, ask("/api/session/machine", { session: this.session, machine, film }));
      const found = await this.films.get(machine + film);
      if (this.shown !== machine + film) return;
      this.player.use(found.shapes, found.files);
      await this.player.show(found.machine, title, film ? found.machine.remark : "");
      if (film) this.player.play();
    } catch (error) {
      this.main.append(problem(error.message));
    }
  }

  /** Simulate the test that is shown, and play its film. */
  watch() {
    this.stop();
    const { machine, text } = this.data.events[this.at];
    this.player.show(null, text, "Simulating …");
    this.show(machine, text, "yes");
  }

  toggle() {
    if (this.clock.running) return this.stop();
    this.clock.start();
    this.play.textContent = "Pause";
    return this.ask();
  }

  stop() {
    this.clock.stop();
    this.play.textContent = "Play";
  }

  ask() {
    this.wanted = requestAnimationFrame(this.step);
  }

  step(now) {
    if (!this.clock.running) return;
    this.clock.advance(now);
    this.seek(this.clock.time);
    if (this.clock.over) this.stop();
    else this.ask();
  }

  close() {
    cancelAnimationFrame(this.wanted);
    this.clock.stop();
    this.player.close();
  }
}

/** Seconds as minutes and seconds. */
const spell = (seconds) => `${formatNumber(Math.floor(seconds / 60))}:${String(Math.floor(seconds % 60)).padStart(2, "0")}`;
