// The page of sessions: a form that begins one, and those that are recorded.

import { el, formatNumber, section, table, withUnit } from "../../report/web/dom.js";
import { problem } from "../../report/web/text.js";
import { address, ask, send } from "./api.js";
import { taskOptions } from "./boards.js";
import { field } from "./design.js";
import { moment } from "./list.js";

const CONSENT = "agentflow consent text"; // what the browser keeps the last one under

// What a guided session shows unless the person who leads the study writes something else.
const RATIONALE = "Start with the parts that carry the rest. Say what you expect before each test. Change one thing at a time, and ask what the film shows about why the score changed.";

export async function sessionsPage() {
  const [start, open, sessions] = await Promise.all([ask("/api/start"), ask("/api/session"), ask("/api/sessions")]);
  return {
    elements: [el("main", { class: "alone sessions" },
      el("header", {}, el("h1", {}, "Sessions"), el("p", { class: "lede" }, `A session records what a person does while building: every action, test and pause, with the machine after it. Nothing leaves this computer unless you name a model endpoint. Sessions are in ${start.runs}/sessions.`)),
      open ? el("p", {}, `A session on ${open.task} is open. `, el("a", { class: "button", href: "#build" }, "Continue it")) : el("section", { class: "design", "aria-label": "A new session" }, el("h2", {}, "Begin a session"), form(start)),
      list(sessions, new Map(start.tasks.map(({ name, unit }) => [name, unit]))))],
  };
}

function form(start) {
  const tasks = el("select", {}, ...taskOptions(start.tasks, "movement"));
  const minutes = el("input", { type: "number", min: 1, max: 1440, step: 1, placeholder: "no limit" });
  const mode = el("select", { change: () => (words.parentElement.hidden = mode.value === "free") }, el("option", { value: "free" }, "free: without advice"), el("option", { value: "guided" }, "guided: with a rationale"));
  const words = el("textarea", { rows: 4, maxlength: 20000 });
  words.value = RATIONALE;
  const code = el("input", { pattern: "[A-Za-z0-9_\\-]*", maxlength: 40, placeholder: "none", title: "Letters, digits, - and _" });
  const consent = el("textarea", { rows: 3, maxlength: 20000, placeholder: "What is recorded, who reads it, and that one can stop at any time. Empty: none is shown." });
  consent.value = localStorage.getItem(CONSENT) ?? "";
  const refine = el("select", {}, el("option", { value: "yes" }, "offered"), el("option", { value: "" }, "not offered"));
  const told = el("p", { class: "problem", role: "alert" });
  const rationale = wide(field("rationale", "Rationale", words));
  rationale.hidden = true;
  return el("form", { class: "form begin", autocomplete: "off", submit: async (event) => {
    event.preventDefault();
    told.textContent = "";
    localStorage.setItem(CONSENT, consent.value);
    const agreed = !consent.value.trim() || (await agrees(consent.value));
    if (!agreed) return void (told.textContent = "The person has not agreed, so nothing has started and nothing is recorded.");
    try {
      const task = tasks.value;
      const { machine } = await ask("/api/build/new", { task });
      await send("/api/session/begin", { task, machine, mode: mode.value, rationale: words.value, limit_s: minutes.value ? 60 * Number(minutes.value) : null,
        participant: code.value, consent: consent.value, agreed, refine: Boolean(refine.value) });
      location.hash = "build";
    } catch (error) {
      told.textContent = error.message;
    }
  } }, field("task", "Task", tasks), field("participant", "Participant code", code), field("minutes", "Time limit, minutes", minutes), field("mode", "Mode", mode), field("refine", "Refine this (a model's help)", refine),
  rationale, wide(field("consent", "Consent text, shown before the start", consent)),
  el("p", { class: "wide" }, el("button", { type: "submit", class: "play" }, "Start the session")), told);
}

function wide(label) {
  label.className = "wide";
  return label;
}

/** Show the consent text; resolves to whether the person agrees. */
function agrees(text) {
  return new Promise((done) => {
    const answer = (value, words) => el("button", { type: "button", class: value ? "play" : null, click: () => { said = value; asked.close(); } }, words);
    let said = false;
    const asked = el("dialog", { class: "ended", "aria-label": "Before you begin", close: () => { asked.remove(); done(said); } }, el("h2", {}, "Before you begin"),
      ...text.split("\n").filter(Boolean).map((line) => el("p", {}, line)), el("p", { class: "actions" }, answer(true, "I agree"), answer(false, "I do not agree")));
    document.body.append(asked);
    asked.showModal();
  });
}

function list(sessions, units) {
  if (!sessions.length) return el("p", { class: "quiet" }, "No session is recorded yet.");
  const whole = sessions.filter(({ problem: fault }) => !fault);
  const rows = whole.map(({ session, task, mode, participant, began, seconds, actions, trials, best }) =>
    [el("a", { href: address("replay", { session }) }, session), participant || "–", task, mode, moment(began), formatNumber(seconds / 60, 1), formatNumber(actions), formatNumber(trials), withUnit(best, units.get(task))]);
  return section("Recorded sessions",
    rows.length ? table("", ["Session", "Participant", "Task", "Mode", "Started", "Minutes", "Actions", "Tests", "Best score"], rows, 5) : "",
    ...sessions.filter(({ problem: fault }) => fault).map(({ problem: fault }) => problem(fault)),
    el("p", { class: "quiet" }, "agentflow study reads these folders: metrics, segments, and annotations for ELAN."));
}
