// The gallery: machines with their scores, one player for all of them. The part of the address
// after # chooses a machine: gallery.html#throwing/3.

import { capitalize, el, section, verifiedText, withUnit } from "./dom.js";
import { Player } from "./player.js";
import { problem, shareText, taskDetails, worthText } from "./text.js";

export function galleryPage(data) {
  const player = new Player(data.shapes, data.files);
  const chosen = el("section", { class: "chosen", "aria-label": "Selected machine" });
  const cards = data.cards.map((card) =>
    el("button", { class: "card", click: () => choose(card) },
      card.picture ? el("img", { src: card.picture, alt: "", width: 320, height: 240 }) : el("span", { class: "blank" }, "no machine"),
      el("b", {}, card.score === null ? "no score" : withUnit(card.verified ?? card.score, card.asked.unit),
        card.score === null ? "" : el("small", { class: card.verified === null ? "unverified" : null }, card.verified === null ? " not verified" : card.fragile ? " verified, fragile" : " verified")),
      el("small", {}, shareText(card.record, card.task, card.asked.unit)),
      el("small", {}, card.about)));
  const tasks = [...Map.groupBy(data.cards, ({ task }) => task)].map(([task, found]) =>
    section(`${task} · ${found[0].asked.title}`, el("p", { class: "quiet" }, `${found[0].asked.objective} ${capitalize(worthText({ ...found[0].asked, record: found[0].record }))}.`),
      el("div", { class: "cards" }, ...found.map((card) => cards[data.cards.indexOf(card)]))));
  const choose = (card) => {
    cards.forEach((item, index) => item.setAttribute("aria-pressed", data.cards[index] === card));
    player.show(data.machines[card.machine], `${card.task} · ${scoreText(card)}`, data.machines[card.machine]?.remark ?? "");
    chosen.replaceChildren(el("h2", {}, `${card.task} · ${scoreText(card)}`), el("p", {}, [card.asked.title, card.run].join(" · ")),
      card.why ? problem(card.why) : "", taskDetails(card.asked));
  };
  const chooseByAddress = () => {
    const wanted = decodeURIComponent(location.hash.slice(1));
    const card = data.cards.find((item) => item.task === wanted) ?? data.cards[0];
    if (card) choose(card);
  };
  addEventListener("hashchange", chooseByAddress);
  chooseByAddress();
  return [
    el("aside", {}, player.element),
    el("main", {},
      el("header", {}, el("p", { class: "kind" }, "agentflow gallery"), el("h1", {}, data.title),
        el("p", { class: "lede" }, "The best machine of each run, by task, best first. Select one to see its film.")),
      chosen, ...tasks),
  ];
}

function scoreText({ score, verified, fragile, asked }) {
  if (score === null) return "no score";
  return withUnit(score, asked.unit) + (verified === null ? "" : ` (verified: ${verifiedText(verified, fragile, asked.unit)})`);
}
