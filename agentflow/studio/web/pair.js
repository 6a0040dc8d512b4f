// The page of two machines, side by side and in step, with the blocks that differ marked.

import { comparePage } from "../../report/web/compare.js";
import { el } from "../../report/web/dom.js";
import { address, ask } from "./api.js";

export async function pairPage({ a, b }) {
  const data = await ask("/api/pair", { a, b });
  const players = [];
  const [main] = comparePage(data, players);
  main.prepend(el("p", { class: "quiet" }, el("a", { href: "#runs" }, "Runs"), " / ",
    el("a", { href: address("run", { run: a }) }, `A: ${a}`), " / ", el("a", { href: address("run", { run: b }) }, `B: ${b}`)));
  return { elements: [main], close: () => players.forEach((player) => player.close()) };
}
