// Where the eye is: it follows what happens, and the user turns, shifts and zooms around that.

import * as THREE from "three";
import { OrbitControls } from "three/examples/jsm/controls/OrbitControls.js";

const SIDE = new THREE.Vector3(-0.86, 0.36, -0.42); // from the right, a little behind and above
const EVERY = 0.1; // seconds between the points of the path
const SMOOTHING = 8; // points on either side that are averaged
const NEAR = 12; // metres around the root that stay in the picture
const MARGIN = 1.6; // metres around it

export class Eye {
  constructor(picture, element, changed) {
    this.camera = picture.camera;
    this.controls = new OrbitControls(this.camera, element);
    this.controls.maxPolarAngle = 0.497 * Math.PI;
    this.controls.minDistance = 2;
    this.controls.maxDistance = 400;
    this.following = true;
    this.controls.addEventListener("change", () => {
      if (this.moving) return;
      this.note();
      changed();
    });
  }

  /** Look at another film from the usual side. */
  begin(film, bodies, hero) {
    this.path = path(film, bodies, hero, this.camera);
    this.reset();
  }

  reset() {
    this.following = true;
    this.way = SIDE.clone().normalize();
    this.zoom = 1;
    this.shift = new THREE.Vector3();
    this.at(this.time ?? 0);
  }

  /** Go along with the film. */
  at(time) {
    this.time = time;
    if (!this.following || !this.path) return;
    const [target, distance] = this.wanted();
    this.moving = true; // our own moves are no turns of the user's
    this.controls.target.copy(target).add(this.shift);
    this.camera.position.copy(this.way).multiplyScalar(distance * this.zoom).add(this.controls.target);
    this.controls.update();
    this.moving = false;
  }

  /** Turn (radians to the side and up) and zoom from the keyboard. */
  turn(side, up, zoom = 1) {
    const place = new THREE.Spherical().setFromVector3(this.camera.position.clone().sub(this.controls.target));
    place.theta += side;
    place.phi = Math.min(Math.max(place.phi - up, 0.05), this.controls.maxPolarAngle);
    place.radius *= zoom;
    this.camera.position.setFromSpherical(place).add(this.controls.target);
    this.controls.update();
  }

  /** Keep what the user has done relative to the path. */
  note() {
    if (!this.path) return;
    const [target, distance] = this.wanted();
    const offset = this.camera.position.clone().sub(this.controls.target);
    this.zoom = offset.length() / distance;
    this.way = offset.normalize();
    this.shift = this.controls.target.clone().sub(target);
  }

  wanted() {
    const exact = Math.min(Math.max(this.time / EVERY, 0), this.path.length - 1);
    const index = Math.min(Math.floor(exact), this.path.length - 1);
    const next = Math.min(index + 1, this.path.length - 1);
    const at = this.path[index].map((value, i) => value + (exact - index) * (this.path[next][i] - value));
    const wide = Math.max(1, 1.25 / this.camera.aspect); // narrow pictures need more distance
    return [new THREE.Vector3(at[0], at[1], at[2]), at[3] * wide];
  }
}

/** Middle and distance, over time, from which the machine and its hero are in the picture. */
function path(film, bodies, hero, camera) {
  const slope = Math.tan(THREE.MathUtils.degToRad(camera.fov / 2));
  const points = [];
  for (let time = 0; time <= film.duration + EVERY; time += EVERY) {
    film.sample(time);
    const place = (body) => new THREE.Vector3().fromArray(film.position, 3 * body);
    const box = new THREE.Box3().expandByPoint(place(hero));
    const root = place(0);
    for (const body of bodies) if (place(body).distanceTo(root) < NEAR) box.expandByPoint(place(body));
    box.expandByScalar(MARGIN);
    const middle = box.getCenter(new THREE.Vector3());
    const size = box.getSize(new THREE.Vector3());
    const reach = Math.max(size.y * 0.56, Math.hypot(size.x, size.z) * 0.35);
    points.push([middle.x, middle.y, middle.z, Math.max(reach / slope, 7)]);
  }
  return points.map((_, index) => {
    const near = points.slice(Math.max(0, index - SMOOTHING), index + SMOOTHING + 1);
    return [0, 1, 2, 3].map((i) => near.reduce((sum, point) => sum + point[i], 0) / near.length);
  });
}
