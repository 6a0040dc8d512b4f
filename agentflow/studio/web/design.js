// The form of a new design: task, workflow, model and budget. Keys come from the environment only.

import { el } from "../../report/web/dom.js";
import { address, send } from "./api.js";

/** A labelled field; numbers may stay empty. */
export function field(name, label, input) {
  input.name = name;
  return el("label", {}, el("span", {}, label), input);
}

const number = (hint, least = 1) => el("input", { type: "number", min: least, step: 1, placeholder: hint });

/** @param start what the server offers
 *  @param fixed fields that are given already, such as the machine to start from
 *  @param begun gets the run; by default its page opens */
export function designForm(start, fixed = () => ({}), begun = (run) => { location.hash = address("run", { run }); }) {
  const given = fixed();
  const tasks = el("select", {}, ...start.tasks.map(({ name, title }) => el("option", { value: name, selected: name === "throwing" ? "" : null }, `${name} · ${title}`)));
  const workflows = el("select", {}, ...start.workflows.map((name) => el("option", { value: name }, name)));
  const told = el("p", { class: "problem", role: "alert" });
  const button = el("button", { type: "submit", class: "play" }, given.machine ? "Refine this" : "Start");
  const form = el("form", { class: "form", autocomplete: "off", submit: (event) => { event.preventDefault(); begin(); } },
    given.task ? "" : field("task", "Task", tasks),
    field("workflow", "Workflow", workflows),
    field("model", "Model", el("input", { placeholder: start.model, maxlength: 200 })),
    field("base_url", "Base URL", el("input", { placeholder: "http://127.0.0.1:8000/v1", maxlength: 400 })),
    field("seed", "Seed", number("0", 0)),
    field("trajectories", "Trajectories", number("8")),
    field("rounds", "Search rounds", number("5", 0)),
    field("calls", "Max calls", number("no limit")),
    field("tokens", "Max tokens", number("no limit")),
    el("p", { class: "quiet wide" }, `${start.model === "procedural" ? "Without a model, procedural answers: rules and random choices, not a language model. " : ""}The key of an endpoint is read from ${start.key_variable}, where the studio was started.`),
    el("p", { class: "wide" }, button), told);

  async function begin() {
    told.textContent = "";
    button.disabled = true;
    try {
      const { run } = await send("/api/designs", { ...read(form), ...fixed() });
      begun(run);
    } catch (error) {
      told.textContent = error.message;
    } finally {
      button.disabled = false;
    }
  }
  return form;
}

/** The fields that are filled in. */
function read(form) {
  const filled = [...form.elements].filter(({ name, value }) => name && value !== "");
  return Object.fromEntries(filled.map(({ name, type, value }) => [name, type === "number" ? Number(value) : value]));
}
