// Prompts and replies as plain text. Long ones open in two steps.

import { el, shown, visible } from "./dom.js";

const SHORT = 2000; // characters that may stand in running text
const LONG = 20000; // characters that are shown at once
const NAMES = { system: "System prompt", user: "Prompt", assistant: "Earlier reply" };

/** A text as it is, with its lines. */
export function plain(text) {
  const block = el("pre", { dir: "ltr", tabindex: "0" }, text.slice(0, LONG));
  if (text.length <= LONG) return block;
  const more = el("button", { click: () => { block.textContent = visible(text); more.remove(); } }, `Show all ${shown(text.length)} characters`);
  return el("div", {}, block, more);
}

/** Why something was refused. */
export function problem(text) {
  return text.length > SHORT ? plain(text) : el("p", { class: "problem" }, text);
}

/** What machines were to do, and how that is counted: `task` as the data have it. */
export function asked({ objective, score, scene }) {
  const list = (sentences) => el("ul", {}, ...sentences.map((sentence) => el("li", {}, sentence)));
  return el("details", { class: "task" }, el("summary", {}, objective, " ", el("small", {}, score[0] ?? "")),
    list(score.slice(1)), el("h3", {}, "Scene and schedule"), list(scene));
}

/** One call that opens: verdict, what was asked and what came back. */
export function call(entry, open = false) {
  const details = el("details", { class: "call", toggle: () => { if (details.open && !body.hasChildNodes()) body.append(...contents(entry)); } },
    el("summary", {}, el("span", { class: `verdict ${entry.valid ? "valid" : "refused"}` }, entry.valid ? "valid" : entry.valid === null ? "no verdict" : "refused"),
      ` ${entry.label} `, el("small", {}, facts(entry))));
  const body = el("div", {});
  details.append(body);
  details.open = open;
  return details;
}

function facts(entry) {
  const parts = [];
  if (entry.repaired) parts.push("JSON repaired");
  if (entry.usage.prompt + entry.usage.completion) parts.push(`${shown(entry.usage.prompt)} + ${shown(entry.usage.completion)} tokens`);
  if (entry.latency) parts.push(`${shown(entry.latency, 1)} s`);
  if (entry.retries) parts.push(`${entry.retries} retries`);
  return parts.join(" · ");
}

function contents(entry) {
  return [
    entry.problem ? problem(entry.problem) : null,
    ...entry.messages.map(({ role, text }) => part(NAMES[role], text, role === "user")),
    entry.reasoning ? part("Reasoning", entry.reasoning, false) : null,
    part("Reply", entry.reply, true),
  ].filter(Boolean);
}

function part(name, text, open) {
  const details = el("details", { class: "said", toggle: () => { if (details.open && details.children.length < 2) details.append(plain(text)); } },
    el("summary", {}, name, " ", el("small", {}, `${shown(text.length)} characters`)));
  details.open = open;
  return details;
}
