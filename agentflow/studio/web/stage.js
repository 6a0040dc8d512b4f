// The 3D view where a machine is built: blocks and faces to click, centre of mass, support polygon.

import * as THREE from "three";
import { Eye } from "../../report/web/camera.js";
import { el } from "../../report/web/dom.js";
import { Film } from "../../report/web/film.js";
import { Picture } from "../../report/web/scene.js";
import { Sharpness } from "../../report/web/sharpness.js";
import { Marks } from "./marks.js";

const CHOSEN = [0.1, 0.6, 0.95];
const DRAG = 5; // pixels that a pointer moves before a click is a turn of the view
const TURN = 0.12; // radians per press
const REST = 300; // milliseconds without a frame after which nothing moves

export class Stage {
  constructor(editor) {
    this.editor = editor;
    this.canvas = el("canvas", { tabindex: "0", "aria-label": "Machine in 3D; arrow keys turn, plus and minus zoom, 0 resets", keydown: (event) => this.press(event),
      pointerdown: (event) => (this.down = [event.clientX, event.clientY]), pointerup: (event) => this.click(event),
      pointermove: (event) => this.hover(event), pointerleave: () => editor.point(null) });
    this.canvas.placeOf = (...end) => this.placeOf(...end); // for tests
    this.element = el("div", { class: "view stage" }, this.canvas);
    this.picture = new Picture(this.canvas);
    this.picture.paint = ({ block, color }) => (block !== null && block === editor.chosen ? color.map((part, i) => 0.45 * part + 0.55 * CHOSEN[i]) : null);
    this.eye = new Eye(this.picture, this.canvas, () => this.ask());
    this.extra = new THREE.Group();
    this.picture.scene.add(this.extra);
    this.ray = new THREE.Raycaster();
    this.dark = matchMedia("(prefers-color-scheme: dark)");
    this.dress = () => { this.picture.dress(getComputedStyle(document.documentElement)); this.ask(); };
    this.dark.addEventListener("change", this.dress);
    this.dress();
    this.sharpness = new Sharpness(this.picture, this.canvas, () => this.ask());
    editor.on(["state"], () => this.show());
    this.marks = new Marks(this.picture.scene);
    editor.on(["spots"], () => { this.marks.show(editor.spots); this.ask(); });
    editor.on(["point"], () => { this.marks.shade(editor.pointed); this.ask(); });
    editor.on(["choice"], () => this.ask());
  }

  async show() {
    const { state } = this.editor;
    const film = await Film.of(state.picture.film);
    if (state !== this.editor.state) return;
    this.film = film;
    this.picture.show(state.picture, state.shapes, film);
    this.picture.traces.forEach((trace) => (trace.visible = false));
    this.eye.begin(film, state.picture, state.shapes);
    this.eye.at(0);
    this.balance(state);
    this.ask();
  }

  /** Draw the centre of mass, the line below it, and the support polygon. */
  balance({ centre: [x, y, z], support, stands }) {
    this.extra.clear();
    const ink = getComputedStyle(document.documentElement).getPropertyValue(stands ? "--ink" : "--red").trim();
    const color = new THREE.Color().setStyle(ink);
    const ball = new THREE.Mesh(new THREE.SphereGeometry(0.12, 16, 12), new THREE.MeshBasicMaterial({ color, depthTest: false, transparent: true }));
    ball.position.set(-x, y, z);
    const line = (points) => new THREE.Line(new THREE.BufferGeometry().setFromPoints(points.map((point) => new THREE.Vector3(...point))), new THREE.LineBasicMaterial({ color, depthTest: false, transparent: true }));
    const corners = [...support, support[0]].map(([u, w]) => [-u, 0.02, w]);
    this.extra.add(ball, line([[-x, y, z], [-x, 0, z]]), line(corners));
    this.extra.children.forEach((item) => (item.renderOrder = 3));
  }

  ask() {
    this.wanted ??= requestAnimationFrame((now) => {
      this.wanted = null;
      if (now - this.last < REST) this.sharpness.note(now - this.last);
      this.last = now;
      clearTimeout(this.still);
      this.still = setTimeout(() => this.sharpness.rest(), REST);
      this.draw();
    });
  }

  draw() {
    if (!this.film) return;
    this.marks.setBehind(!(this.sharpness.share < 1)); // the first to go where frames are slow
    this.picture.pose(this.film, 0, false, this.eye.controls.target);
    this.picture.draw();
    this.canvas.dispatchEvent(new Event("frame"));
  }

  /** What is under the pointer: {spot} or {block}. */
  under(event) {
    const box = this.canvas.getBoundingClientRect();
    const at = new THREE.Vector2((2 * (event.clientX - box.left)) / box.width - 1, 1 - (2 * (event.clientY - box.top)) / box.height);
    this.ray.setFromCamera(at, this.picture.camera);
    const solid = this.picture.solids.pick(this.ray);
    const spot = this.marks.under(this.ray, solid?.distance ?? Infinity);
    return spot ? { spot } : { block: solid?.block };
  }

  /** Where the mark of a face is, from the middle of the canvas, CSS pixels. */
  placeOf(block, face) {
    const at = this.marks.placeOf(block, face).project(this.picture.camera);
    return [(at.x * this.canvas.clientWidth) / 2, (-at.y * this.canvas.clientHeight) / 2];
  }

  hover(event) {
    if (event.buttons || !this.editor.spots.length) return;
    this.editor.point(this.under(event).spot ?? null);
  }

  click(event) {
    if (!this.down || Math.hypot(event.clientX - this.down[0], event.clientY - this.down[1]) > DRAG) return;
    const { spot, block } = this.under(event);
    if (spot) this.editor.pick(spot);
    else if (block !== undefined && block !== null) this.editor.choose(block);
  }

  press(event) {
    if (event.ctrlKey || event.metaKey || event.altKey) return;
    const act = {
      ArrowUp: () => this.eye.turn(0, TURN), ArrowDown: () => this.eye.turn(0, -TURN), ArrowLeft: () => this.eye.turn(-TURN, 0), ArrowRight: () => this.eye.turn(TURN, 0),
      "+": () => this.eye.turn(0, 0, 0.9), "-": () => this.eye.turn(0, 0, 1.1), 0: () => { this.eye.reset(); this.ask(); },
    }[event.key];
    if (!act) return;
    event.preventDefault();
    act();
  }

  close() {
    clearTimeout(this.still);
    this.dark.removeEventListener("change", this.dress);
    this.film = null;
    this.picture.close();
  }
}
