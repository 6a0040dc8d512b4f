// The page of sessions: a form that begins one, and those that are recorded.

import { el, formatNumber, section, table } from "../../report/web/dom.js";
import { problem } from "../../report/web/text.js";
import { ask, send } from "./api.js";
import { field } from "./design.js";

// What a guided session shows unless the person who leads the study writes something else.
const RATIONALE = "Start with the parts that carry the rest. Say what you expect before each test. Change one thing at a time, and ask what the film shows about why the score changed.";

export async function sessionsPage() {
  const [start, open, sessions] = await Promise.all([ask("/api/start"), ask("/api/session"), ask("/api/sessions")]);
  return {
    elements: [el("main", { class: "alone sessions" },
      el("header", {}, el("h1", {}, "Sessions"), el("p", { class: "lede" }, `A session records what a person does while building: every action, test and pause, with the machine after it. Nothing leaves this computer unless you name a model endpoint. Sessions are in ${start.runs}/sessions.`)),
      open ? el("p", {}, `A session on ${open.task} is open. `, el("a", { class: "button", href: "#build" }, "Continue it")) : el("section", { class: "design", "aria-label": "A new session" }, el("h2", {}, "Begin a session"), form(start)),
      list(sessions))],
  };
}

function form(start) {
  const tasks = el("select", {}, ...start.tasks.map(({ name, title }) => el("option", { value: name, selected: name === "movement" ? "" : null }, `${name} · ${title}`)));
  const minutes = el("input", { type: "number", min: 1, max: 1440, step: 1, placeholder: "no limit" });
  const mode = el("select", { change: () => (words.parentElement.hidden = mode.value === "free") }, el("option", { value: "free" }, "free: nothing is shown"), el("option", { value: "guided" }, "guided: a rationale is shown"));
  const words = el("textarea", { rows: 4, maxlength: 20000 });
  words.value = RATIONALE;
  const told = el("p", { class: "problem", role: "alert" });
  const rationale = field("rationale", "Rationale", words);
  rationale.hidden = true;
  rationale.className = "wide";
  return el("form", { class: "form begin", autocomplete: "off", submit: async (event) => {
    event.preventDefault();
    told.textContent = "";
    try {
      const task = tasks.value;
      const { machine } = await ask("/api/build/new", { task });
      await send("/api/session/begin", { task, machine, mode: mode.value, rationale: words.value, limit_s: minutes.value ? 60 * Number(minutes.value) : null });
      location.hash = "build";
    } catch (error) {
      told.textContent = error.message;
    }
  } }, field("task", "Task", tasks), field("minutes", "Time limit, minutes", minutes), field("mode", "Mode", mode), rationale,
  el("p", { class: "wide" }, el("button", { type: "submit", class: "play" }, "Start the session")), told);
}

function list(sessions) {
  if (!sessions.length) return el("p", { class: "quiet" }, "No session is recorded yet.");
  const whole = sessions.filter(({ problem: fault }) => !fault);
  const rows = whole.map(({ session, task, mode, began, seconds, actions, trials, best }) =>
    [session, task, mode, new Date(1000 * began).toLocaleString("en-GB", { dateStyle: "short", timeStyle: "short" }), seconds / 60, actions, trials, best]);
  return section("Recorded sessions",
    rows.length ? table("", ["Session", "Task", "Mode", "Started", "Minutes", "Actions", "Tests", "Best score"], rows) : "",
    ...sessions.filter(({ problem: fault }) => fault).map(({ problem: fault }) => problem(fault)),
    el("p", { class: "quiet" }, "agentflow study metrics, segments and elan read these folders."));
}
