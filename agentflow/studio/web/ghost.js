// A block as it would be at a face: as glass, red where it does not fit, with the way that its motor turns.

import * as THREE from "three";
import { solidMesh } from "../../report/web/solids.js";

const [GLASS, RADIUS, TUBE, HEAD] = [0.5, 0.85, 0.06, 0.2]; // opacity; metres
const REACH = 1.5 * Math.PI; // of the arrow around an axis, radians
const FRONT = new THREE.Vector3(0, 0, 1);

/** The solids of a block, and the arrow of its motor. */
export function ghostOf({ solids, turn }, fits) {
  const group = new THREE.Group();
  const look = { transparent: true, opacity: GLASS, depthWrite: false };
  for (const row of solids) {
    const color = new THREE.Color().setRGB(...(fits ? row.slice(11, 14) : [0.78, 0.15, 0.12]), THREE.LinearSRGBColorSpace);
    group.add(solidMesh(row, new THREE.MeshBasicMaterial({ color, ...look })));
  }
  if (turn) group.add(turningArrow(turn));
  return group;
}

/** An arrow around an axis: from the world's left-handed frame, where x is mirrored. */
function turningArrow({ at: [x, y, z], axis: [a, b, c] }) {
  const material = new THREE.MeshBasicMaterial({ color: 0xffc21a, depthTest: false, transparent: true });
  const head = new THREE.Mesh(new THREE.ConeGeometry(HEAD, 2 * HEAD, 16), material);
  head.position.set(RADIUS * Math.cos(REACH), RADIUS * Math.sin(REACH), 0);
  head.rotation.z = REACH;
  const arrow = new THREE.Group().add(new THREE.Mesh(new THREE.TorusGeometry(RADIUS, TUBE, 8, 48, REACH), material), head);
  arrow.quaternion.setFromUnitVectors(FRONT, new THREE.Vector3(a, -b, -c).normalize());
  arrow.position.set(-x, y, z);
  arrow.children.forEach((mesh) => (mesh.renderOrder = 4));
  return arrow;
}
