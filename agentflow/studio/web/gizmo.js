// Where forward is: the axes in a corner of the 3D view, each a button that looks along it; an arrow on
// the ground; and the level around the machine.

import * as THREE from "three";
import { el } from "../../report/web/dom.js";
import { solidMesh } from "../../report/web/solids.js";

const ARM = 32; // pixels from the middle to an axis
const VIEWS = { "x+": [-1, 0, 0, "the right"], "x-": [1, 0, 0, "the left"], "y+": [0, 1, -0.01, "above"], "z+": [0, 0, 1, "the front"], "z-": [0, 0, -1, "behind"] };
const TIP = 1.2; // metres from the arrow's end to its tip
const ARROW = [[-0.1, 0], [-0.1, 0.7], [-0.3, 0.7], [0, TIP], [0.3, 0.7], [0.1, 0.7], [0.1, 0]]; // metres to the side and forward
const AHEAD = 0.5; // metres from the machine to the arrow
/** Metres from the machine to the tip of the arrow. */
export const WAY_AHEAD = AHEAD + TIP;
const GLASS = 0.28; // opacity of the level
const FAR = 60; // metres up to which the level is framed

export class Gizmo {
  /** @param look gets the direction from the machine to the eye */
  constructor(look) {
    this.axes = Object.entries(VIEWS).map(([name, [x, y, z, from]]) => {
      const axis = new THREE.Vector3(x, y, z).normalize();
      return [el("button", { type: "button", class: `axis ${name[0]}`, title: `Look from ${from}`, click: () => look(axis) }, name), axis];
    });
    this.element = el("div", { class: "gizmo", role: "group", "aria-label": "Views" }, ...this.axes.map(([button]) => button));
  }

  /** Turn with the camera. */
  turn(camera) {
    const back = camera.quaternion.clone().invert();
    for (const [button, axis] of this.axes) {
      const { x, y, z } = axis.clone().applyQuaternion(back);
      button.style.transform = `translate(${ARM * x}px, ${-ARM * y}px)`;
      button.style.zIndex = Math.round(10 * z) + 10;
    }
  }
}

/** The arrow on the ground in front of a machine, and where its words are. */
export function forwardArrow({ middle: [x, , z], size }, color) {
  const shape = new THREE.Shape(ARROW.map(([across, along]) => new THREE.Vector2(across, along)));
  const mesh = new THREE.Mesh(new THREE.ShapeGeometry(shape), new THREE.MeshBasicMaterial({ color, side: THREE.DoubleSide }));
  mesh.rotation.x = Math.PI / 2;
  mesh.position.set(-x, 0.03, z + size[2] / 2 + AHEAD);
  return [mesh, [-x, 0, mesh.position.z + TIP / 2]];
}

/** The objects of a level as glass, around where the machine is. */
export function levelGhosts({ level, start }) {
  const group = new THREE.Group();
  for (const row of level) {
    const color = new THREE.Color().setRGB(...row.slice(11, 14), THREE.LinearSRGBColorSpace);
    group.add(solidMesh(row, new THREE.MeshBasicMaterial({ color, transparent: true, opacity: GLASS, depthWrite: false })));
  }
  const [i, j, k, w] = start.rotation;
  group.quaternion.set(i, -j, -k, w).invert();
  group.down = new THREE.Vector3(0, -start.height, 0).applyQuaternion(group.quaternion);
  return group;
}

/** The box of a level, a machine and the way ahead, as the camera frames it; what is endless counts up to a limit. */
export function framed(group, { middle: [x, , z], size: [width, height, length] }) {
  group.updateMatrixWorld(true);
  const box = new THREE.Box3().setFromObject(group).expandByPoint(new THREE.Vector3(-x - width / 2, 0, z - length / 2)).expandByPoint(new THREE.Vector3(-x + width / 2, height, z + length / 2 + 8));
  box.intersect(new THREE.Box3(new THREE.Vector3(-FAR, 0, -FAR / 3), new THREE.Vector3(FAR, FAR, 2 * FAR)));
  const [middle, size] = [box.getCenter(new THREE.Vector3()), box.getSize(new THREE.Vector3())];
  const across = Math.hypot(size.x, size.z) / 2;
  return [...middle, across, Math.max(size.y, across) / 2, across / 2];
}
