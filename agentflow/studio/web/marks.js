// Marks on the faces of a machine: a disc where something would fit, a cross where it would not.

import * as THREE from "three";

const [FITS, BARRED, POINTED] = [[0.05, 0.62, 0.5], [0.78, 0.24, 0.2], [1, 0.75, 0.1]];
const DISC = 0.22; // radius of a disc, metres
const [ARM, HALF] = [0.26, 0.07]; // of a cross: length and half width of its arms, metres
const ABOVE = 0.03; // distance of a mark from its face, metres
const FRONT = new THREE.Vector3(0, 0, 1);
const CROSS = new THREE.ShapeGeometry(new THREE.Shape([[HALF, HALF], [HALF, ARM], [-HALF, ARM], [-HALF, HALF], [-ARM, HALF], [-ARM, -HALF], [-HALF, -HALF], [-HALF, -ARM],
  [HALF, -ARM], [HALF, -HALF], [ARM, -HALF], [ARM, HALF]].map(([x, y]) => new THREE.Vector2(x, y).rotateAround(new THREE.Vector2(), Math.PI / 4))));
const LOOKS = {
  front: new THREE.MeshBasicMaterial({ transparent: true, opacity: 0.92 }),
  behind: new THREE.MeshBasicMaterial({ transparent: true, opacity: 0.22, depthTest: false, side: THREE.DoubleSide, forceSinglePass: true }), // shines through blocks
};
const SHAPES = [new THREE.CircleGeometry(DISC, 16), CROSS];

export class Marks {
  constructor(scene) {
    this.group = new THREE.Group();
    scene.add(this.group);
    this.show([]);
  }

  /** Mark these faces and no others. */
  show(spots) {
    for (const mesh of this.group.children) mesh.dispose();
    this.group.clear();
    this.kinds = SHAPES.map((shape, index) => new Kind(shape, spots.filter((spot) => Boolean(spot.why_not) === Boolean(index))));
    this.group.add(...this.kinds.flatMap(({ front, behind }) => [front, behind]));
    this.shade(null);
  }

  /** Colour the marks: what fits, what does not, and the one that is pointed at. */
  shade(pointed) {
    this.kinds.forEach((kind) => kind.shade(pointed));
  }

  /** Whether marks behind blocks shine through. */
  setBehind(on) {
    this.kinds.forEach(({ behind }) => (behind.visible = on));
  }

  /** The face whose mark a ray meets: one before a solid at a distance, else one that shines through. */
  under(ray, distance) {
    const nearest = (layer) => this.kinds.flatMap((kind) => kind.hits(ray, layer)).sort((a, b) => a.distance - b.distance)[0];
    const hit = nearest("front");
    return (hit && hit.distance < distance + 2 * ABOVE ? hit : nearest("behind"))?.spot ?? null;
  }

  /** Where the mark of a face is, in the scene. */
  placeOf(block, face) {
    const spots = this.kinds.flatMap(({ spots: held }) => held);
    return new THREE.Vector3().setFromMatrixPosition(standing(spots.find((spot) => spot.block === block && spot.face === face)));
  }
}

/** The marks of one shape. */
class Kind {
  constructor(shape, spots) {
    this.shape = shape;
    this.spots = spots;
    this.front = this.layer("front");
    spots.forEach((spot, index) => this.front.setMatrixAt(index, standing(spot)));
    this.behind = this.layer("behind");
    this.behind.instanceMatrix = this.front.instanceMatrix;
  }

  layer(name) {
    const mesh = new THREE.InstancedMesh(this.shape, LOOKS[name], this.spots.length);
    return Object.assign(mesh, { frustumCulled: false, renderOrder: 2 });
  }

  shade(pointed) {
    if (!this.spots.length) return;
    const color = new THREE.Color();
    this.spots.forEach((spot, index) => this.front.setColorAt(index, color.setRGB(...(spot === pointed ? POINTED : spot.why_not ? BARRED : FITS), THREE.LinearSRGBColorSpace)));
    this.behind.instanceColor = this.front.instanceColor;
    this.front.instanceColor.needsUpdate = true;
  }

  hits(ray, layer) {
    return this.spots.length ? ray.intersectObject(this[layer]).map(({ distance, instanceId }) => ({ distance, spot: this.spots[instanceId] })) : [];
  }
}

/** Where a mark stands and how it is turned. */
function standing({ position: [x, y, z], facing }) {
  const sign = facing[1] === "+" ? 1 : -1;
  const normal = new THREE.Vector3(facing[0] === "x" ? -sign : 0, facing[0] === "y" ? sign : 0, facing[0] === "z" ? sign : 0);
  const turn = new THREE.Quaternion().setFromUnitVectors(FRONT, normal);
  return new THREE.Matrix4().compose(new THREE.Vector3(-x, y, z).addScaledVector(normal, ABOVE), turn, new THREE.Vector3(1, 1, 1));
}
