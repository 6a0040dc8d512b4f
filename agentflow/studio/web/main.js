// Entry point of the studio: a bar of pages, and the page that the address names after #.

import "../../report/web/player.css";
import "./studio.css";
import { el } from "../../report/web/dom.js";
import { problem } from "../../report/web/text.js";
import { galleryPage, leaderboardPage, resultsPage, tasksPage } from "./boards.js";
import { buildPage } from "./build.js";
import { shortName } from "./list.js";
import { livePage } from "./live.js";
import { curvesPage, pairPage } from "./pair.js";
import { replayPage } from "./replay.js";
import { runsPage } from "./runs.js";
import { sessionsPage } from "./sessions.js";

const PAGES = { runs: runsPage, run: livePage, pair: pairPage, curves: curvesPage, sweep: resultsPage, gallery: galleryPage, leaderboard: leaderboardPage, build: buildPage, tasks: tasksPage, sessions: sessionsPage, replay: replayPage };
const UNDER = { run: "runs", pair: "runs", curves: "runs", replay: "sessions", sweep: "runs" }; // pages that the bar has no entry for
const BAR = { runs: "Runs", tasks: "Tasks", build: "Build", gallery: "Gallery", leaderboard: "Leaderboard", sessions: "Sessions" };
const PATIENCE = 300; // milliseconds that the page before stays while another one loads
let close = () => {};
let asked = 0;

const HOME = location.pathname === "/" ? "" : "/"; // where the pages are, seen from an address that is not there

/** Show the page of the address. A page is a function of the address's fields: {elements, close}. */
async function open() {
  const number = ++asked;
  const [name, query] = location.hash.slice(1).split("?");
  const page = name || (HOME ? "missing" : "runs");
  close();
  close = () => {};
  document.body.dataset.page = page;
  delete document.body.dataset.ready;
  const bar = el("nav", { class: "pages", "aria-label": "Studio" }, el("b", {}, "agentflow", el("span", {}, " studio")),
    ...Object.entries(BAR).map(([key, text]) => el("a", { href: `${HOME}#${key}`, "aria-current": key === (UNDER[page] ?? page) ? "page" : null }, text)));
  // The bar is there at once; a page that takes longer says so.
  const waiting = setTimeout(() => document.body.replaceChildren(bar, el("main", { class: "alone" }, el("p", { class: "quiet", role: "status" }, "Loading …"))), number > 1 ? PATIENCE : 0);
  let made;
  try {
    if (HOME) throw new Error(`There is nothing at the address ${decodeURI(location.pathname)}.`);
    if (!PAGES[page]) throw new Error(`There is no page #${page}.`);
    made = await PAGES[page](Object.fromEntries(new URLSearchParams(query ?? "")));
  } catch (error) {
    const known = PAGES[page] && !HOME;
    made = { elements: [el("main", { class: "alone" }, el("h1", {}, known ? "This page cannot be shown" : "There is no such page"), problem(error.message),
      known ? "" : el("p", {}, "The address may have a mistake. Pages begin with # and a name: ", ...Object.entries(BAR).flatMap(([key, text], index) => [index ? ", " : "", el("a", { href: `${HOME}#${key}` }, text)]), "."),
      el("p", {}, el("a", { class: "button", href: `${HOME}#runs` }, "All runs")))] };
  }
  clearTimeout(waiting);
  if (number !== asked) return made.close?.();
  close = () => made.close?.();
  const heading = made.elements.find((element) => element?.querySelector?.("h1"))?.querySelector("h1").textContent;
  const { run = "", a = run, task = a, sweep = task, session = sweep } = Object.fromEntries(new URLSearchParams(query ?? "")); // so that tabs differ
  document.title = [...new Set([shortName(session), heading ?? BAR[page], "agentflow studio"])].filter(Boolean).join(" · ");
  document.body.replaceChildren(bar, ...made.elements.filter(Boolean));
  scrollTo(0, 0); // else a page begins where the one before was
  document.body.dataset.ready = page;
}

addEventListener("hashchange", open);
open();
