// The controls of a film: the row of buttons and the slider, and keys.

import { el } from "./dom.js";

const SPEEDS = [0.1, 0.25, 0.5, 1, 2];
const STEP = 1 / 30; // seconds per press of an arrow key
const TURN = 0.12; // radians per press

export class Transport {
  /** @param ticks the marks along the slider */
  constructor(player, ticks) {
    this.button = el("button", { class: "play", click: () => player.toggle() }, "Play");
    this.slider = el("input", { type: "range", min: 0, max: 1, step: "any", value: 0, "aria-label": "Time", input: () => { player.pause(); player.seek(Number(this.slider.value)); } });
    this.clock = el("output", {}, "0.00 s");
    this.speeds = el("select", { "aria-label": "Speed", change: () => player.setSpeed(Number(this.speeds.value)) },
      ...SPEEDS.map((speed) => el("option", { value: speed, selected: speed === 1 ? "" : null }, `${speed}×`)));
    this.loads = el("button", { "aria-pressed": "false", title: "Colour by load (L)", click: () => player.setLoads(!player.byLoad) }, "Loads");
    this.wide = el("button", { "aria-pressed": "false", title: "Show the whole course (W)", click: () => player.setWide(!player.view.eye.wide) }, "Wide");
    this.extras = el("div", { class: "extras" }, this.speeds, this.loads, this.wide,
      el("button", { title: "Reset the view (R)", click: () => player.resetView() }, "Reset"));
    this.element = el("div", { class: "transport" }, this.button, el("div", { class: "track" }, this.slider, ticks), this.clock, this.extras);
  }

  setDuration(duration) {
    this.slider.max = duration;
  }

  setTime(time) {
    this.slider.value = time;
    this.clock.textContent = `${time.toFixed(2)} s`;
    this.slider.setAttribute("aria-valuetext", `${time.toFixed(2)} seconds`);
  }

  setPlaying(on) {
    this.button.textContent = on ? "Pause" : "Play";
  }

  setSpeed(speed) {
    this.speeds.value = speed;
  }

  setLoads(on) {
    this.loads.setAttribute("aria-pressed", on);
  }

  setWide(on) {
    this.wide.setAttribute("aria-pressed", on);
  }
}

/** Do what a key stands for. */
export function press(player, event) {
  const name = event.target.tagName;
  if (event.altKey || event.ctrlKey || event.metaKey || name === "SELECT") return;
  const { clock, view: { canvas, eye } } = player;
  const own = event.target === canvas;
  const changeSpeed = (by) => player.setSpeed(SPEEDS[Math.min(Math.max(SPEEDS.indexOf(clock.speed) + by, 0), SPEEDS.length - 1)]);
  const act = {
    " ": () => player.toggle(),
    ",": () => changeSpeed(-1),
    ".": () => changeSpeed(1),
    l: () => player.setLoads(!player.byLoad),
    w: () => player.setWide(!eye.wide),
    r: () => player.resetView(),
    Home: () => player.seek(0),
    End: () => player.seek(clock.duration),
    ArrowLeft: () => player.seek(clock.time - STEP),
    ArrowRight: () => player.seek(clock.time + STEP),
    ArrowUp: own && (() => eye.turn(0, TURN)),
    ArrowDown: own && (() => eye.turn(0, -TURN)),
    a: own && (() => eye.turn(-TURN, 0)),
    d: own && (() => eye.turn(TURN, 0)),
    "+": own && (() => eye.turn(0, 0, 0.9)),
    "-": own && (() => eye.turn(0, 0, 1.1)),
  }[event.key];
  if (!act || (name === "BUTTON" && event.key === " ")) return;
  event.preventDefault();
  if (player.film) act();
}
