// Materials: outlined surfaces, shadows, ground, traces and distance labels.
// The shaders are simple and have one light, so they are fast even without a GPU.

import * as THREE from "three";

const SUN = "const vec3 sun = normalize(vec3(-5.0, 12.0, -6.0));";
const FAR = "float far = smoothstep(60.0, 220.0, distance(place, cameraPosition));";

export const surface = new THREE.ShaderMaterial({
  uniforms: { sky: { value: new THREE.Color() } },
  vertexShader: `
    attribute float edged;
    varying vec3 normal_, tint, place; varying vec2 face; varying float edges;
    void main() {
      mat4 m = modelMatrix * instanceMatrix;
      vec3 s = vec3(dot(m[0].xyz, m[0].xyz), dot(m[1].xyz, m[1].xyz), dot(m[2].xyz, m[2].xyz));
      normal_ = mat3(m) * (normal / max(s, 1e-9));
      tint = instanceColor; face = uv; edges = edged;
      vec4 world = m * vec4(position, 1.0);
      place = world.xyz;
      gl_Position = projectionMatrix * viewMatrix * world;
    }`,
  fragmentShader: `
    uniform vec3 sky;
    varying vec3 normal_, tint, place; varying vec2 face; varying float edges;
    ${SUN}
    void main() {
      float light = 0.7 + 0.34 * dot(normalize(normal_), sun);
      vec2 border = min(face, 1.0 - face) / max(fwidth(face), 1e-6);
      float line = edges * (1.0 - smoothstep(0.6, 1.6, min(border.x, border.y)));
      ${FAR}
      gl_FragColor = vec4(mix(tint * light * (1.0 - 0.35 * line), sky, far), 1.0);
    }`,
});

/** Solids projected onto the ground; the stencil keeps overlapping shadows from darkening twice. */
export const shadows = new THREE.ShaderMaterial({
  uniforms: { shade: { value: new THREE.Color() } },
  vertexShader: `
    ${SUN}
    void main() {
      vec4 world = modelMatrix * instanceMatrix * vec4(position, 1.0);
      world.xyz -= sun * max(world.y, 0.0) / sun.y;
      world.y = 0.004;
      gl_Position = projectionMatrix * viewMatrix * world;
    }`,
  fragmentShader: "uniform vec3 shade; void main() { gl_FragColor = vec4(shade, 0.3); }",
  transparent: true,
  depthWrite: false,
  side: THREE.DoubleSide,
  polygonOffset: true,
  polygonOffsetFactor: -2,
  polygonOffsetUnits: -4,
  stencilWrite: true,
  stencilRef: 1,
  stencilFunc: THREE.NotEqualStencilFunc,
  stencilZPass: THREE.ReplaceStencilOp,
});

/** The ground, with lines every metre nearby and every five metres farther away. */
export function ground() {
  const material = new THREE.ShaderMaterial({
    uniforms: { sky: { value: null }, land: { value: null }, line: { value: null } },
    vertexShader: `
      varying vec3 place;
      void main() {
        place = (modelMatrix * vec4(position, 1.0)).xyz;
        gl_Position = projectionMatrix * viewMatrix * vec4(place, 1.0);
      }`,
    fragmentShader: `
      uniform vec3 sky, land, line; varying vec3 place;
      const vec4 every = vec4(1.0, 1.0, 5.0, 5.0);
      void main() {
        vec4 pixel = fwidth(place.xz).xyxy / every;
        vec4 off = 0.5 - abs(fract(place.xzxz / every) - 0.5);
        vec4 ink = clamp(1.0 - off / pixel, 0.0, 1.0) * clamp(1.25 - 2.5 * pixel, 0.0, 1.0);
        vec3 way = place - cameraPosition;
        float far = clamp(dot(way, way) / 40000.0 - 0.1, 0.0, 1.0);
        float line_ = max(0.35 * max(ink.x, ink.y), max(ink.z, ink.w));
        gl_FragColor = vec4(mix(mix(land, line, line_), sky, far), 1.0);
      }`,
  });
  const plane = new THREE.Mesh(new THREE.PlaneGeometry(1600, 1600).rotateX(-Math.PI / 2), material);
  plane.renderOrder = 1; // drawn after the solids, which hide much of it
  return plane;
}

const DOTS = 1 / 60; // seconds between the dots of a trace
const STILL = 0.1; // a body that stays within so many metres does not move

/** Dots along the path of a body; `until` shows them up to a time. */
export function pathDots(film, body, index) {
  const count = Math.min(Math.ceil(film.duration / DOTS), 6000) + 1;
  const places = new Float32Array(3 * count);
  for (let i = 0; i < count; i++) {
    film.sample(i * DOTS);
    places.set(film.position.subarray(3 * body, 3 * body + 3), 3 * i);
  }
  const geometry = new THREE.BufferGeometry();
  geometry.setAttribute("position", new THREE.BufferAttribute(places, 3));
  geometry.computeBoundingSphere();
  const dots = new THREE.Points(geometry, TRACES[index]);
  dots.frustumCulled = false;
  dots.moved = geometry.boundingSphere.radius > STILL;
  dots.until = (time) => geometry.setDrawRange(0, Math.min(Math.floor(time / DOTS) + 1, count));
  return dots;
}

/** Colour of a trace by its index: the root's first, then those of moved bodies. */
export const traceColor = (index) => COLORS[index];

const COLORS = [[0.2, 0.45, 0.7], [0.8, 0.2, 0.13], [0.85, 0.55, 0.05], [0.5, 0.3, 0.65]];
const TRACES = COLORS.map(
  (color, index) =>
    new THREE.ShaderMaterial({
      vertexShader: `void main() {
        gl_Position = projectionMatrix * modelViewMatrix * vec4(position, 1.0);
        gl_PointSize = ${index ? "4.0" : "3.0"};
      }`,
      fragmentShader: `void main() {
        if (length(gl_PointCoord - 0.5) > 0.5) discard;
        gl_FragColor = vec4(${color.join(", ")}, 1.0);
      }`,
    }),
);

/** Labels of distances along z+, every 5, 10 or 20 metres, as far as the body gets. */
export function distanceLabels(film, body) {
  let reach = 10;
  for (let time = 0; time <= film.duration; time += 0.1) {
    film.sample(time);
    reach = Math.max(reach, film.position[3 * body + 2]);
  }
  const every = reach > 60 ? 20 : reach > 30 ? 10 : 5;
  const group = new THREE.Group();
  for (let z = every; z <= Math.min(reach + every, 400); z += every) group.add(label(`${z} m`, z));
  return group;
}

function label(text, z) {
  const canvas = document.createElement("canvas");
  [canvas.width, canvas.height] = [128, 48];
  const pen = canvas.getContext("2d");
  pen.font = "30px system-ui, sans-serif";
  pen.textAlign = "center";
  pen.fillStyle = "#87908c";
  pen.fillText(text, 64, 34);
  const map = new THREE.CanvasTexture(canvas);
  const sprite = new THREE.Sprite(new THREE.SpriteMaterial({ map, depthWrite: false }));
  sprite.scale.set(2.4, 0.9, 1);
  sprite.position.set(-4, 0.3, z);
  return sprite;
}
