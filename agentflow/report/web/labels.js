// Labels of distances along z+: equally large on screen from any distance, and none over another.

import * as THREE from "three";

const [WIDTH, HEIGHT] = [52, 18]; // of a label, CSS pixels
const LETTERS = 13; // size of its letters, CSS pixels
const SHARPNESS = 3; // pixels of its texture per CSS pixel
const BESIDE = -4; // x at which they stand: to the right of the course, metres
const FARTHEST = 400; // metres
const ROUND = [100, 50, 10]; // multiples of these come first where there is not room for all
const ink = new THREE.Color();

/** Set the colour of all labels. */
export const dressLabels = (style) => ink.setStyle(style);

export class DistanceLabels {
  /** Labels as far as a body gets. */
  constructor(film, body) {
    let reach = 10;
    for (let time = 0; time <= film.duration; time += 0.1) {
      film.sample(time);
      reach = Math.max(reach, film.position[3 * body + 2]);
    }
    const every = reach > 60 ? 10 : 5;
    this.group = new THREE.Group();
    for (let z = every; z <= Math.min(reach + every, FARTHEST); z += every) this.group.add(label(z));
    const rank = ({ position: { z } }) => ROUND.findIndex((step) => z % step === 0) >>> 0;
    this.ranked = [...this.group.children].sort((a, b) => rank(a) - rank(b));
  }

  /** Show those for which there is room, for a canvas of a width and height in CSS pixels. */
  arrange(camera, width, height) {
    const size = (2 * Math.tan(THREE.MathUtils.degToRad(camera.fov / 2))) / height; // of a pixel
    const taken = [];
    for (const sprite of this.ranked) {
      const place = sprite.position.clone().project(camera);
      const [x, y] = [(place.x * width) / 2, (place.y * height) / 2];
      sprite.visible = place.z < 1 && taken.every(([a, b]) => Math.abs(x - a) > WIDTH || Math.abs(y - b) > HEIGHT);
      if (sprite.visible) taken.push([x, y]);
      sprite.scale.set(WIDTH * size, HEIGHT * size, 1);
    }
  }
}

function label(z) {
  const canvas = document.createElement("canvas");
  [canvas.width, canvas.height] = [SHARPNESS * WIDTH, SHARPNESS * HEIGHT];
  const pen = canvas.getContext("2d");
  pen.font = `${SHARPNESS * LETTERS}px system-ui, sans-serif`;
  [pen.textAlign, pen.textBaseline, pen.fillStyle] = ["center", "middle", "white"];
  pen.fillText(`${z} m`, canvas.width / 2, canvas.height / 2);
  const material = new THREE.SpriteMaterial({ map: new THREE.CanvasTexture(canvas), depthWrite: false, sizeAttenuation: false });
  material.color = ink; // the same for all
  const sprite = new THREE.Sprite(material);
  sprite.center.set(0.5, 1);
  sprite.position.set(BESIDE, 0, z);
  return sprite;
}
