// Materials: outlined surfaces, shadows, ground and traces. Only the ground fades into the sky.
// The shaders are simple and have one light, so they are fast even without a GPU.

import * as THREE from "three";

const SUN = "const vec3 sun = normalize(vec3(-5.0, 12.0, -6.0));";

export const surface = new THREE.ShaderMaterial({
  vertexShader: `
    attribute float edged;
    varying vec3 normal_, tint; varying vec2 face; varying float edges;
    void main() {
      mat4 m = modelMatrix * instanceMatrix;
      vec3 s = vec3(dot(m[0].xyz, m[0].xyz), dot(m[1].xyz, m[1].xyz), dot(m[2].xyz, m[2].xyz));
      normal_ = mat3(m) * (normal / max(s, 1e-9));
      tint = instanceColor; face = uv; edges = edged;
      gl_Position = projectionMatrix * viewMatrix * m * vec4(position, 1.0);
    }`,
  fragmentShader: `
    varying vec3 normal_, tint; varying vec2 face; varying float edges;
    ${SUN}
    void main() {
      float light = 0.7 + 0.34 * dot(normalize(normal_), sun);
      vec2 pixel = max(fwidth(face), 1e-6);
      vec2 border = min(face, 1.0 - face) / pixel;
      float line = edges * (1.0 - smoothstep(0.6, 1.6, min(border.x, border.y)));
      line *= clamp(1.2 - 3.0 * max(pixel.x, pixel.y), 0.0, 1.0); // small faces keep their colour
      gl_FragColor = vec4(tint * light * (1.0 - 0.35 * line), 1.0);
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

/** The ground, with lines every 1, 5 and 50 metres from where z is `zero`, as far as they are a few pixels apart. It is clear
 *  up to `clear` metres from the eye and fades into the sky beyond. */
export function ground() {
  const material = new THREE.ShaderMaterial({
    uniforms: { sky: { value: null }, land: { value: null }, line: { value: null }, clear: { value: 0 }, zero: { value: 0 } },
    vertexShader: `
      varying vec3 place;
      void main() {
        place = (modelMatrix * vec4(position, 1.0)).xyz;
        gl_Position = projectionMatrix * viewMatrix * vec4(place, 1.0);
      }`,
    fragmentShader: `
      uniform vec3 sky, land, line; uniform float clear, zero; varying vec3 place;
      float lines(float every) {
        vec2 pixel = fwidth(place.xz) / every;
        vec2 off = 0.5 - abs(fract((place.xz - vec2(0.0, zero)) / every) - 0.5);
        vec2 ink = clamp(1.0 - off / pixel, 0.0, 1.0) * clamp(1.25 - 6.0 * pixel, 0.0, 1.0);
        return max(ink.x, ink.y);
      }
      void main() {
        float far = smoothstep(1.0, 3.5, distance(place, cameraPosition) / clear);
        float ink = max(0.35 * lines(1.0), max(lines(5.0), lines(50.0)));
        gl_FragColor = vec4(mix(mix(land, line, ink), sky, far), 1.0);
      }`,
    depthWrite: false, // labels hang below their places on the ground
  });
  const plane = new THREE.Mesh(new THREE.PlaneGeometry(1600, 1600).rotateX(-Math.PI / 2), material);
  plane.renderOrder = 1; // drawn after the solids, which hide much of it
  return plane;
}

const DOTS = 1 / 60; // seconds between the dots of a trace
const STILL = 0.1; // a body that stays within so many metres does not move

/** Dots along the path of a body; `until` shows them up to a time, and a larger dot where the body
 *  is, so that it is seen from afar; from nearby, the body hides this dot. */
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
  const head = new THREE.Points(new THREE.BufferGeometry().setFromPoints([new THREE.Vector3()]), HEADS[index]);
  head.frustumCulled = false;
  if (index) dots.add(head); // the root block is in the middle of the machine
  dots.until = (time) => {
    geometry.setDrawRange(0, Math.min(Math.floor(time / DOTS) + 1, count));
    head.position.fromArray(film.position, 3 * body);
  };
  return dots;
}

/** Colour of a trace by its index: the root's first, then those of moved bodies. */
export const traceColor = (index) => COLORS[index];

const COLORS = [[0.2, 0.45, 0.7], [0.8, 0.2, 0.13], [0.85, 0.55, 0.05], [0.5, 0.3, 0.65]];
const [TRACES, HEADS] = [4, 8].map((size) => COLORS.map((color) => dot(color, size)));

/** Round dots, with a diameter in pixels. */
function dot(color, size) {
  return new THREE.ShaderMaterial({
    vertexShader: `void main() {
      gl_Position = projectionMatrix * modelViewMatrix * vec4(position, 1.0);
      gl_PointSize = ${size.toFixed(1)};
    }`,
    fragmentShader: `void main() {
      if (length(gl_PointCoord - 0.5) > 0.5) discard;
      gl_FragColor = vec4(${color.join(", ")}, 1.0);
    }`,
  });
}
