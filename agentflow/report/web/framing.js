// What the camera frames: a smooth path of boxes around the action, and one box around the whole course.

import * as THREE from "three";
import { BODY } from "./solids.js";

const SIDE = new THREE.Vector3(-0.86, 0.36, -0.42).normalize(); // from the right, a little behind and above
const ABOVE = new THREE.Vector3(-0.5, 0.85, -0.25).normalize(); // for flat machines
const FLAT = 0.2; // ratio of height to width below which a machine is flat
const EVERY = 0.1; // seconds between the points of the path
const SMOOTHING = 4; // number of points on either side to average
const NEAR = 12; // blocks within so many metres of the root stay in the picture
const FAR = 30; // the same for bodies with a trace
const WIDEST = 40; // largest objects that the wide view includes, metres
const MARGIN = 0.4; // metres
const ENDING = 1; // seconds in which the view widens at the end

/** Boxes are rows of six numbers: the centre in the world, then half the extents in the camera's frame, metres. */
export class Framing {
  constructor(film, machine, shapes) {
    const found = corners(machine, shapes);
    this.side = isFlat(film, found) ? ABOVE : SIDE; // the direction to look from at first
    const frame = new THREE.Matrix4().lookAt(this.side, new THREE.Vector3(), new THREE.Vector3(0, 1, 0));
    const boxes = boxesOverTime(film, machine, found, frame.clone().transpose());
    this.path = smoothPath(boxes, frame);
    this.whole = centreAndHalfSize(boxOfAll(boxes, machine, frame.clone().transpose()), frame);
    if (!machine.hero && machine.flag) this.path = endWide(this.path, this.whole);
  }

  /** The box around the action at a time. */
  at(time) {
    const exact = Math.min(Math.max(time / EVERY, 0), this.path.length - 1);
    const index = Math.min(Math.floor(exact), this.path.length - 1);
    const next = Math.min(index + 1, this.path.length - 1);
    return this.path[index].map((value, i) => value + (exact - index) * (this.path[next][i] - value));
  }
}

/** Corners of each body's bounding box in its own frame: blocks, then moving objects. */
function corners(machine, shapes) {
  const found = machine.solids.map((solids) => cornersOfBox(new THREE.Box3().setFromPoints(solids.flatMap((index) => cornersOfObject(shapes[index])))));
  for (const item of machine.objects) if (item[BODY] !== null) found[item[BODY]] = cornersOfObject(item);
  return found;
}

function cornersOfObject([, sx, sy, sz, x, y, z, i, j, k, w]) {
  const turn = new THREE.Quaternion(i, -j, -k, w);
  return EIGHT.map(([a, b, c]) => new THREE.Vector3(a * sx, b * sy, c * sz).applyQuaternion(turn).add(new THREE.Vector3(-x, y, z)));
}

/** The eight corners of a box; [] if it is empty. */
function cornersOfBox(box) {
  if (box.isEmpty()) return [];
  const [size, at] = [box.getSize(new THREE.Vector3()), box.getCenter(new THREE.Vector3())];
  return EIGHT.map((corner) => new THREE.Vector3(...corner).multiply(size).add(at));
}

const EIGHT = [-0.5, 0.5].flatMap((a) => [-0.5, 0.5].flatMap((b) => [-0.5, 0.5].map((c) => [a, b, c])));

/** Whether the machine is flat at the start. */
function isFlat(film, found) {
  film.sample(0);
  const size = new THREE.Box3();
  found.forEach((points, body) => expandBox(size, film, body, points, new THREE.Matrix4()));
  const { x, y, z } = size.getSize(new THREE.Vector3());
  return y < FLAT * Math.min(x, z);
}

/** For each moment, the box around the bodies near the root and the way of the tracked body, in the camera's frame. */
function boxesOverTime(film, { hero, traces, flag }, found, back) {
  const flown = new THREE.Box3(); // the way of a boulder until it lands
  const traced = traces.map(({ body }) => body);
  const boxes = [];
  for (let time = 0; time <= film.duration + EVERY; time += EVERY) {
    film.sample(time);
    const place = (body) => new THREE.Vector3().fromArray(film.position, 3 * body);
    const root = place(0);
    const box = new THREE.Box3();
    found.forEach((points, body) => {
      const near = place(body).distanceTo(root) < (traced.includes(body) ? FAR : NEAR);
      const followed = body === hero && time <= (flag?.time ?? Infinity);
      if (near || (followed && !hero)) expandBox(box, film, body, points, back);
      if (followed && hero) expandBox(flown, film, body, points, back);
    });
    boxes.push(box.union(flown));
  }
  return boxes;
}

const CORNER = new THREE.Vector3();

function expandBox(box, film, body, points, back) {
  const place = new THREE.Vector3().fromArray(film.position, 3 * body);
  const turn = new THREE.Quaternion().fromArray(film.rotation, 4 * body);
  const whole = new THREE.Matrix4().compose(place, turn, new THREE.Vector3(1, 1, 1)).premultiply(back);
  for (const point of points) box.expandByPoint(CORNER.copy(point).applyMatrix4(whole));
}

/** The union of all boxes and of the fixed objects that are not too wide. */
function boxOfAll(boxes, machine, back) {
  const all = boxes.reduce((sum, box) => sum.union(box), new THREE.Box3());
  for (const item of machine.objects) {
    if (item[BODY] !== null || Math.max(item[1], item[3]) > WIDEST) continue;
    for (const point of cornersOfObject(item)) all.expandByPoint(point.applyMatrix4(back));
  }
  return all;
}

/** Centre of a box in the world, and half its extents in the camera's frame. */
function centreAndHalfSize(box, frame) {
  const at = box.getCenter(new THREE.Vector3()).applyMatrix4(frame);
  return [...at, ...box.clone().expandByScalar(MARGIN).getSize(new THREE.Vector3()).multiplyScalar(0.5)];
}

/** A smooth path: averaged centres, and sizes that still contain everything. */
function smoothPath(boxes, frame) {
  const exact = boxes.map((box) => box.getCenter(new THREE.Vector3()));
  const middles = exact.map((_, index) => {
    const reach = Math.min(SMOOTHING, index, exact.length - 1 - index); // symmetric, so that it does not lag
    const near = exact.slice(index - reach, index + reach + 1);
    return near.reduce((sum, point) => sum.add(point), new THREE.Vector3()).divideScalar(near.length);
  });
  const needed = boxes.map((box, index) => {
    const size = box.clone().expandByScalar(MARGIN).getSize(new THREE.Vector3()).multiplyScalar(0.5);
    return ["x", "y", "z"].map((axis) => size[axis] + Math.abs(middles[index][axis] - exact[index][axis]));
  });
  const sizes = slideWindow(slideWindow(needed, (values) => Math.max(...values)), (values) => values.reduce((a, b) => a + b) / values.length);
  return middles.map((point, index) => [...point.applyMatrix4(frame), ...sizes[index]]);
}

/** A path that ends with the whole course, from where the machine started to where it got. */
function endWide(path, whole) {
  return path.map((row, index) => {
    const share = THREE.MathUtils.smoothstep(index * EVERY, (path.length - 1) * EVERY - ENDING, (path.length - 1) * EVERY);
    return row.map((value, axis) => value + share * (whole[axis] - value));
  });
}

/** Apply a function to each number and its neighbours in time. */
function slideWindow(rows, make) {
  return rows.map((row, index) => {
    const near = rows.slice(Math.max(0, index - SMOOTHING), index + SMOOTHING + 1);
    return row.map((_, axis) => make(near.map((other) => other[axis])));
  });
}
