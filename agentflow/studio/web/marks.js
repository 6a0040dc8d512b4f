// Marks on the faces of a machine: where something would fit, and where it would not.

import * as THREE from "three";

const [FITS, BARRED, POINTED] = [[0.05, 0.62, 0.5], [0.78, 0.24, 0.2], [1, 0.75, 0.1]];
const DISC = 0.22; // radius of a mark, metres
const ABOVE = 0.03; // distance of a mark from its face, metres
const FRONT = new THREE.Vector3(0, 0, 1);

export class Marks {
  constructor(scene) {
    this.group = new THREE.Group();
    scene.add(this.group);
    this.show([]);
  }

  /** Mark these faces and no others. */
  show(spots) {
    this.spots = spots;
    for (const mesh of this.group.children) [mesh.geometry, mesh.material, mesh].forEach((held) => held.dispose());
    this.group.clear();
    this.front = this.discs({ opacity: 0.92 });
    this.front.renderOrder = 2;
    spots.forEach((spot, index) => this.front.setMatrixAt(index, standing(spot)));
    this.behind = this.discs({ opacity: 0.22, depthTest: false, side: THREE.DoubleSide, forceSinglePass: true }); // shines through blocks
    Object.assign(this.behind, { instanceMatrix: this.front.instanceMatrix, renderOrder: 2 });
    this.group.add(this.front, this.behind);
    this.shade(null);
  }

  discs(look) {
    const mesh = new THREE.InstancedMesh(new THREE.CircleGeometry(DISC, 16), new THREE.MeshBasicMaterial({ transparent: true, ...look }), this.spots.length);
    mesh.frustumCulled = false;
    return mesh;
  }

  /** Colour the marks: what fits, what does not, and the one that is pointed at. */
  shade(pointed) {
    const color = new THREE.Color();
    this.spots.forEach((spot, index) => this.front.setColorAt(index, color.setRGB(...(spot === pointed ? POINTED : spot.why_not ? BARRED : FITS), THREE.LinearSRGBColorSpace)));
    this.behind.instanceColor = this.front.instanceColor;
    if (this.spots.length) this.front.instanceColor.needsUpdate = true;
  }

  /** Whether marks behind blocks shine through. */
  setBehind(on) {
    this.behind.visible = on;
  }

  /** The face whose mark a ray meets: one before a solid at a distance, else one that shines through. */
  under(ray, distance) {
    if (!this.spots.length) return null;
    const [hit] = ray.intersectObject(this.front);
    const found = hit && hit.distance < distance + 2 * ABOVE ? hit : ray.intersectObject(this.behind)[0];
    return found ? this.spots[found.instanceId] : null;
  }

  /** Where the mark of a face is, in the scene. */
  placeOf(block, face) {
    return new THREE.Vector3().setFromMatrixPosition(standing(this.spots.find((spot) => spot.block === block && spot.face === face)));
  }
}

/** Where a mark stands and how it is turned. */
function standing({ position: [x, y, z], facing }) {
  const sign = facing[1] === "+" ? 1 : -1;
  const normal = new THREE.Vector3(facing[0] === "x" ? -sign : 0, facing[0] === "y" ? sign : 0, facing[0] === "z" ? sign : 0);
  const turn = new THREE.Quaternion().setFromUnitVectors(FRONT, normal);
  return new THREE.Matrix4().compose(new THREE.Vector3(-x, y, z).addScaledVector(normal, ABOVE), turn, new THREE.Vector3(1, 1, 1));
}
