// Labels of distances along z+: equally large on screen from any distance, and none over another, cut or hidden.

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
  /** Labels as far as a body gets, from the z at which its score is 0. */
  constructor(film, body, zero) {
    let reach = 10;
    for (let time = 0; time <= film.duration; time += 0.1) {
      film.sample(time);
      reach = Math.max(reach, film.position[3 * body + 2] - zero);
    }
    const every = reach > 60 ? 10 : 5;
    this.group = new THREE.Group();
    const ways = Array.from({ length: 1 + Math.floor(Math.min(reach + every, FARTHEST) / every) }, (_, index) => every * index);
    const rank = (way) => ROUND.findIndex((step) => way % step === 0) >>> 0;
    this.ranked = ways.sort((a, b) => rank(a) - rank(b)).map((way) => label(`${way} m`, [BESIDE, 0, zero + way]));
    this.group.add(...this.ranked);
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

  /** Mark where a score was earned, from that time on: a pole with the score, and the line along which
   *  it was measured. */
  flag({ time, place: [x, , z], words, start }) {
    const bar = (wide, high, long, ...place) => {
      const mesh = new THREE.Mesh(new THREE.BoxGeometry(wide, high, long), new THREE.MeshBasicMaterial({ color: ink }));
      mesh.position.set(...place);
      return mesh;
    };
    const marks = new THREE.Group().add(bar(0.12, POLE, 0.12, -x, POLE / 2, z));
    if (start !== null) {
      marks.add(bar(0.12, 0.01, Math.abs(z - start), -x, 0.02, (z + start) / 2), ...[start, z].map((end) => bar(2, 0.01, 0.12, -x, 0.02, end)));
    }
    this.group.add(marks);
    this.add(words, [-x, POLE, z], 0, time);
    this.ranked[0].userData.marks = marks;
  }

  /** Show those for which there is room at a time, for a canvas of a width and height in CSS pixels. */
  arrange(camera, width, height, time) {
    const size = (2 * Math.tan(THREE.MathUtils.degToRad(camera.fov / 2))) / height; // of a pixel
    const taken = [];
    for (const sprite of this.ranked) {
      const place = sprite.position.clone().project(camera);
      const [x, y] = [(place.x * width) / 2, (place.y * height) / 2];
      const { wide, from = 0 } = sprite.userData;
      const cut = Math.abs(x) + wide / 2 > width / 2 || Math.abs(y) + HEIGHT > height / 2;
      sprite.visible = place.z < 1 && !cut && time >= from && taken.every(([a, b, w]) => Math.abs(x - a) > (w + wide) / 2 || Math.abs(y - b) > HEIGHT);
      if (sprite.userData.marks) sprite.userData.marks.visible = time >= from;
      if (sprite.visible) taken.push([x, y, wide]);
      sprite.scale.set(wide * size, HEIGHT * size, 1);
    }
  }
}

/** A label; in the colours of a page's style, a plate. */
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
  material.depthTest = false; // walls and machines would cut it
  const sprite = new THREE.Sprite(material);
  sprite.center.set(0.5, 1);
  sprite.renderOrder = 4;
  sprite.position.set(...place);
  sprite.userData.wide = width;
  return sprite;
}
