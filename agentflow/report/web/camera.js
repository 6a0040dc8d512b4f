// The camera: it follows the action; users can rotate, pan and zoom relative to it.

import * as THREE from "three";
import { OrbitControls } from "three/examples/jsm/controls/OrbitControls.js";
import { Framing } from "./framing.js";

const FILL = 0.88; // share of the picture to fill
const NEAREST = 7; // minimum distance, metres

export class Eye {
  constructor(picture, element, changed) {
    this.camera = picture.camera;
    this.controls = new OrbitControls(this.camera, element);
    this.controls.maxPolarAngle = 0.497 * Math.PI;
    this.controls.minDistance = 2;
    this.controls.maxDistance = 2000;
    this.following = true;
    this.controls.addEventListener("change", () => {
      if (this.moving) return;
      this.note();
      changed();
    });
  }

  /** Start another film; a view that the user has chosen is kept. */
  begin(film, machine, shapes) {
    this.framing = new Framing(film, machine, shapes);
    if (!this.way) this.reset();
  }

  reset() {
    this.following = true;
    this.way = this.framing.side.clone();
    this.zoom = 1;
    this.shift = new THREE.Vector3();
    this.at(this.time ?? 0);
  }

  /** Show the whole course, or follow the action. */
  setWide(on) {
    this.wide = on;
    this.zoom = 1;
    this.shift = new THREE.Vector3();
  }

  /** Move to where the film is at a time. */
  at(time) {
    this.time = time;
    if (!this.following || !this.framing) return;
    const [target, distance] = this.wanted();
    this.moving = true; // do not treat our own moves as the user's
    this.controls.target.copy(target).add(this.shift);
    this.camera.position.copy(this.way).multiplyScalar(distance * this.zoom).add(this.controls.target);
    this.controls.update();
    this.moving = false;
  }

  /** Take the direction, zoom and shift of another eye. */
  take(other) {
    if (!other.way || !this.way) return;
    this.way.copy(other.way);
    this.shift.copy(other.shift);
    this.zoom = other.zoom;
  }

  /** The view: direction, zoom, shift and whether it is wide; for `restore`. */
  view() {
    return { way: this.way.clone(), zoom: this.zoom, shift: this.shift.clone(), wide: this.wide };
  }

  restore(view) {
    Object.assign(this, view);
    this.at(this.time);
  }

  /** Rotate (radians to the side and up) and zoom; for the keyboard. */
  turn(side, up, zoom = 1) {
    const place = new THREE.Spherical().setFromVector3(this.camera.position.clone().sub(this.controls.target));
    place.theta += side;
    place.phi = Math.min(Math.max(place.phi - up, 0.05), this.controls.maxPolarAngle);
    place.radius *= zoom;
    this.camera.position.setFromSpherical(place).add(this.controls.target);
    this.controls.update();
  }

  /** Remember the user's view relative to the framing. */
  note() {
    if (!this.framing) return;
    const [target, distance] = this.wanted();
    const offset = this.camera.position.clone().sub(this.controls.target);
    this.zoom = offset.length() / distance;
    this.way = offset.normalize();
    this.shift = this.controls.target.clone().sub(target);
  }

  /** The point to look at, and the distance from it: the same for an eye and the one `beside` it. */
  wanted() {
    const slope = FILL * Math.tan(THREE.MathUtils.degToRad(this.camera.fov / 2));
    const boxes = [this, this.beside].filter((eye) => eye?.framing).map(({ framing }) => (this.wide ? framing.whole : framing.at(this.time)));
    const distances = boxes.map((at) => Math.max(at[3] / (slope * this.camera.aspect), at[4] / slope) + at[5]);
    return [new THREE.Vector3(...boxes[0].slice(0, 3)), Math.max(...distances, NEAREST)];
  }
}
