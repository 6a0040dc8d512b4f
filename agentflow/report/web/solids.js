// The solids of a machine and of its surroundings: where they are at a time, and their colours.
// All solids of a kind are drawn at once, as one instanced mesh, and their shadows as another.

import * as THREE from "three";
import { shadows, surface } from "./materials.js";

/** Index of the body in an object's row. */
export const BODY = 14;

const GEOMETRIES = {
  box: new THREE.BoxGeometry(1, 1, 1),
  sphere: new THREE.SphereGeometry(0.5, 24, 16),
  cylinder: new THREE.CylinderGeometry(0.5, 0.5, 1, 28),
  cone: new THREE.ConeGeometry(0.5, 1, 28),
};
const TALL = 2; // height from which fixed objects can hide the machine, metres
const ROD = 0.18; // diameter of two-ended blocks, metres
const HIDDEN = new THREE.Matrix4().makeScale(0, 0, 0);
const UP = new THREE.Vector3(0, 1, 0);
const ONE = new THREE.Vector3(1, 1, 1);

export class Solids {
  /** `machine` and `shapes` are from the report's data. */
  constructor(machine, shapes) {
    this.parts = [
      ...machine.solids.flatMap((solids, block) => solids.map((index) => part(shapes[index], block, block))),
      ...machine.objects.map((item) => part(item, null, item[BODY])),
    ];
    this.rods = machine.rods.map((rod) => ({ block: rod.block, color: rod.color, ends: rod.ends }));
    this.gone = machine.gone;
    this.groups = makeGroups(this.parts, this.rods.length);
    this.meshes = this.groups.flatMap(({ mesh, shadow }) => [mesh, shadow]);
    this.frame = { position: new THREE.Vector3(), rotation: new THREE.Quaternion() };
    this.matrix = new THREE.Matrix4();
  }

  /** Set all poses and colours for a time at which the film is sampled; `color` gives the colour of a
   *  solid. Walls between the eye and the target are hidden. */
  pose(film, time, color, eye, target) {
    const next = new Map(this.groups.map((group) => [group.kind, 0]));
    for (const item of this.parts) {
      if (item.body !== null) this.place(film, item.body).multiply(item.local);
      else this.matrix.copy(hides(item, eye, target) ? HIDDEN : item.local);
      this.put(next, item.kind, item, color(item));
    }
    for (const rod of this.rods) {
      this.stretch(film, rod, time);
      this.put(next, "cylinder", rod, color(rod));
    }
    for (const group of this.groups) group.flush();
  }

  /** The nearest block that a ray meets: {block, distance}; null if there is none. */
  pick(ray) {
    const hits = this.groups.flatMap(({ mesh, blocks }) => {
      mesh.boundingSphere = null; // of the last pose
      return ray.intersectObject(mesh).map(({ instanceId, distance }) => ({ block: blocks[instanceId], distance }));
    });
    return hits.filter(({ block }) => block !== null).sort((a, b) => a.distance - b.distance)[0] ?? null;
  }

  place(film, body) {
    const { position, rotation } = this.frame;
    position.fromArray(film.position, 3 * body);
    rotation.fromArray(film.rotation, 4 * body);
    return this.matrix.compose(position, rotation, ONE);
  }

  stretch(film, rod, time) {
    const gone = this.gone[rod.block];
    if (gone !== undefined && time >= gone) return this.matrix.copy(HIDDEN);
    const [a, b] = rod.ends.map(([body, x, y, z]) => new THREE.Vector3(-x, y, z).applyMatrix4(this.place(film, body)));
    const along = b.clone().sub(a);
    const length = Math.max(along.length(), 1e-3);
    const turn = new THREE.Quaternion().setFromUnitVectors(UP, along.divideScalar(length));
    return this.matrix.compose(a.add(b).multiplyScalar(0.5), turn, new THREE.Vector3(ROD, length, ROD));
  }

  put(next, kind, { block }, color) {
    const index = next.get(kind);
    this.groups.find((group) => group.kind === kind).put(index, this.matrix, color, block);
    next.set(kind, index + 1);
  }
}

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

/** One solid by itself, from its row; `grown` metres larger on each side. */
export function solidMesh([kind, ...row], material, grown = 0) {
  const mesh = new THREE.Mesh(GEOMETRIES[kind], material);
  mesh.matrix.copy(part([kind, ...row.slice(0, 3).map((side) => side + 2 * grown), ...row.slice(3)], null, null).local);
  mesh.matrixAutoUpdate = false;
  return mesh;
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
    this.blocks = [];
    const geometry = GEOMETRIES[kind].clone();
    const edged = new Float32Array(geometry.attributes.position.count).fill(kind === "box" ? 1 : 0);
    geometry.setAttribute("edged", new THREE.BufferAttribute(edged, 1));
    this.mesh = new THREE.InstancedMesh(geometry, surface, count);
    this.mesh.instanceColor = new THREE.InstancedBufferAttribute(new Float32Array(3 * count), 3);
    this.shadow = new THREE.InstancedMesh(geometry, shadows, count);
    this.shadow.instanceMatrix = this.mesh.instanceMatrix;
    this.mesh.frustumCulled = this.shadow.frustumCulled = false;
  }

  put(index, matrix, color, block) {
    this.blocks[index] = block;
    this.mesh.setMatrixAt(index, matrix);
    this.mesh.instanceColor.array.set(color, 3 * index);
  }

  flush() {
    this.mesh.instanceMatrix.needsUpdate = this.mesh.instanceColor.needsUpdate = true;
  }
}
