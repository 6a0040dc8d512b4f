// The view of a film: the canvas with the 3D scene and its camera, what is written over it, and the legend.

import { Eye } from "./camera.js";
import { markPaint } from "./colors.js";
import { el } from "./dom.js";
import { traceColor } from "./materials.js";
import { Picture } from "./scene.js";
import { Sharpness } from "./sharpness.js";

export class View {
  /** @param over elements at the top of the view
   *  @param ask requests a frame */
  constructor(over, ask) {
    this.canvas = el("canvas", { tabindex: "0", role: "img", "aria-label": "3D view; space plays, arrow keys step and tilt, a and d turn, plus and minus zoom" });
    this.keys = el("span", { class: "keys" });
    this.nothing = el("p", { class: "nothing" }, "No machine to show.");
    this.element = el("div", { class: "view" }, this.canvas,
      el("div", { class: "over" }, ...over),
      el("p", { class: "under" }, this.keys,
        el("span", { class: "legend" }, el("span", {}, "no load"), el("i", {}), el("span", {}, "breaks"))),
      this.nothing);
    this.open(ask);
  }

  /** Begin to draw in 3D; without WebGL there is no `picture`. */
  open(ask) {
    try {
      this.picture = new Picture(this.canvas);
    } catch {
      this.nothing.textContent = "This browser does not support WebGL, so there is no 3D view.";
      return;
    }
    this.eye = new Eye(this.picture, this.canvas, ask);
    const dress = () => { this.picture.dress(getComputedStyle(document.documentElement)); ask(); };
    matchMedia("(prefers-color-scheme: dark)").addEventListener("change", dress);
    dress();
    this.sharpness = new Sharpness(this.picture, this.canvas, ask);
  }

  /** Give the memory of the picture back. */
  close() {
    this.picture?.close();
  }

  /** Take another machine and its film. */
  show(machine, shapes, film) {
    this.picture.show(machine, shapes, film);
    this.eye.begin(film, machine, shapes);
    this.keys.replaceChildren(...legend(machine, this.picture.traces));
  }

  /** Mark blocks, and fade the others; null marks none. */
  mark(blocks) {
    if (this.picture) this.picture.paint = blocks && markPaint(blocks);
  }

  draw(film, time, byLoad) {
    this.eye.at(time);
    this.picture.pose(film, time, byLoad, this.eye.controls.target);
    this.picture.draw();
  }
}

/** The legend of colours: given blocks, traces of what moved, and the wind. */
function legend({ traces, given, wind }, drawn) {
  const blocks = given.map(([name, color]) => entry("block", color, name));
  const dots = traces.map(({ name }, index) => drawn[index].moved && entry("dots", traceColor(index), name)).filter(Boolean);
  return [...blocks, ...dots, ...(wind ? [el("span", {}, `wind: ${wind}`)] : [])];
}

/** An entry of the legend: a mark in its colour, and its name. */
function entry(kind, color, name) {
  const mark = el("i", { class: kind });
  mark.style.color = `rgb(${color.map((part) => Math.round(255 * part)).join(" ")})`;
  return el("span", {}, mark, name);
}
