// The gallery: machines with their scores, one player for all of them.

import { el, shown } from "./dom.js";
import { Player } from "./player.js";

export function galleryPage(data) {
  const player = new Player(data.shapes);
  const cards = data.cards.map((card) =>
    el("button", { class: "card", click: () => choose(card) },
      card.picture ? el("img", { src: card.picture, alt: "", loading: "lazy", width: 320, height: 240 }) : el("span", { class: "blank" }, "no machine"),
      el("b", {}, card.score === null ? "no score" : shown(card.score)),
      el("span", {}, card.task),
      el("small", {}, card.about)));
  const choose = (card) => {
    cards.forEach((item, index) => item.setAttribute("aria-pressed", data.cards[index] === card));
    player.show(data.machines[card.machine], card.score === null ? card.task : `${card.task} · ${shown(card.score)}`, data.machines[card.machine]?.remark ?? "");
  };
  if (data.cards.length) choose(data.cards[0]);
  return [
    el("aside", {}, player.element),
    el("main", {},
      el("header", {}, el("p", { class: "kind" }, "agentflow gallery"), el("h1", {}, data.title),
        el("p", { class: "lede" }, "Choose a machine to see it at work.")),
      el("div", { class: "cards" }, ...cards)),
  ];
}
