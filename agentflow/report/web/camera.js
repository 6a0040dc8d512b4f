// Where the eye is: it follows what happens, and the user turns, shifts and zooms around that.

import * as THREE from "three";
import { OrbitControls } from "three/examples/jsm/controls/OrbitControls.js";

const SIDE = new THREE.Vector3(-0.86, 0.36, -0.42); // from the right, a little behind and above
const EVERY = 0.1; // seconds between the points of the path
const SMOOTHING = 8; // points on either side that are averaged
const NEAR = 12; // metres around the root that stay in the picture
const FAR = 30; // metres, of what leaves a trace
const MARGIN = 1.3; // metres around the middles of blocks
const FILL = 0.92; // share of the picture that they may take
const NEAREST = 7; // metres

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
  begin(film, hero, traced) {
    this.path = path(film, hero, traced);
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
    const slope = FILL * Math.tan(THREE.MathUtils.degToRad(this.camera.fov / 2));
    const distance = Math.max(at[3] / (slope * this.camera.aspect), at[4] / slope) + at[5];
    return [new THREE.Vector3(at[0], at[1], at[2]), Math.max(distance, NEAREST)];
  }
}

/** Over time, the box around the machine, what is near it, and its hero, as seen from the usual side: its middle, and
 *  half its width, height and depth. */
function path(film, hero, traced) {
  const bodies = Array.from({ length: film.bodies }, (_, body) => body);
  const view = new THREE.Matrix4().lookAt(SIDE, new THREE.Vector3(), new THREE.Vector3(0, 1, 0));
  const back = view.clone().transpose();
  const points = [];
  for (let time = 0; time <= film.duration + EVERY; time += EVERY) {
    film.sample(time);
    const place = (body) => new THREE.Vector3().fromArray(film.position, 3 * body);
    const root = place(0);
    const near = bodies.filter((body) => place(body).distanceTo(root) < (traced.includes(body) ? FAR : NEAR)).map(place);
    const box = new THREE.Box3().setFromPoints([...near, place(hero)].map((point) => point.applyMatrix4(back)));
    const middle = box.getCenter(new THREE.Vector3()).applyMatrix4(view);
    const size = box.expandByScalar(MARGIN).getSize(new THREE.Vector3());
    points.push([...middle.toArray(), size.x / 2, size.y / 2, size.z / 2]);
  }
  return points.map((_, index) => {
    const near = points.slice(Math.max(0, index - SMOOTHING), index + SMOOTHING + 1);
    return points[index].map((_, i) => near.reduce((sum, point) => sum + point[i], 0) / near.length);
  });
}
