// The 3D scene: a machine's solids, its surroundings, ground, shadows and traces.
// player.js keeps the time and sets the poses.

import * as THREE from "three";
import { DistanceLabels, dressLabels } from "./labels.js";
import { ground, pathDots, shadows, surface } from "./materials.js";

const GEOMETRIES = {
  box: new THREE.BoxGeometry(1, 1, 1),
  sphere: new THREE.SphereGeometry(0.5, 24, 16),
  cylinder: new THREE.CylinderGeometry(0.5, 0.5, 1, 28),
  cone: new THREE.ConeGeometry(0.5, 1, 28),
};
const TALL = 2; // height from which fixed objects can hide the machine, metres
const CLEAR = 60; // least distance up to which the ground is clear, metres
const ROD = 0.18; // diameter of two-ended blocks, metres
const BROKEN = [0.85, 0.1, 0.1];
const HIDDEN = new THREE.Matrix4().makeScale(0, 0, 0);
const UP = new THREE.Vector3(0, 1, 0);

export class Picture {
  constructor(canvas) {
    this.renderer = new THREE.WebGLRenderer({ canvas, antialias: hasGpu(), stencil: true });
    this.scene = new THREE.Scene();
    this.camera = new THREE.PerspectiveCamera(32, 1, 0.1, 2000);
    this.scene.add((this.ground = ground()));
    this.stage = new THREE.Group();
    this.scene.add(this.stage);
    this.frame = { position: new THREE.Vector3(), rotation: new THREE.Quaternion() };
    this.matrix = new THREE.Matrix4();
  }

  /** Read the colours from the page's style. */
  dress(style) {
    const color = (name) => new THREE.Color().setStyle(style.getPropertyValue(name).trim(), THREE.LinearSRGBColorSpace);
    this.renderer.setClearColor(new THREE.Color().setStyle(style.getPropertyValue("--sky").trim()), 1);
    this.ground.material.uniforms.sky.value = color("--sky");
    this.ground.material.uniforms.land.value = color("--land");
    this.ground.material.uniforms.line.value = color("--line");
    shadows.uniforms.shade.value = color("--shade");
    dressLabels(style.getPropertyValue("--quiet").trim());
  }

  /** Show another machine; `machine` and `shapes` are from the report's data. */
  show(machine, shapes, film) {
    this.stage.clear();
    this.machine = machine;
    this.parts = [
      ...machine.solids.flatMap((solids, block) => solids.map((index) => part(shapes[index], block, block))),
      ...machine.things.map((thing) => part(thing, null, thing[THING_BODY])),
    ];
    this.rods = machine.rods.map((rod) => ({ block: rod.block, color: rod.color, ends: rod.ends }));
    this.groups = makeGroups(this.parts, this.rods.length);
    for (const group of this.groups) this.stage.add(group.mesh, group.shadow);
    this.traces = machine.traces.map(({ body }, index) => pathDots(film, body, index));
    this.labels = new DistanceLabels(film, machine.hero);
    this.stage.add(...this.traces, this.labels.group);
  }

  /** Set all poses for a time, mark broken blocks, and hide walls in front of the target. */
  pose(film, time, byLoad, target) {
    film.sample(time);
    const loads = byLoad ? greatestLoads(this.machine.connections, film.load) : null;
    const next = new Map(this.groups.map((group) => [group.kind, 0]));
    for (const item of this.parts) {
      if (item.body !== null) this.place(film, item.body).multiply(item.local);
      else this.matrix.copy(hides(item, this.camera.position, target) ? HIDDEN : item.local);
      this.put(next, item.kind, this.tint(item, time, loads));
    }
    for (const rod of this.rods) {
      this.stretch(film, rod, time);
      this.put(next, "cylinder", this.tint(rod, time, loads));
    }
    for (const group of this.groups) group.flush();
    for (const trace of this.traces) trace.until(time);
    this.widen(this.camera.position.distanceTo(target));
  }

  /** Keep the ground clear, and depths exact, around a target at a distance. */
  widen(distance) {
    this.ground.material.uniforms.clear.value = Math.max(CLEAR, 1.6 * distance);
    this.ground.scale.setScalar(Math.max(1, distance / 100));
    this.camera.near = Math.max(0.1, distance / 100);
    this.camera.far = Math.max(2000, 20 * distance);
    this.camera.updateProjectionMatrix();
  }

  draw() {
    this.camera.updateMatrixWorld();
    const { x, y } = this.renderer.getSize(new THREE.Vector2());
    this.labels.arrange(this.camera, x, y);
    this.renderer.render(this.scene, this.camera);
  }

  /** Fit the canvas; a share below 1 renders fewer pixels and lets the browser scale them up. */
  resize(width, height, share = 1) {
    this.renderer.setPixelRatio(share * Math.min(window.devicePixelRatio, 2));
    this.renderer.setSize(width, height, false);
    this.camera.aspect = width / height;
    this.camera.updateProjectionMatrix();
  }

  place(film, body) {
    const { position, rotation } = this.frame;
    position.fromArray(film.position, 3 * body);
    rotation.fromArray(film.rotation, 4 * body);
    return this.matrix.compose(position, rotation, ONE);
  }

