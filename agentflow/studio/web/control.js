// The editor of what controls a machine: fields, and JSON as in a machine file, checked while it is written.

import { el } from "../../report/web/dom.js";
import { send } from "./api.js";
import { controlFields, free, LAWS } from "./fields.js";

const WAIT = 400; // milliseconds after the last key until it is checked
export function controlEditor(editor) {
  const { designed, senses, sensors, laws } = editor.start;
  const text = el("textarea", { class: "json", rows: 12, spellcheck: "false", "aria-label": "Control as JSON", input: () => { changed(); draw(); } });
  const fields = el("div", { class: "fields" });
  const json = el("details", {}, el("summary", {}, "As JSON"), text);
  const problems = el("ul", { class: "problems", "aria-live": "polite" });
  const apply = el("button", { class: "play", disabled: "", click: take }, "Apply");
  const back = el("button", { disabled: "", click: () => show() }, "Discard");
  const option = (value, words) => el("option", { value }, words);
  const parts = el("select", { "aria-label": "Insert", change: () => insert(parts.value) }, option("", "Insert …"),
    ...(senses ? [el("optgroup", { label: "Sensor" }, ...Object.entries(sensors).map(([kind, { text: about, unit }]) => option(`sensors ${kind}`, `${kind}: ${about}${unit ? `, ${unit}` : ""}`))),
      el("optgroup", { label: "Law" }, ...Object.entries(laws).map(([kind, about]) => option(`laws ${kind}`, `${kind}: ${about}`))),
      el("optgroup", { label: "Output" }, option("outputs blocks", "blocks: the selected block follows a law"), option("outputs group", "group: all blocks of a kind, such as motors, follow a law"))] : []),
    option("controls", "control: the selected block runs at a level from one time to another"));
  const element = el("details", { class: "control", open: designed ? "" : null }, el("summary", {}, "Control"),
    el("p", { class: "quiet" }, designed ? "Machines of this task bring their own control: what runs when, and at which level. Example writes one for what this machine has."
      : "This task switches all blocks by its own schedule; machines of it bring no control."),
    ...(designed ? [el("p", {}, parts, " ", el("button", { click: () => insert("example") }, "Example")), fields, problems, json, el("p", {}, apply, " ", back)] : []));
  let timer = null;

  const own = () => {
    const { machine } = editor.state;
    return Array.isArray(machine) ? {} : { controls: machine.controls, controllers: machine.controllers };
  };
  function show() {
    text.value = spell(own());
    draw();
    clearTimeout(timer);
    apply.disabled = back.disabled = true;
    problems.replaceChildren();
  }
  /** Draw the fields of what the text says; a text that is no JSON keeps those before. */
  function draw() {
    let data;
    try {
      data = JSON.parse(text.value || "{}");
      fields.replaceChildren(...controlFields(editor, data, (again) => {
        text.value = spell(data);
        changed();
        if (again) draw();
      }));
    } catch {
      return; // the check says what is wrong
    }
  }
  function changed() {
    apply.disabled = back.disabled = false;
    clearTimeout(timer);
    timer = setTimeout(check, WAIT);
  }
  async function check() {
    const unread = fields.querySelector(":invalid");
    if (unread) {
      const problems = [`${unread.parentElement.firstChild.textContent}: what is written there cannot be read`];
      tell(problems);
      return { problems };
    }
    const asked = text.value;
    try {
      const found = await send("/api/build/control", { ...editor.given, text: asked });
      if (asked === text.value) tell(found.problems ?? []);
      return found;
    } catch (error) {
      tell([error.message]);
      return { problems: [error.message] };
    }
  }
  function tell(found) {
    apply.disabled = found.length > 0;
    const first = found.length && !problems.children.length;
    problems.replaceChildren(...found.map((message) => el("li", { class: "bad" }, message, " ",
      place(message) ? el("button", { click: () => mark(place(message)) }, "Show") : "")));
    if (first) problems.scrollIntoView({ block: "nearest" });
  }
  /** Where in the text a problem is: [begin, end]; null if it is not known. */
  function place(message) {
    const at = message.match(/\(char (\d+)\)/);
    if (at) return [Number(at[1]), Number(at[1]) + 1];
    const [, name] = message.match(/^controllers: \w+\.(\w+)/) ?? message.match(/^(?:sensor|law) (\w+)/) ?? [];
    const begin = name === undefined ? -1 : text.value.indexOf(`"${name}":`);
    return begin < 0 ? null : [begin, begin + name.length + 2];
  }
  function mark([begin, end]) {
    json.open = true;
    text.focus();
    text.setSelectionRange(begin, end);
    text.scrollTop = text.scrollHeight * (text.value.slice(0, begin).split("\n").length / text.value.split("\n").length) - text.clientHeight / 2;
  }
  const held = (data) => Object.assign(data, { controllers: { sensors: {}, laws: {}, outputs: [], ...data.controllers } }).controllers;
  /** Motors that drive the machine back under its top, and against its speed. */
  function balance(data) {
    const { sensors, laws, outputs } = held(data);
    const [lean, speed] = ["lean", "speed"].map((name) => free(name, sensors));
    sensors[lean] = { kind: "tilt", axis: "z" };
    sensors[speed] = { kind: "velocity", axis: "z" };
    const [caught, kept, sum] = ["catch", "keep", "balance"].map((name) => free(name, laws));
    laws[caught] = { kind: "pd", sensor: lean, p: -0.01, d: -0.003 };
    laws[kept] = { kind: "pd", sensor: speed, p: -0.11 };
    laws[sum] = { kind: "sum", terms: [{ law: caught }, { law: kept }] };
    outputs.push({ group: "motors", law: sum });
  }
  /** Motors that turn more slowly the nearer something ahead is; what turns itself does not look ahead. */
  function approach(data) {
    const { blocks } = editor.state;
    const turns = ({ group, name, parents }) => Boolean(group) || /wheel|hinge|joint|cog|propeller|axle/i.test(name) || parents.some((id) => id >= 0 && turns(blocks[id]));
    const [{ id }] = blocks.filter((block) => !turns(block)).sort((a, b) => b.position[2] - a.position[2]);
    const { sensors, laws, outputs } = held(data);
    const [sensor, law] = [free("ahead", sensors), free("approach", laws)];
    sensors[sensor] = { kind: "distance", block: id, axis: "z+" };
    laws[law] = { kind: "pd", sensor, target: 2, p: -0.1 };
    outputs.push({ group: "motors", law });
  }
  function insert(what) {
    parts.value = "";
    let data;
    try {
      data = JSON.parse(text.value || "{}");
    } catch {
      return void check(); // says where it is no JSON
    }
    const [place, kind] = what.split(" ");
    const chosen = editor.chosen;
    if (place === "example") {
      const driven = editor.state.blocks.filter(({ group }) => group);
      if (!driven.length) return tell(["Nothing to control: add a motor or a thruster."]);
      if (senses && driven.some(({ group }) => group === "motors")) (/upright/.test(editor.start.objective) ? balance : approach)(data);
      else (data.controls ??= []).push(...[...Map.groupBy(driven, ({ group }) => group)].map(([group, blocks], at) => ({ blocks: blocks.map(({ id }) => id), at, for: 2, level: +(group !== "grabbers") })));
    } else if (place === "controls") (data.controls ??= []).push({ blocks: [chosen], at: 0, for: 1, level: 1 });
    else {
      const held = (data.controllers ??= { sensors: {}, laws: {}, outputs: [] });
      const last = (names) => Object.keys(held[names] ?? {}).at(-1) ?? "";
      if (place === "outputs") (held.outputs ??= []).push({ ...(kind === "group" ? { group: "motors" } : { blocks: [chosen] }), law: last("laws") });
      else {
        const made = place === "laws" ? { kind, ...JSON.parse(JSON.stringify(LAWS[kind]).replaceAll('"sensor":""', `"sensor":"${last("sensors")}"`).replaceAll('"law":""', `"law":"${last("laws")}"`)) }
          : { kind, ...(kind === "time" ? {} : { block: chosen }), ...(sensors[kind].axes.length ? { axis: sensors[kind].axes[0] } : {}) };
        held[place] ??= {};
        held[place][free(kind, held[place])] = made;
      }
    }
    text.value = spell(data);
    draw();
    changed();
    fields.querySelector("fieldset:last-of-type :is(input, select)")?.focus();
  }
  /** Give the machine the control that is written; false, and said why, if it does not fit. */
  async function take() {
    if (back.disabled) return true;
    let taken = false;
    await editor.queue(async () => {
      const { state, problems: found } = await check();
      if (!state) return editor.say(`The control cannot be applied: ${found[0]}`, true);
      await editor.take(state, "control", editor.chosen);
      show();
      taken = true;
      return editor.say("The machine has this control now; undo brings the one before back.");
    });
    return taken;
  }
  if (designed) editor.settle = take;
  if (designed) editor.on(["state"], () => { if (back.disabled) show(); else check(); });
  return element;
}

/** JSON with an entry a line. */
function spell(data, depth = 0) {
  const list = Array.isArray(data);
  const entries = data && typeof data === "object" ? Object.entries(data).filter(([, value]) => value !== undefined) : [];
  if (depth > 2 || !entries.length) return JSON.stringify(data);
  const lines = entries.map(([key, value]) => `${" ".repeat(depth + 1)}${list ? "" : `${JSON.stringify(key)}: `}${spell(value, list ? 3 : depth + 1)}`);
  return `${list ? "[" : "{"}\n${lines.join(",\n")}\n${" ".repeat(depth)}${list ? "]" : "}"}`;
}
