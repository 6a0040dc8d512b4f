// The view of a film: the canvas with the 3D scene and its camera, what is written over it, and the legend.

import { Eye } from "./camera.js";
import { markPaint } from "./colors.js";
import { el } from "./dom.js";
import { traceColor } from "./materials.js";
import { Picture } from "./scene.js";
import { Sharpness } from "./sharpness.js";

export const PAGE = [720, 480]; // size of a picture on paper, CSS pixels

export class View {
  /** @param over elements at the top of the view
   *  @param ask requests a frame */
  constructor(over, ask) {
    this.canvas = el("canvas", { tabindex: "0", role: "img", "aria-label": "3D view; space plays, arrow keys step and tilt, a and d turn, plus and minus zoom" });
    this.keys = el("span", { class: "keys" });
    this.nothing = el("p", { class: "nothing" }, "No machine to show.");
    this.under = el("p", { class: "under" }, this.keys,
      el("span", { class: "legend" }, el("span", {}, "no load"), el("i", {}), el("span", {}, "breaks")));
    this.element = el("div", { class: "view" }, this.canvas, el("div", { class: "over" }, ...over), this.under, this.nothing);
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
    matchMedia("(prefers-color-scheme: dark)").addEventListener("change", () => { this.dress(); ask(); });
    this.dress();
    this.sharpness = new Sharpness(this.picture, this.canvas, ask);
  }

  /** Take the colours of the page. */
  dress() {
    this.picture.dress(getComputedStyle(document.documentElement));
    if (this.shown) this.picture.show(...this.shown); // labels have them too
  }

  /** Copy a moment to another canvas as for paper: light and of one shape, whatever the window is; the whole course if `wide`. */
  print(paper, film, time, byLoad, wide) {
    const { classList } = document.documentElement;
    const { wide: before, zoom, shift } = this.eye;
    if (wide) this.eye.setWide(true);
    classList.add("light");
    this.dress();
    this.picture.resize(...PAGE, 2 / Math.min(devicePixelRatio, 2));
    this.draw(film, time, byLoad);
    [paper.width, paper.height] = [this.canvas.width, this.canvas.height];
    paper.getContext("2d").drawImage(this.canvas, 0, 0);
    Object.assign(this.eye, { wide: before, zoom, shift });
    classList.remove("light");
    this.dress();
    this.sharpness.share = null;
    this.sharpness.rest();
  }

  /** Give the memory of the picture back. */
  close() {
    this.picture?.close();
  }

  /** Take another machine and its film. */
  show(machine, shapes, film) {
    this.shown = [machine, shapes, film];
    this.picture.show(...this.shown);
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
export function entry(kind, color, name) {
  const mark = el("i", { class: kind });
  mark.style.color = `rgb(${color.map((part) => Math.round(255 * part)).join(" ")})`;
  return el("span", {}, mark, name);
}