  stretch(film, rod, time) {
    const gone = this.machine.gone[rod.block];
    if (gone !== undefined && time >= gone) return this.matrix.copy(HIDDEN);
    const [a, b] = rod.ends.map(([body, x, y, z]) => new THREE.Vector3(-x, y, z).applyMatrix4(this.place(film, body)));
    const along = b.clone().sub(a);
    const length = Math.max(along.length(), 1e-3);
    const turn = new THREE.Quaternion().setFromUnitVectors(UP, along.divideScalar(length));
    return this.matrix.compose(a.add(b).multiplyScalar(0.5), turn, new THREE.Vector3(ROD, length, ROD));
  }

  put(next, kind, color) {
    const index = next.get(kind);
    this.groups.find((group) => group.kind === kind).put(index, this.matrix, color);
    next.set(kind, index + 1);
  }

  tint(item, time, loads) {
    if (item.block === null) return item.color;
    const broken = this.machine.breaks[item.block];
    if (broken !== undefined && time >= broken) return BROKEN;
    return loads ? heat(loads.get(item.block)) : item.color;
  }
}

/** Colour of a load: from grey at 0 through amber to nearly red at 1, where it breaks. */
export function heat(load) {
  if (load === undefined) return [0.62, 0.64, 0.66];
  const stops = [[0.6, 0.66, 0.7], [0.55, 0.72, 0.6], [0.93, 0.77, 0.3], [0.88, 0.42, 0.16]];
  const place = Math.min(Math.max(load, 0), 1) * (stops.length - 1);
  const from = Math.min(Math.floor(place), stops.length - 2);
  return stops[from].map((value, i) => value + (place - from) * (stops[from + 1][i] - value));
}

/** Whether there is a GPU; without one, antialiasing would halve the frame rate. */
function hasGpu() {
  const context = document.createElement("canvas").getContext("webgl2");
  const info = context?.getExtension("WEBGL_debug_renderer_info");
  const name = info ? context.getParameter(info.UNMASKED_RENDERER_WEBGL) : "";
  context?.getExtension("WEBGL_lose_context")?.loseContext();
  return !/swiftshader|llvmpipe|softpipe|basic render/i.test(name);
}

const ONE = new THREE.Vector3(1, 1, 1);
const THING_BODY = 14;

/** Whether a wall, taken as infinitely high, stands between the eye and the target (not under it). */
function hides({ wall }, eye, target) {
  if (!wall) return false;
  const from = eye.clone().applyMatrix4(wall);
  const way = target.clone().applyMatrix4(wall).sub(from);
  let [enters, leaves] = [0, 1];
  for (const axis of ["x", "z"]) {
    const sides = [(-0.5 - from[axis]) / way[axis], (0.5 - from[axis]) / way[axis]];
    enters = Math.max(enters, Math.min(...sides));
    leaves = Math.min(leaves, Math.max(...sides));
  }
  return enters < leaves && leaves < 1;
}

/** A solid from its row: kind, size, position, rotation, colour (and the body of an object). */
function part([kind, sx, sy, sz, x, y, z, i, j, k, w, ...rest], block, body) {
  const local = new THREE.Matrix4().compose(
    new THREE.Vector3(-x, y, z),
    new THREE.Quaternion(i, -j, -k, w),
    new THREE.Vector3(sx, sy, sz),
  );
  const upright = Math.abs(local.elements[5]) > 0.999 * sy; // its y axis is vertical
  const wall = block === null && body == null && sy > TALL && upright ? local.clone().invert() : null;
  return { kind, local, block, body: body ?? null, wall, color: rest.slice(0, 3) };
}

/** One instanced mesh with shadow per kind of solid. */
function makeGroups(parts, rods) {
  const counts = new Map();
  for (const item of parts) counts.set(item.kind, (counts.get(item.kind) ?? 0) + 1);
  if (rods) counts.set("cylinder", (counts.get("cylinder") ?? 0) + rods);
  return [...counts].map(([kind, count]) => new Group(kind, count));
}

class Group {
  constructor(kind, count) {
    this.kind = kind;
    const geometry = GEOMETRIES[kind].clone();
    const edged = new Float32Array(geometry.attributes.position.count).fill(kind === "box" ? 1 : 0);
    geometry.setAttribute("edged", new THREE.BufferAttribute(edged, 1));
    this.mesh = new THREE.InstancedMesh(geometry, surface, count);
    this.mesh.instanceColor = new THREE.InstancedBufferAttribute(new Float32Array(3 * count), 3);
    this.shadow = new THREE.InstancedMesh(geometry, shadows, count);
    this.shadow.instanceMatrix = this.mesh.instanceMatrix;
    this.mesh.frustumCulled = this.shadow.frustumCulled = false;
  }

  put(index, matrix, color) {
    this.mesh.setMatrixAt(index, matrix);
    this.mesh.instanceColor.array.set(color, 3 * index);
  }

  flush() {
    this.mesh.instanceMatrix.needsUpdate = this.mesh.instanceColor.needsUpdate = true;
  }
}

/** Greatest load of each block's connections. */
function greatestLoads(connections, load) {
  const found = new Map();
  connections.forEach((block, row) => found.set(block, Math.max(found.get(block) ?? 0, load[row])));
  return found;
}
