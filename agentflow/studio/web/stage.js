// The 3D view where a machine is built: blocks and faces to click, centre of mass, support polygon, and
// the level around it.

import * as THREE from "three";
import { Eye } from "../../report/web/camera.js";
import { el } from "../../report/web/dom.js";
import { Film } from "../../report/web/film.js";
import { Picture } from "../../report/web/scene.js";
import { Sharpness } from "../../report/web/sharpness.js";
import { solidMesh } from "../../report/web/solids.js";
import { send } from "./api.js";
import { ghostOf } from "./ghost.js";
import { Gizmo, WAY_AHEAD, forwardArrow, framed, levelGhosts } from "./gizmo.js";
import { Marks } from "./marks.js";

const [CHOSEN, WRONG] = [[0.1, 0.6, 0.95], [0.9, 0.1, 0.1]];
const RIM = 0.05; // width of the outline of the chosen block, metres
const RIM_LOOK = new THREE.MeshBasicMaterial({ color: new THREE.Color().setRGB(...CHOSEN, THREE.LinearSRGBColorSpace), side: THREE.BackSide });
const DRAG = 5; // pixels that a pointer moves before a click is a turn of the view
const TURN = 0.12; // radians per press
const PAUSE = 120; // milliseconds that a face is pointed at before the block is shown there
const SWING = 700; // milliseconds in which the view turns by itself
const REST = 300; // milliseconds without a frame after which nothing moves

export class Stage {
  constructor(editor) {
    this.editor = editor;
    this.canvas = el("canvas", { tabindex: "0", "aria-label": "Machine in 3D; arrow keys turn, plus and minus zoom, 0 resets", keydown: (event) => this.press(event),
      pointerdown: (event) => { this.down = [event.clientX, event.clientY]; this.remember(); }, pointerup: (event) => this.click(event),
      pointermove: (event) => this.hover(event), pointerleave: () => editor.point(null) });
    this.canvas.placeOf = (...end) => this.placeOf(...end); // for tests
    this.gizmo = new Gizmo((way) => this.look(() => { this.eye.following = true; this.eye.way = way.clone(); }));
    this.tip = el("p", { class: "tip", hidden: "" });
    const button = (text, title, act) => el("button", { type: "button", title, click: act }, text);
    this.here = el("p", { class: "here", hidden: "" }, "Here");
    this.element = el("div", { class: "view stage" }, this.canvas, this.gizmo.element, this.tip, this.here, el("div", { class: "views" },
      button("Fit", "The whole machine (0)", () => this.look(() => this.fit())), button("Course", "The level and the way ahead", () => this.look(() => this.eye.setWide(true))),
      button("Undo view", "The view before", () => this.views.length && this.restore())));
    this.views = []; // to go back to
    this.ghosts = new Map(); // of blocks at faces, by what was asked for
    this.picture = new Picture(this.canvas);
    this.picture.paint = ({ block, color }) => {
      const paint = editor.wrong.has(block) ? WRONG : block !== null && block === editor.chosen && !editor.state.picture.solids[block].length ? CHOSEN : null;
      return paint && color.map((part, i) => 0.35 * part + 0.65 * paint[i]);
    };
    this.eye = new Eye(this.picture, this.canvas, () => this.ask());
    this.extra = new THREE.Group();
    this.outline = new THREE.Group();
    this.ghost = new THREE.Group();
    this.level = levelGhosts(editor.start);
    this.picture.scene.add(this.extra, this.outline, this.ghost, this.level);
    this.ray = new THREE.Raycaster();
    this.dark = matchMedia("(prefers-color-scheme: dark)");
    this.dress = () => { this.picture.dress(getComputedStyle(document.documentElement)); if (this.film) this.show(); this.ask(); };
    this.dark.addEventListener("change", this.dress);
    this.dress();
    this.sharpness = new Sharpness(this.picture, this.canvas, () => this.ask());
    editor.on(["state"], () => this.show());
    this.marks = new Marks(this.picture.scene);
    editor.on(["spots"], () => this.mark());
    editor.on(["point", "spots"], () => { this.marks.shade(editor.pointed); this.preview(); this.ask(); });
    editor.on(["choice"], () => { this.rim(); this.ask(); });
  }

  async show() {
    const { state } = this.editor;
    const film = await Film.of(state.picture.film);
    if (state !== this.editor.state) return;
    this.film = film;
    this.picture.show(state.picture, state.shapes, film);
    this.picture.traces.forEach((trace) => (trace.visible = false));
    this.eye.begin(film, state.picture, state.shapes);
    for (const box of this.eye.framing.path) box[3] = Math.max(box[3], state.size[2] / 2 + WAY_AHEAD); // the arrow stays in the picture
    const turned = this.sides && turnedTo(this.sides, this.eye.way);
    if (turned) {
      this.remember();
      this.eye.following = true;
      this.swing(turned);
    }
    this.sides = null;
    this.level.position.set(-state.middle[0], 0, state.middle[2]).add(this.level.down);
    this.eye.framing.whole = framed(this.level, state);
    this.eye.at(0);
    this.balance(state);
    this.rim();
    this.ask();
  }

  /** Outline the chosen block. */
  rim() {
    this.outline.clear();
    const { state, chosen } = this.editor;
    if (!this.film || this.picture.machine !== state.picture) return;
    const place = this.picture.solids.place(this.film, chosen).clone();
    for (const index of state.picture.solids[chosen]) {
      const mesh = solidMesh(state.shapes[index], RIM_LOOK, RIM);
      mesh.matrix.premultiply(place);
      this.outline.add(mesh);
    }
  }

