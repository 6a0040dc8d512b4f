// The 3D scene: ground, solids, traces and labels, drawn from a camera. Others keep the time and move the camera.

import * as THREE from "three";
import { colorsAt } from "./colors.js";
import { DistanceLabels, dressLabels } from "./labels.js";
import { ground, pathDots, shadows } from "./materials.js";
import { Solids } from "./solids.js";

const CLEAR = 60; // least distance up to which the ground is clear, metres

export class Picture {
  constructor(canvas) {
    this.renderer = new THREE.WebGLRenderer({ canvas, antialias: hasGpu(), stencil: true });
    this.scene = new THREE.Scene();
    this.camera = new THREE.PerspectiveCamera(32, 1, 0.1, 2000);
    this.scene.add((this.ground = ground()));
    this.stage = new THREE.Group();
    this.scene.add(this.stage);
  }

  /** Read the colours from the page's style. */
  dress(style) {
    const color = (name) => new THREE.Color().setStyle(style.getPropertyValue(name).trim(), THREE.LinearSRGBColorSpace);
    this.renderer.setClearColor(new THREE.Color().setStyle(style.getPropertyValue("--sky").trim()), 1);
    this.ground.material.uniforms.sky.value = color("--sky");
    this.ground.material.uniforms.land.value = color("--land");
    this.ground.material.uniforms.line.value = color("--line");
    shadows.uniforms.shade.value = color("--shade");
    dressLabels(style.getPropertyValue("--quiet").trim());
  }

  /** Show another machine; `machine` and `shapes` are from the report's data. */
  show(machine, shapes, film) {
    this.stage.clear();
    this.machine = machine;
    this.solids = new Solids(machine, shapes);
    this.traces = machine.traces.map(({ body }, index) => pathDots(film, body, index));
    const zero = machine.flag?.start ?? 0;
    this.ground.material.uniforms.zero.value = zero;
    this.labels = new DistanceLabels(film, machine.hero, zero);
    if (machine.flag) this.labels.flag(machine.flag);
    this.stage.add(...this.solids.meshes, ...this.traces, this.labels.group);
  }

  /** Set all poses and colours for a time, and hide walls in front of the target. */
  pose(film, time, byLoad, target) {
    film.sample(time);
    const color = colorsAt(this.machine, time, byLoad ? film.load : null, this.paint);
    this.solids.pose(film, time, color, this.camera.position, target);
    for (const trace of this.traces) trace.until(time);
    this.widen(this.camera.position.distanceTo(target));
    this.time = time;
  }

  /** Keep the ground clear, and depths exact, around a target at a distance. */
  widen(distance) {
    this.ground.material.uniforms.clear.value = Math.max(CLEAR, 1.6 * distance);
    this.ground.scale.setScalar(Math.max(1, distance / 100));
    this.camera.near = Math.max(0.1, distance / 100);
    this.camera.far = Math.max(2000, 20 * distance);
    this.camera.updateProjectionMatrix();
  }

  draw() {
    this.camera.updateMatrixWorld();
    const { x, y } = this.renderer.getSize(new THREE.Vector2());
    this.labels.arrange(this.camera, x, y, this.time);
    this.renderer.render(this.scene, this.camera);
  }

  /** Fit the canvas; a share below 1 renders fewer pixels and lets the browser scale them up. */
  resize(width, height, share = 1) {
    this.renderer.setPixelRatio(share * Math.min(window.devicePixelRatio, 2));
    this.renderer.setSize(width, height, false);
    this.camera.aspect = width / height;
    this.camera.updateProjectionMatrix();
  }

  /** Give its memory back. */
  close() {
    const quiet = (event) => event.stopImmediatePropagation(); // three.js would report the loss
    this.renderer.domElement.addEventListener("webglcontextlost", quiet, true);
    this.renderer.forceContextLoss();
  }
}

/** Whether there is a GPU; without one, antialiasing would halve the frame rate. */
function hasGpu() {
  const context = document.createElement("canvas").getContext("webgl2");
  const info = context?.getExtension("WEBGL_debug_renderer_info");
  const name = info ? context.getParameter(info.UNMASKED_RENDERER_WEBGL) : "";
  context?.getExtension("WEBGL_lose_context")?.loseContext();
  return !/swiftshader|llvmpipe|softpipe|basic render/i.test(name);
}
