// Buttons that save the files of a machine.

import { el } from "./dom.js";
import { inflate } from "./film.js";

const NAMES = { ".json": "JSON", ".bsg": "Besiege", ".glb": "3D model", ".csv": "parts list", ".html": "instructions", ".step": "CAD", ".3mf": "3D print" };
/** What a file is called on its button: what it is for. */
export const fileName = (name) => NAMES[name.slice(name.lastIndexOf("."))];

/** A button for each file: name -> where its content begins and ends in what `packed` gives. */
export function downloads(files, packed) {
  return Object.entries(files).map(([name, place]) =>
    el("button", { title: name, click: async () => save(name, (await inflate(packed())).slice(...place)) }, fileName(name)));
}

/** Save content as a file. */
export function save(name, content) {
  const url = URL.createObjectURL(new Blob([content]));
  el("a", { href: url, download: name }).click();
  setTimeout(() => URL.revokeObjectURL(url), 1000);
}
