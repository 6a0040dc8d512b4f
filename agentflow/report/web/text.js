// Prompts and replies as plain text. Long texts are first shown in part.

import { el, formatNumber, revealHidden, table, verifiedText, withUnit } from "./dom.js";

const SHORT = 2000; // longest text shown as a paragraph, characters
const LONG = 20000; // characters shown at first
const NAMES = { system: "System prompt", user: "Prompt", assistant: "Earlier reply", tool: "Result of a tool" };

/** A text with its line breaks. */
export function plain(text) {
  const block = el("pre", { dir: "ltr", tabindex: "0" }, text.slice(0, LONG));
  if (text.length <= LONG) return block;
  const more = el("button", { click: () => { block.textContent = revealHidden(text); more.remove(); } }, `Show all ${formatNumber(text.length)} characters`);
  return el("div", {}, block, more);
}

/** The reason for a refusal. */
export function problem(text) {
  return text.length > SHORT ? plain(text) : el("p", { class: "problem" }, text);
}

export const list = (sentences) => el("ul", {}, ...sentences.map((sentence) => el("li", {}, sentence)));

/** Objective, score, scene and schedule of a task from the report's data. */
export function taskDetails({ objective, score, scene }) {
  return el("details", { class: "task printed" }, el("summary", {}, objective, " ", el("small", {}, score[0] ?? "")),
    list(score.slice(1)), el("h2", {}, "Scene and schedule"), list(scene));
}

const whole = (score) => score.replaceAll(" ", "\u00a0"); // stays in one line

/** What scores of a level are worth: from which one on a machine is good, and the record. */
export function worthText({ good, greatest = null, record, unit = "" }) {
  const most = greatest === null ? "" : greatest === good ? ", the most possible" : ` of at most ${whole(withUnit(greatest, unit))}`;
  return [good && `good from ${whole(withUnit(good, unit))}${most}`, record && `record ${whole(verifiedText(record.verified, record.fragile, unit))}`].filter(Boolean).join(" · ");
}

/** The share that a score reaches, and of what: of the greatest possible score, or else of which record. */
export function shareText(record, level, unit) {
  if (!record || record.share === null) return "";
  const most = record.of.startsWith("record") ? `${whole(withUnit(record.verified, unit))}, the record of ${level} on ${whole(record.engine)}` : `${whole(withUnit(record.full, unit))}, the ${record.of}`;
  return `${formatNumber(100 * record.share, 0)}\u00a0% of ${most}`;
}

/** An expandable call: verdict, prompts and reply. */
export function callDetails(entry, open = false) {
  const details = el("details", { class: "call", toggle: () => { if (details.open && !body.hasChildNodes()) body.append(...contents(entry)); } },
    el("summary", {}, el("span", { class: `verdict ${entry.valid ? "valid" : "refused"}` }, entry.valid ? "valid" : entry.valid === null ? "no verdict" : "rejected"),
      ` ${entry.title} `, el("small", {}, facts(entry))));
  const body = el("div", {});
  details.append(body);
  details.open = open;
  return details;
}

/** An expandable call of a tool: what was sent and what the tool answered. */
export function toolDetails({ label, refused, sent, answer }) {
  return el("details", { class: "call" },
    el("summary", {}, el("span", { class: `verdict ${refused ? "refused" : "valid"}` }, refused ? "refused" : "done"), ` ${label} `),
    sent ? plain(sent) : null, plain(answer));
}

function facts(entry) {
  const parts = [];
  if (entry.repaired) parts.push("JSON repaired");
  if (entry.usage.prompt + entry.usage.completion) parts.push(`${formatNumber(entry.usage.prompt)} + ${formatNumber(entry.usage.completion)} tokens`);
  if (entry.latency) parts.push(`${formatNumber(entry.latency, 1)} s`);
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
    el("summary", {}, name, " ", el("small", {}, `${formatNumber(text.length)} characters`)));
  details.open = open;
  return details;
}

// Beginnings of words that only those know who have read the glossary of the documentation, and what they mean.
const WORDS = {
  trajector: "one of several independent attempts",
  expansion: "a machine of the search is edited",
  "meta designer": "plans which structures to build",
  designer: "builds machines from blocks",
  inspector: "criticises machines",
  querier: "asks what single blocks did",
  refiner: "edits a machine",
  knob: "adjustable parameters of the task",
  "prompt set": "the templates of all prompts",
  broke: "a block came off",
  fragile: "fails under small variations",
  repaired: "with repaired JSON",
  "qd score": "sum of the best scores of all cells",
};
const KNOWN = new RegExp(`\\b(${Object.keys(WORDS).join("|")})\\w*`, "i");

/** Explain such words where somebody points at them; texts of models and controls stay as they are. */
export function explain(part) {
  const walk = document.createTreeWalker(part, NodeFilter.SHOW_TEXT);
  const texts = [];
  while (walk.nextNode()) texts.push(walk.currentNode);
  for (const text of texts) {
    const found = !text.parentElement.closest("pre, svg, button, option") && text.data.match(KNOWN);
    if (!found) continue;
    const word = text.splitText(found.index);
    texts.push(word.splitText(found[0].length));
    word.replaceWith(el("abbr", { title: WORDS[found[1].toLowerCase()] }, found[0]));
  }
  return part;
}

/** Words for how a simulation ended. */
export const STATUS = { ok: "simulated", diverged: "simulation diverged", timeout: "simulation timed out", crashed: "simulation crashed" };

/** Scores of one machine under several variations, and their change against the first, the default. */
export function scoreTable(caption, head, scores) {
  const [first] = scores;
  const change = (item) => {
    if (!first.score || item.score === null || item === first) return null;
    const percent = Math.round(1000 * (item.score / first.score - 1)) / 10 + 0; // no negative zero
    return `${percent > 0 ? "+" : ""}${formatNumber(percent, 1)} %`;
  };
  const name = ({ variation, status }) => (status === "ok" ? variation : `${variation} (${STATUS[status] ?? status})`);
  return table(caption, [head, "Score", "Change"], scores.map((item) => [name(item), item.score, change(item)]));
}
