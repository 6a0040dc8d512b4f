// The page of all runs: a list that grows by itself, filters, and the form of a new design.

import { el, formatNumber, svg, verifiedText } from "../../report/web/dom.js";
import { address, ask, follow } from "./api.js";
import { designForm } from "./design.js";

const MOST = 200; // rows shown at first
const [WIDTH, HEIGHT] = [110, 22]; // of a curve, CSS pixels
const COLUMNS = [
  ["Run", "run"], ["State", "state"], ["Best over time", ""], ["Score", "score"], ["Verified", "verified"],
  ["Task", "task"], ["Workflow", "workflow"], ["Model", "model"], ["Calls", "calls"], ["Started", "begun"],
];
const NUMBERS = new Set(["score", "verified", "calls", "begun"]);

export async function runsPage() {
  const list = new RunList();
  const start = await ask("/api/start");
  const design = el("details", { class: "design" }, el("summary", {}, "New design"), designForm(start));
  const stop = follow({}, (news) => list.hear(news));
  return {
    elements: [el("main", { class: "alone runs" }, el("header", {}, el("h1", {}, "Runs"), el("p", { class: "lede" }, `All runs and sweeps in ${start.runs}.`)), design, ...list.elements)],
    close: stop,
  };
}

class RunList {
  constructor() {
    this.rows = new Map();
    this.key = "begun";
    this.down = true;
    this.chosen = new Set();
    this.most = MOST;
    const changed = { input: () => this.draw() };
    this.words = el("input", { type: "search", placeholder: "Filter by any word", "aria-label": "Filter", ...changed });
    this.pickers = Object.fromEntries(["task", "state", "sweep"].map((key) => [key, el("select", { "aria-label": key, ...changed })]));
    this.count = el("span", { class: "quiet", role: "status" });
    this.compare = el("button", { click: () => this.openPair() }, "Compare 2 runs");
    this.heads = COLUMNS.map(([name, key]) => el("th", { scope: "col", class: NUMBERS.has(key) ? "number" : null }, key ? el("button", { class: "sort", click: () => this.sort(key) }, name) : name));
    this.body = el("tbody", {});
    this.more = el("button", { hidden: "", click: () => { this.most = Infinity; this.draw(); } }, "Show all");
    this.elements = [
      el("div", { class: "filters" }, this.words, ...Object.values(this.pickers), this.count, this.compare),
      el("div", { class: "table", role: "region", tabindex: "0", "aria-label": "Runs" },
        el("table", {}, el("thead", {}, el("tr", {}, el("th", { scope: "col" }, el("span", { class: "unseen" }, "Compare")), ...this.heads)), this.body)),
      this.more,
    ];
    this.draw();
  }

  /** Take in news from a stream. */
  hear({ rows, gone }) {
    for (const row of rows ?? []) this.rows.set(row.run, row);
    for (const name of gone ?? []) this.rows.delete(name);
    for (const [key, picker] of Object.entries(this.pickers)) this.offer(key, picker);
    this.draw();
  }

  offer(key, picker) {
    const values = [...new Set([...this.rows.values()].map((row) => row[key]).filter(Boolean))].sort();
    const before = picker.value;
    picker.replaceChildren(el("option", { value: "" }, `any ${key}`), ...values.map((value) => el("option", { value }, value)));
    picker.value = values.includes(before) ? before : "";
    picker.hidden = !values.length;
  }

  sort(key) {
    this.down = key === this.key ? !this.down : NUMBERS.has(key);
    this.key = key;
    this.draw();
  }

  get found() {
    const words = this.words.value.toLowerCase().split(/\s+/).filter(Boolean);
    const fits = (row) => Object.entries(this.pickers).every(([key, { value }]) => !value || row[key] === value)
      && words.every((word) => [row.run, row.task, row.workflow, row.model, row.state].some((text) => String(text ?? "").toLowerCase().includes(word)));
    const order = (a, b) => {
      const [x, y] = [a[this.key], b[this.key]];
      if (x === null || y === null) return (x === null) - (y === null); // what is unknown stays last
      return (this.down ? -1 : 1) * (typeof x === "number" ? x - y : String(x).localeCompare(String(y)));
    };
    return [...this.rows.values()].filter(fits).sort(order);
  }

  draw() {
    const found = this.found;
    const focused = document.activeElement?.closest?.("tr")?.dataset.run;
    const role = document.activeElement?.tagName;
    this.body.replaceChildren(...found.slice(0, this.most).map((row) => this.line(row)));
    if (!found.length) this.body.replaceChildren(el("tr", {}, el("td", { colspan: COLUMNS.length + 1, class: "quiet" }, this.rows.size ? "No run fits these filters." : "There are no runs here yet.")));
    this.more.hidden = found.length <= this.most;
    const all = this.rows.size === 1 ? "1 run" : `${this.rows.size} runs`;
    this.count.textContent = found.length === this.rows.size ? all : `${found.length} of ${all}`;
    this.compare.disabled = this.chosen.size !== 2;
    this.heads.forEach((head, index) => head.setAttribute("aria-sort", COLUMNS[index][1] !== this.key || !this.key ? "none" : this.down ? "descending" : "ascending"));
    if (focused) [...this.body.rows].find((line) => line.dataset.run === focused)?.querySelector(role.toLowerCase())?.focus();
  }

  line(row) {
    const tick = el("input", { type: "checkbox", "aria-label": `Compare ${row.run}`, change: () => { if (tick.checked) this.chosen.add(row.run); else this.chosen.delete(row.run); this.draw(); } });
    tick.checked = this.chosen.has(row.run);
    const number = (value) => el("td", { class: "number" }, formatNumber(value));
    const text = (value) => el("td", {}, value ?? "–");
    return el("tr", { "data-run": row.run, class: row.state },
      el("td", {}, tick), el("td", {}, el("a", { href: address("run", { run: row.run }) }, row.run)),
      el("td", { title: row.problem }, el("span", { class: `state ${row.state}` }, row.state)),
      el("td", {}, curve(row.curve)), number(row.score), el("td", { class: "number" }, verifiedText(row.verified, row.fragile)),
      text(row.task), text(row.workflow), text(row.model), number(row.calls),
      el("td", { class: "number" }, new Date(1000 * row.begun).toLocaleString("en-GB", { dateStyle: "short", timeStyle: "short" })));
  }

  openPair() {
    const [a, b] = this.chosen;
    location.hash = address("pair", { a, b });
  }
}

/** The best score over time as a line of steps. */
function curve(points) {
  if (!points.length) return "";
  const [last, best] = points.at(-1);
  const low = Math.min(0, points[0][1]);
  const x = (time) => ((WIDTH - 3) * time) / (last || 1);
  const y = (score) => HEIGHT - 2 - ((HEIGHT - 4) * (score - low)) / (best - low || 1);
  const way = points.map(([time, score], index) => (index ? `H${x(time)}V${y(score)}` : `M${x(time)} ${y(score)}`)).join("");
  return svg("svg", { class: "curve", width: WIDTH, height: HEIGHT, role: "img", "aria-label": `best score ${formatNumber(best)}` },
    svg("path", { class: "line", d: `${way}H${WIDTH - 3}` }), svg("circle", { class: "end", cx: WIDTH - 3, cy: y(best), r: 2.4 }));
}