  /** Show the block that is aimed with at the face that is pointed at, and why it does not fit. */
  async preview() {
    const { editor } = this;
    const { pointed: spot, aim } = editor;
    const two = aim && editor.twoEnded(aim.add) && !aim.first;
    this.tip.hidden = !spot?.why_not;
    this.ghost.clear();
    if (!spot || !aim || two) return;
    if (spot.why_not) this.sayAt(spot);
    await new Promise((done) => setTimeout(done, PAUSE));
    if (editor.pointed !== spot) return;
    const asked = JSON.stringify([editor.state.digest, aim, spot.block, spot.face]);
    if (!this.ghosts.has(asked)) this.ghosts.set(asked, send("/api/build/ghost", { ...editor.given, ...aim, end: [spot.block, spot.face] }).catch(() => null));
    const found = await this.ghosts.get(asked);
    if (!found || editor.pointed !== spot) return;
    this.ghost.clear();
    this.ghost.add(ghostOf(found, !spot.why_not));
    this.ask();
  }

  /** Write why a block does not fit beside the face. */
  sayAt({ block, face, why_not: whyNot }) {
    const [x, y] = this.placeOf(block, face);
    this.tip.textContent = whyNot;
    this.tip.style.left = `${Math.min(Math.max(x + this.canvas.clientWidth / 2 + 14, 8), this.canvas.clientWidth - 250)}px`;
    this.tip.style.top = `${Math.min(Math.max(y + this.canvas.clientHeight / 2 + 14, 8), this.canvas.clientHeight - 70)}px`;
  }

  /** Write above the face that a guide means that it is to be clicked. */
  pointTo() {
    const away = ({ block, face }) => this.marks.placeOf(block, face).distanceTo(this.picture.camera.position);
    const [spot] = this.meant.sort((a, b) => away(a) - away(b));
    const [x, y] = spot ? this.placeOf(spot.block, spot.face) : [0, 0];
    this.here.hidden = !spot || Math.abs(x) > this.canvas.clientWidth / 2 || Math.abs(y) > this.canvas.clientHeight / 2;
    this.here.style.transform = `translate(calc(${x}px - 50%), calc(${y}px - 100% - 18px))`;
  }

  /** Mark the faces that a guide means, else all. */
  mark() {
    const { spots, sought } = this.editor;
    this.meant = sought ? spots.filter(sought) : [];
    this.marks.show(this.meant.length ? this.meant : spots);
    this.ask();
  }

  /** When the next state shows, turn the camera if it sees no faces with these directions. */
  lookFor(sides) {
    this.sides = sides;
  }

  /** Turn the view slowly enough to be followed, unless somebody turns it. */
  swing(to) {
    const [from, begun, own] = [this.eye.way.clone(), performance.now(), (this.turning = {})];
    const step = (now) => {
      if (this.turning !== own || !this.film) return;
      const share = matchMedia("(prefers-reduced-motion)").matches ? 1 : Math.min(1, Math.max(0, now - begun) / SWING);
      this.eye.way = from.clone().lerp(to, share * share * (3 - 2 * share)).normalize();
      this.eye.at(0);
      this.ask();
      if (share < 1) requestAnimationFrame(step);
    };
    requestAnimationFrame(step);
  }

  /** Change the view in one step that can be undone. */
  look(change) {
    this.remember();
    change();
    this.eye.at(0);
    this.ask();
  }

  fit() {
    this.eye.setWide(false);
    this.eye.reset();
  }

  remember() {
    this.turning = null;
    if (this.eye.way) this.views.push(this.eye.view());
  }

  restore() {
    this.turning = null;
    this.eye.restore(this.views.pop());
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
    const accent = new THREE.Color().setStyle(getComputedStyle(document.documentElement).getPropertyValue("--accent").trim());
    const [arrow, words] = forwardArrow(this.editor.state, accent);
    this.extra.add(arrow);
    this.picture.labels.add("forward, z+", words, -1.6);
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
    this.gizmo.turn(this.picture.camera);
    this.pointTo();
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
      "+": () => this.eye.turn(0, 0, 0.9), "-": () => this.eye.turn(0, 0, 1.1), 0: () => this.look(() => this.fit()),
    }[event.key];
    if (!act) return;
    event.preventDefault();
    this.remember();
    act();
  }

  close() {
    clearTimeout(this.still);
    this.dark.removeEventListener("change", this.dress);
    this.film = null;
    this.picture.close();
  }
}

const ASIDE = 0.4; // of the direction to the eye, along what it turns to: no farther than is needed
const SEEN = 0.3; // least share of that direction along a face's normal

/** The direction to the eye nearest to `way` from which the first of these sides is seen; null if one is already. */
function turnedTo(sides, way) {
  const sign = ([axis, end]) => (end === "+") === (axis === "x") ? -1 : 1; // the scene's x points left
  if (sides.some((side) => sign(side) * way[side[0]] > SEEN)) return null;
  const [axis, other] = sides[0][0] === "x" ? ["x", "z"] : ["z", "x"];
  const turned = way.clone();
  turned[axis] = sign(sides[0]) * ASIDE;
  turned[other] = (Math.sign(way[other]) || 1) * Math.sqrt(Math.max(0.1, 1 - ASIDE ** 2 - way.y ** 2));
  return turned.normalize();
}
