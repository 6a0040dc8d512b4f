// Fields for what controls a machine: one box for each control, sensor, law and output of the JSON text.

import { el } from "../../report/web/dom.js";

// What each kind of law asks for, and what it begins with; other keys have fields where they are set.
export const LAWS = {
  constant: { level: 1 },
  schedule: { points: [[0, 1], [2, 0]] },
  pd: { sensor: "", target: 0, p: 0.1, d: 0 },
  switch: { sensor: "", over: 1, under: 0, on: 1, off: 0 },
  sum: { terms: [{ law: "", weight: 1 }] },
  states: { states: [{ name: "first", law: "", leave: [{ sensor: "", above: 1, to: "second" }] }, { name: "second", law: "" }] },
};
const UNITS = { at: "from, s", for: "for, s", level: "level, -1 to 1", points: "points: [s, level]", p: "p, gain", d: "d, damping" };

/** A name that is not taken yet. */
export function free(kind, taken) {
  for (let number = 1; ; number++) {
    const name = number === 1 ? kind : `${kind}_${number}`;
    if (!(name in taken)) return name;
  }
}

/** @param data what the text says, which the fields change
 *  @param changed is called after each change, with true if other fields come or go with it */
export function controlFields(editor, data, changed) {
  const { sensors: kinds } = editor.start;
  const held = data.controllers ?? {};
  const names = (part) => Object.keys(held[part] ?? {});
  const labelled = (key, input, wide = false) => el("label", { class: wide ? "wide" : null }, UNITS[key] ?? key, input);
  const choice = (key, values, value, pick, again = false) => {
    const select = el("select", { change: () => { pick(select.value); changed(again); } }, ...[...new Set([value, ...values])].filter((item) => item !== undefined).map((item) => el("option", { value: item, selected: item === value ? "" : null }, item)));
    return labelled(key, select, key === "law");
  };
  const text = (key, value, read, wide) => {
    const input = el("input", { value, spellcheck: "false", input: () => {
      try {
        read(input.value);
        input.setCustomValidity("");
      } catch {
        input.setCustomValidity("This cannot be read yet.");
      }
      changed();
    } });
    return labelled(key, input, wide);
  };
  const own = (object, key, usual = object[key]) => {
    const value = object[key];
    if (key === "sensor" || key === "law") return choice(key, names(`${key}s`), value, (name) => { object[key] = name; });
    if (typeof usual !== "number") return text(key, JSON.stringify(value), (words) => { object[key] = JSON.parse(words); }, true);
    const input = el("input", { type: "number", step: "any", value, input: () => {
      if (Number.isFinite(input.valueAsNumber)) object[key] = input.valueAsNumber;
      else delete object[key]; // the check says whether it is missing
      changed();
    } });
    return labelled(key, input);
  };
  const drives = (object) => text("drives blocks, or a group", object.group ?? (object.blocks ?? []).join(", "), (words) => {
    const group = /[a-z]/i.test(words);
    delete object.blocks;
    delete object.group;
    Object.assign(object, group ? { group: words.trim() } : { blocks: words.split(",").filter((part) => part.trim()).map(Number) });
  }, true);
  const box = (title, remove, ...fields) => el("fieldset", {}, el("legend", {}, title, " ", el("button", { type: "button", "aria-label": `Remove ${title}`, click: () => { remove(); changed(true); } }, "×")), ...fields);
  const sensor = ([name, made]) => box(`Sensor ${name}`, () => delete held.sensors[name], choice("kind", Object.keys(kinds), made.kind, (kind) => {
    made.kind = kind;
    if (kinds[kind].axes.includes(made.axis)) return;
    if (kinds[kind].axes.length) [made.axis] = kinds[kind].axes;
    else delete made.axis;
  }, true), made.block === undefined ? "" : own(made, "block"), made.axis === undefined ? "" : choice("axis", kinds[made.kind]?.axes ?? [], made.axis, (axis) => { made.axis = axis; }));
  const law = ([name, made]) => box(`Law ${name}`, () => delete held.laws[name], choice("kind", Object.keys(LAWS), made.kind, (kind) => {
    const { sensor: before = names("sensors")[0] ?? "" } = made;
    held.laws[name] = { kind, ...structuredClone(LAWS[kind]), ...("sensor" in LAWS[kind] ? { sensor: before } : {}) };
  }, true), ...Object.entries({ ...LAWS[made.kind], ...made }).filter(([key]) => key !== "kind").map(([key, usual]) => own(made, key, usual)));
  const at = (list, index) => () => list.splice(index, 1);
  return [
    ...(data.controls ?? []).map((item, index) => box(`Control ${index + 1}`, at(data.controls, index), drives(item), ...["at", "for", "level"].filter((key) => key in item).map((key) => own(item, key)))),
    ...Object.entries(held.sensors ?? {}).map(sensor), ...Object.entries(held.laws ?? {}).map(law),
    ...(held.outputs ?? []).map((item, index) => box(`Output ${index + 1}`, at(held.outputs, index), drives(item), own(item, "law"))),
  ];
}
