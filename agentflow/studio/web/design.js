// The form of a new design: who designs, for which task, and what it will take. Keys come from the environment only.

import { el, formatNumber } from "../../report/web/dom.js";
import { address, send } from "./api.js";
import { goodFrom, levelPicture, taskOptions } from "./boards.js";

const WAIT = 400; // milliseconds after the last change until the estimate is asked for
// Programs that serve models on this computer, with the address that each uses by itself.
const SERVERS = {
  OpenAI: "https://api.openai.com/v1", "Ollama, on this computer": "http://127.0.0.1:11434/v1", "vLLM, on this computer": "http://127.0.0.1:8000/v1",
  "llama.cpp, on this computer": "http://127.0.0.1:8080/v1", "LM Studio, on this computer": "http://127.0.0.1:1234/v1", "Another endpoint": "",
};
const BUILT_IN = "procedural";
const TUNE = "tune"; // the workflow that only improves a given machine

/** A labelled field, and what it means; numbers may stay empty. */
export function field(name, label, input, about = "") {
  input.name = name;
  return el("label", {}, el("span", {}, label), input, about && el("small", {}, about));
}

const number = (hint, least = 1) => el("input", { type: "number", min: least, step: 1, placeholder: hint });
const option = (value, text, chosen) => el("option", { value, selected: chosen ? "" : null }, text);

/** @param start what the server offers
 *  @param fixed fields that are given already, such as the machine to start from
 *  @param begun gets the run; by default its page opens
 *  @param before the fields of an earlier design, which fill the form */
export function designForm(start, fixed = () => ({}), begun = (run) => { location.hash = address("run", { run }); }, before = {}) {
  const given = fixed();
  const tasks = el("select", {}, ...taskOptions(start.tasks, "throwing"));
  const asked = el("div", { class: "asked" });
  const workflows = el("select", {});
  const ask = () => {
    const level = start.tasks.find(({ name }) => name === tasks.value);
    const fit = Object.entries(start.workflows[level.family]).filter(([name]) => name !== TUNE || given.machine);
    workflows.replaceChildren(...fit.map(([name, about]) => option(name, `${name}: ${about}`, name === workflows.value)));
    asked.replaceChildren(levelPicture(level.name), el("p", {}, level.objective, " ", goodFrom(level)));
  };
  tasks.addEventListener("input", ask);
  const told = el("p", { class: "problem", role: "alert" });
  const needs = el("p", { class: "quiet wide", role: "status" });
  const button = el("button", { type: "submit", class: "play" }, given.machine ? "Refine this" : "Start");
  const form = el("form", { class: "form", autocomplete: "off", submit: (event) => { event.preventDefault(); begin(); }, input: () => later() },
    ...modelFields(start, before, () => ({ task: tasks.value, ...read(form), ...fixed() })),
    ...(given.task ? [] : [Object.assign(field("task", "Task", tasks), { className: "who" }), asked]),
    el("details", { class: "wide" }, el("summary", {}, "Advanced"), el("div", { class: "form" },
      Object.assign(field("workflow", "Workflow", workflows, "The steps from the task to a machine"), { className: "wide" }),
      field("seed", "Seed", number("0", 0), "Makes random choices repeatable"),
      field("trajectories", "Attempts", number("8"), "Independent of each other; the best machine of all is the result"),
      field("rounds", "Search rounds", number("5", 0), "How often each attempt edits its machine"),
      field("calls", "Most model calls", number("no limit"), "The run ends when they are used up"),
      field("tokens", "Most tokens", number("no limit"), "Parts of words that models read and write; the run ends when they are used up"))),
    needs, el("p", { class: "wide" }, button), told);
  if (before.task ?? given.task) tasks.value = before.task ?? given.task;
  ask();
  for (const [name, value] of Object.entries(before)) if (form.elements[name]) form.elements[name].value = value;
  const usual = ["task", "model", "base_url", ...(before.workflow === workflows.options[0].value ? ["workflow"] : [])];
  form.querySelector("details").open = Object.keys(before).some((name) => !usual.includes(name));
  let timer = null;
  const later = () => {
    clearTimeout(timer);
    timer = setTimeout(estimate, WAIT);
  };

  async function estimate() {
    if (!form.isConnected) return;
    const wrong = form.querySelector("input:invalid");
    if (wrong) return void (needs.textContent = `${wrong.labels[0].firstChild.textContent}: ${wrong.min ? `a whole number of ${wrong.min} or more` : wrong.validationMessage}`);
    try {
      const filled = { ...read(form), ...fixed() };
      const found = await send("/api/designs/estimate", filled);
      if (form.checkValidity()) needs.textContent = foretell(found, (filled.model ?? start.model) === BUILT_IN, filled);
    } catch (error) {
      needs.textContent = error.message;
    }
  }
  form.addEventListener("focusin", later, { once: true }); // of forms that nobody opens

  async function begin() {
    told.textContent = "";
    button.disabled = true;
    button.textContent = "Starting …";
    const began = performance.now();
    needs.textContent = "Loading agentflow and the physics engine; the page of the run then opens.";
    const tell = () => (button.textContent = `Starting … ${Math.round((performance.now() - began) / 1000)} s`);
    const telling = setInterval(tell, 1000);
    try {
      const { run } = await send("/api/designs", { ...read(form), ...fixed() });
      begun(run);
    } catch (error) {
      told.textContent = error.message;
    } finally {
      clearInterval(telling);
      needs.textContent = "";
      later();
      button.disabled = false;
      button.textContent = given.machine ? "Refine this" : "Start";
    }
  }
  return form;
}

