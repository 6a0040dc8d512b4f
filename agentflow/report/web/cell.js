// A cell of a notebook: one machine in the player, as wide and high as its frame.

import { el } from "./dom.js";
import { Player } from "./player.js";

export function cellPage({ title, machine, shapes, files }) {
  const player = new Player(shapes, files);
  player.show(machine, title, machine.remark);
  return [el("main", { class: "cell" }, player.element)];
}
