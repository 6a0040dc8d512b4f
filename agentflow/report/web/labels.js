// Labels of distances along z+: equally large on screen from any distance, and none over another.

import * as THREE from "three";

const [WIDTH, HEIGHT] = [52, 18]; // of a label of a distance, CSS pixels
const LETTERS = 13; // size of its letters, CSS pixels
const SHARPNESS = 3; // pixels of its texture per CSS pixel
const BESIDE = -4; // x at which they stand: to the right of the course, metres
const FARTHEST = 400; // metres
const POLE = 2.2; // height of a flag, metres
const ROUND = [100, 50, 10]; // multiples of these come first where there is not room for all
const ink = new THREE.Color();

/** Set the colour of all labels. */
export const dressLabels = (style) => ink.setStyle(style);

export class DistanceLabels {
  /** Labels as far as a body gets, of distances from z = `origin`. */
  constructor(film, body, origin) {
    let reach = 10;
    for (let time = 0; time <= film.duration; time += 0.1) {
      film.sample(time);
      reach = Math.max(reach, film.position[3 * body + 2]);
    }
    const every = reach > 60 ? 10 : 5;
    this.group = new THREE.Group();
    for (let far = every; far <= Math.min(reach + every, FARTHEST); far += every) this.group.add(label(`${far} m`, [BESIDE, 0, origin + far]));
    if (origin) this.group.add(label("0 m", [BESIDE, 0, origin]));
    const rank = ({ position: { z } }) => ROUND.findIndex((step) => Math.round(z - origin) % step === 0) >>> 0;
    this.ranked = [...this.group.children].sort((a, b) => rank(a) - rank(b));
  }

  /** Add a plate that comes before all labels, `up` of its heights above a place; `from` is the time from
   *  which it is seen, seconds. */
  add(text, place, up, from = 0) {
    const sprite = label(text, place, WIDTH * Math.max(1, text.length / 6), getComputedStyle(document.documentElement));
    sprite.userData.from = from;
    sprite.renderOrder = 5;
    sprite.center.y = -up;
    this.group.add(sprite);
    this.ranked.unshift(sprite);
  }

  /** Mark where a score was earned, from that time on: a pole with the score. */
  flag({ time, place: [x, , z], words }) {
    const pole = new THREE.Mesh(new THREE.CylinderGeometry(0.06, 0.06, POLE), new THREE.MeshBasicMaterial({ color: ink }));
    pole.position.set(-x, POLE / 2, z);
    this.group.add(pole);
    this.add(words, [-x, POLE, z], 0, time);
    this.ranked[0].userData.pole = pole;
  }

  /** Show those for which there is room at a time, for a canvas of a width and height in CSS pixels. */
  arrange(camera, width, height, time) {
    const size = (2 * Math.tan(THREE.MathUtils.degToRad(camera.fov / 2))) / height; // of a pixel
    const taken = [];
    for (const sprite of this.ranked) {
      const place = sprite.position.clone().project(camera);
      const [x, y] = [(place.x * width) / 2, (place.y * height) / 2];
      const { wide, from = 0 } = sprite.userData;
      sprite.visible = place.z < 1 && time >= from && taken.every(([a, b, w]) => Math.abs(x - a) > (w + wide) / 2 || Math.abs(y - b) > HEIGHT);
      if (sprite.userData.pole) sprite.userData.pole.visible = time >= from;
      if (sprite.visible) taken.push([x, y, wide]);
      sprite.scale.set(wide * size, HEIGHT * size, 1);
    }
  }
}

/** A label; in the colours of a page's style, a plate that nothing hides. */
function label(text, place, width = WIDTH, style = null) {
  const canvas = document.createElement("canvas");
  [canvas.width, canvas.height] = [SHARPNESS * width, SHARPNESS * HEIGHT];
  const pen = canvas.getContext("2d");
  pen.font = `${SHARPNESS * LETTERS}px system-ui, sans-serif`;
  if (style) {
    pen.fillStyle = style.getPropertyValue("--paper");
    pen.fillRect(0, 0, canvas.width, canvas.height);
  }
  [pen.textAlign, pen.textBaseline, pen.fillStyle] = ["center", "middle", style?.getPropertyValue("--ink") ?? "white"];
  pen.fillText(text, canvas.width / 2, canvas.height / 2);
  const material = new THREE.SpriteMaterial({ map: new THREE.CanvasTexture(canvas), depthWrite: false, sizeAttenuation: false });
  if (!style) material.color = ink; // the same for all
  else material.map.colorSpace = THREE.SRGBColorSpace;
  material.depthTest = !style;
  const sprite = new THREE.Sprite(material);
  sprite.center.set(0.5, 1);
  sprite.position.set(...place);
  sprite.userData.wide = width;
  return sprite;
}