/** Who designs: a preset, and for models of endpoints their name, address and a test. */
function modelFields(start, before, asked) {
  const own = start.model === BUILT_IN ? [] : [option(start.model, `${start.model} (chosen where the studio was started)`, true)];
  const presets = el("select", { change: () => choose() }, ...own, option(BUILT_IN, "Built-in: rules and random choices, no language model", !own.length),
    ...Object.keys(SERVERS).map((name) => option(name, name)));
  const model = el("input", { placeholder: "name of the model", maxlength: 200 });
  const url = el("input", { placeholder: "http://127.0.0.1:8000/v1", maxlength: 400 });
  const said = el("p", { class: "quiet", role: "status" });
  const test = el("button", { type: "button", click: () => connect() }, "Test connection");
  const parts = [field("model", "Model", model, "As the endpoint names it"), field("base_url", "Base URL", url, "Address of the endpoint, mostly up to /v1"),
    el("div", { class: "connect wide" }, test, said, el("small", {}, `The key of an endpoint is read from ${start.key_variable}, where the studio was started.`))];
  const choose = () => {
    const served = presets.value in SERVERS;
    parts.forEach((part) => (part.hidden = !served));
    model.required = served;
    model.value = served ? "" : presets.value === start.model ? "" : presets.value;
    url.value = SERVERS[presets.value] ?? "";
    said.textContent = "";
  };
  let asking = null; // the timer of the question that is open
  const tell = (words, bad = false) => {
    clearInterval(asking);
    asking = null;
    test.textContent = "Test connection";
    said.textContent = words;
    said.className = bad ? "problem" : "quiet";
  };
  async function connect() {
    if (asking) return tell("Cancelled.");
    const began = performance.now();
    const count = () => (said.textContent = `Asking for one small machine … ${Math.round((performance.now() - began) / 1000)} s`);
    tell("");
    const own = (asking = setInterval(count, 1000));
    test.textContent = "Cancel";
    count();
    try {
      const { problem, machine } = await send("/api/designs/connect", asked());
      if (asking === own) tell(problem || `It answers. Its machine: ${machine}`, Boolean(problem));
    } catch (error) {
      if (asking === own) tell(error.message, true);
    }
    return null;
  }
  if (before.model && !before.base_url && [start.model, BUILT_IN].includes(before.model)) presets.value = before.model;
  else if (before.base_url || before.model) {
    presets.value = Object.entries(SERVERS).find(([, at]) => at === before.base_url)?.[0] ?? "Another endpoint";
  }
  choose();
  return [el("label", { class: "who" }, el("span", {}, "Who designs"), presets), ...parts];
}

/** What a design will take; for a model, by its last run here, if there is one. */
function foretell({ calls, simulations, seconds, call_seconds: pause, call_money: price }, builtIn, { base_url: url = "", calls: most }) {
  const work = `About ${formatNumber(simulations)} simulations`;
  if (!calls || builtIn) return `${work}: ${spell(seconds)} on this computer. No language model is asked, so it costs nothing.`;
  const time = pause === null ? "plus the model's time" : `and ${spell(calls * pause)} for the model, which took ${formatNumber(pause, 1)} s a call in its last run here; less where calls overlap`;
  const limit = most || /\/\/(127\.0\.0\.1|localhost)\b/.test(url) ? "" : " Its price is not known here: Most model calls, under Advanced, sets a limit.";
  return `${work} and ${formatNumber(calls)} model calls: ${spell(seconds)} on this computer, ${time}.${price === null ? limit : ` Cost: about ${formatNumber(calls * price)}, at the prices of that run.`}`;
}

/** A time in words, to two figures. */
export function spell(seconds) {
  const [amount, unit] = seconds < 90 ? [seconds, "s"] : seconds < 5400 ? [seconds / 60, "min"] : [seconds / 3600, "h"];
  return `about ${formatNumber(Number(amount.toPrecision(2)), 1)} ${unit}`;
}

/** The fields that are filled in. */
function read(form) {
  const filled = [...form.elements].filter(({ name, value }) => name && value !== "");
  return Object.fromEntries(filled.map(({ name, type, value }) => [name, type === "number" ? Number(value) : value]));
}
