// The list of runs: one line each, filters that the address holds, and sweeps folded into one line.

import { el, formatNumber, svg, verifiedText, withUnit } from "../../report/web/dom.js";
import { shareText } from "../../report/web/text.js";
import { address } from "./api.js";

const MOST = 200; // rows shown at first
const STEP = 40; // rows drawn at once: more would hold up the page
const [WIDTH, HEIGHT] = [150, 28]; // of a curve, CSS pixels where there is room
const COLUMNS = [
  ["", ""], ["Run", "run"], ["State", "state"], ["Best over time", ""], ["Score", "score"], ["Verified", "verified"], ["Share", "share", "Verified score, else score, divided by the greatest possible score or, if there is none, by the record"],
  ["Task", "task"], ["Workflow", "workflow"], ["Model", "model"], ["Calls", "calls"], ["Took", "seconds"], ["Started", "begun"],
];
const NUMBERS = new Set(["score", "share", "verified", "calls", "seconds", "begun"]);
const FILTERS = ["task", "state", "sweep"];

export class RunList {
  /** @param fields filters and order as the address has them */
  constructor({ words = "", sort = "begun", down = "yes", ...values }) {
    this.rows = new Map();
    this.lines = new Map(); // what is drawn of a row, and the row
    this.key = sort;
    this.down = down === "yes";
    this.values = values; // chosen before the rows came that offer them
    this.chosen = new Set();
    this.unfolded = new Set();
    this.most = MOST;
    const changed = { input: () => this.changed() };
    this.words = searchField(words, changed);
    this.pickers = Object.fromEntries(FILTERS.map((key) => [key, el("select", { "aria-label": key, ...changed })]));
    this.count = el("span", { class: "quiet", role: "status" });
    this.compare = el("button", { click: () => this.open() }, "Tick two to compare");
    this.heads = COLUMNS.map(([name, key, title]) => el("th", { scope: "col", title, class: NUMBERS.has(key) ? `number ${key === "score" ? "reached" : key}` : key }, key ? el("button", { class: "sort", click: () => this.sort(key) }, name) : name || el("span", { class: "unseen" }, "Picture")));
    this.body = el("tbody", {});
    this.more = el("button", { hidden: "", click: () => { this.most = Infinity; this.draw(); } }, "Show all");
    this.elements = [
      el("div", { class: "filters" }, this.words, ...Object.values(this.pickers), this.count, this.compare),
      el("div", { class: "table", role: "region", tabindex: "0", "aria-label": "Runs" },
        el("table", { class: "lines" }, el("thead", {}, el("tr", {}, el("th", { scope: "col" }, el("span", { class: "unseen" }, "Compare")), ...this.heads)), this.body)),
      this.more,
    ];
  }

  /** Take in news from a stream. */
  hear({ rows, gone, left }) {
    this.left = left;
    for (const row of rows ?? []) this.rows.set(row.run, row);
    for (const name of gone ?? []) this.rows.delete(name);
    for (const [key, picker] of Object.entries(this.pickers)) this.offer(key, picker);
    this.draw();
  }

  offer(key, picker) {
    const wanted = picker.options.length ? picker.value : this.values[key] ?? "";
    const values = [...new Set([...this.rows.values()].map((row) => row[key]).filter(Boolean).concat(wanted || []))].sort();
    picker.replaceChildren(el("option", { value: "" }, `any ${key}`), ...values.map((value) => el("option", { value }, value)));
    picker.value = wanted;
    picker.hidden = !values.length;
  }

  sort(key) {
    this.down = key === this.key ? !this.down : NUMBERS.has(key);
    this.key = key;
    this.changed();
  }

  /** Keep filters and order in the address, so that they can be shared and outlive a reload. */
  changed() {
    keep("runs", { words: this.words.value, sort: this.key === "begun" ? "" : this.key, down: this.down ? "" : "no", ...Object.fromEntries(FILTERS.map((key) => [key, this.pickers[key].value])) });
    this.draw();
  }

  clear() {
    for (const filter of [this.words, ...Object.values(this.pickers)]) filter.value = "";
    this.changed();
  }

  get found() {
    const fits = (row) => Object.entries(this.pickers).every(([key, { value }]) => !value || row[key] === value)
      && holds(this.words.value, [row.run, row.task, row.workflow, row.model, row.state]);
    const order = (a, b) => {
      const [x, y] = [a[this.key] ?? null, b[this.key] ?? null];
      if (x === null || y === null) return (x === null) - (y === null); // what is unknown stays last
      return (this.down ? -1 : 1) * (typeof x === "number" ? x - y : String(x).localeCompare(String(y)));
    };
    return [...this.rows.values()].filter(fits).sort(order);
  }

  draw() {
    const found = this.found;
    const focused = document.activeElement;
    const all = this.folded(found).slice(0, this.most);
    const lines = all.slice(0, this.body.children.length + STEP).map((line) => line());
    clearTimeout(this.rest);
    if (lines.length < all.length) this.rest = setTimeout(() => this.draw());
    lines.forEach((line, index) => line === this.body.children[index] || this.body.insertBefore(line, this.body.children[index] ?? null));
    while (this.body.children.length > lines.length) this.body.lastChild.remove();
    if (!lines.length) this.body.replaceChildren(el("tr", {}, el("td", { colspan: COLUMNS.length + 1, class: "quiet" }, "No run fits these filters. ", el("button", { click: () => this.clear() }, "Clear filters"))));
    if (focused?.isConnected && focused !== document.body) focused.focus(); // lines that move lose it
    this.more.hidden = found.length <= this.most;
    const runs = this.rows.size === 1 ? "1 run" : `${this.rows.size} runs`;
    const pair = [...this.chosen].map((name) => this.rows.get(name)).filter(Boolean);
    const differ = pair.some(({ task }) => task !== pair[0].task);
    this.count.textContent = (found.length === this.rows.size ? runs : `${found.length} of ${runs}`) + (this.left ? `, reading ${this.left} more` : "");
    this.compare.disabled = pair.length < 2 || differ;
    this.compare.textContent = differ ? "Only for runs of one task" : pair.length > 1 ? `Compare ${pair.length} runs` : "Tick two to compare";
    this.heads.forEach((head, index) => head.setAttribute("aria-sort", COLUMNS[index][1] !== this.key || !this.key ? "none" : this.down ? "descending" : "ascending"));
  }

  /** What makes a line, for each run; the runs of a sweep are behind one line unless it was unfolded or filters are set. */
  folded(found) {
    if (this.words.value || FILTERS.some((key) => this.pickers[key].value)) return found.map((row) => () => this.line(row));
    const sweeps = Map.groupBy(found.filter(({ sweep }) => sweep), ({ sweep }) => sweep);
    return found.flatMap((row) => {
      if (!row.sweep) return [() => this.line(row)];
      const runs = sweeps.get(row.sweep);
      if (runs?.[0] !== row) return [];
      return [() => this.sweepLine(row.sweep, runs), ...(this.unfolded.has(row.sweep) ? runs.map((item) => () => this.line(item)) : [])];
    });
  }

  sweepLine(name, runs) {
    const open = this.unfolded.has(name);
    const fold = el("button", { class: "sort", "aria-expanded": open, click: () => { if (open) this.unfolded.delete(name); else this.unfolded.add(name); this.draw(); this.body.querySelector(`[data-sweep="${CSS.escape(name)}"] button`).focus(); } }, `${open ? "▾" : "▸"} ${name}`);
    const count = (state) => runs.filter((row) => row.state === state).length;
    const states = ["done", "running", "open", "stopped", "failed", "damaged"].filter(count).map((state) => `${count(state)} ${state}`).join(", ");
    return el("tr", { class: "sweep", "data-sweep": name }, el("td", {}), el("td", {}), el("td", { class: "run" }, fold),
      el("td", { colspan: COLUMNS.length - 2, class: "quiet" }, `sweep of ${runs.length === 1 ? "1 run" : `${runs.length} runs`}: ${states} · `, el("a", { href: address("sweep", { sweep: name }) }, "results")));
  }

  /** The line of a row, which is kept until the row changes: pictures stay, and so does the focus. */
  line(row) {
    const before = this.lines.get(row.run);
    if (before?.row === row) return before.line;
    const tick = before?.line.querySelector("input") ?? el("input", { type: "checkbox", "aria-label": `Compare ${row.run}`, change: () => { if (tick.checked) this.chosen.add(row.run); else this.chosen.delete(row.run); this.draw(); } });
    const number = (value, name, title) => el("td", { class: `number ${name}`, title }, value);
    const text = (value, name) => el("td", { class: name, title: value }, value || "–");
    const picture = row.machine ? pictureOf(row, 72, 54, "line") : "";
    const share = number(row.share === null || row.share === undefined ? "–" : `${formatNumber(100 * row.share, 0)} %`, "share", shareText(row.record, row.task, row.unit));
    share.style.setProperty("--share", `${Math.min(100, 100 * (row.share ?? 0))}%`);
    const bare = row.problem && !row.curve.length;
    const line = el("tr", { "data-run": row.run, class: row.sweep ? `member ${row.state}` : row.state },
      el("td", { class: "tick" }, tick), el("td", { class: "picture" }, picture),
      el("td", { class: "run", title: row.run }, el("a", { href: address("run", { run: row.run }) }, shortName(row.run))),
      el("td", { title: row.problem, class: "where", colspan: bare ? 2 : null }, el("span", { class: `state ${row.state}` }, row.state), row.problem ? el("small", { class: "why" }, row.problem) : ""),
      bare ? null : el("td", { class: "over-time" }, curve(row)), number(withUnit(row.score, row.unit), "reached"),
      number(verifiedText(row.verified, row.fragile, row.unit), "verified"), share,
      text(row.task, "task"), text(row.workflow, "workflow"), text(row.model, "model"), number(formatNumber(row.calls), "calls"),
      number(row.seconds ? clock(row.seconds) : "–", "seconds"), number(started(row.begun), "begun"));
    this.lines.set(row.run, { row, line });
    return line;
  }

  /** Two machines side by side, or the curves of more runs. */
  open() {
    const names = [...this.chosen].filter((name) => this.rows.has(name));
    const [a, b] = names;
    const whole = names.every((name) => this.rows.get(name).state !== "running" && this.rows.get(name).state !== "open"); // else the machine still changes
    location.hash = names.length === 2 && whole ? address("pair", { a, b }) : address("curves", { runs: JSON.stringify(names) });
  }
}

/** What filters by words. */
export const searchField = (value, listeners) => el("input", { type: "search", placeholder: "Filter by any word", "aria-label": "Filter", value, ...listeners });

/** Whether each word is in one of the texts. */
export const holds = (words, texts) => words.toLowerCase().split(/\s+/).every((word) => texts.some((text) => String(text ?? "").toLowerCase().includes(word)));

/** Keep filters in the address of a page. */
export const keep = (page, fields) => history.replaceState(null, "", address(page, Object.fromEntries(Object.entries(fields).filter(([, value]) => value))));

/** The name of a run without its sweep, and without the time of its start, which is shown beside it. */
export const shortName = (run) => run.replace(/^.*\/runs\//, "").replace(/^\d{8}-\d{6}-/, "");

/** The best machine of a run, as built. */
export const pictureOf = ({ run, machine }, width, height, on) => el("img", { src: `/api/picture?${new URLSearchParams({ run, machine, on })}`, alt: "", loading: "lazy", decoding: "async", width, height });

/** A time in minutes and seconds. */
export const clock = (seconds) => `${Math.floor(Math.round(seconds) / 60)}:${String(Math.round(seconds) % 60).padStart(2, "0")} min`;

const TIME = 5; // characters of a time of day

/** A time in seconds since 1970 as a date, with its year unless that is this one, and a time of day. */
export function moment(seconds) {
  const at = new Date(1000 * seconds);
  const year = at.getFullYear() === new Date().getFullYear() ? {} : { year: "numeric" };
  return at.toLocaleString("en-GB", { day: "numeric", month: "short", ...year, hour: "2-digit", minute: "2-digit" });
}

/** When a run began: the time today, else the day too. */
function started(begun) {
  if (begun === null) return "–";
  const today = new Date().toDateString() === new Date(1000 * begun).toDateString();
  return today ? moment(begun).slice(-TIME) : moment(begun);
}

/** The best score over time as a line of steps from 0, to the end of the run. */
function curve({ curve: points, seconds }) {
  if (!points.length) return "";
  const best = points.at(-1)[1];
  const low = Math.min(0, points[0][1]);
  const x = (time) => ((WIDTH - 3) * time) / (seconds || 1);
  const y = (score) => HEIGHT - 2 - ((HEIGHT - 4) * (score - low)) / (best - low || 1);
  const way = points.map(([time, score]) => `H${x(time)}V${y(score)}`).join("");
  return svg("svg", { class: "curve", viewBox: `0 0 ${WIDTH} ${HEIGHT}`, role: "img", "aria-label": `best score ${formatNumber(best)}` },
    svg("path", { class: "line", d: `M0 ${y(0)}${way}H${WIDTH - 3}` }), svg("circle", { class: "dot", cx: WIDTH - 3, cy: y(best), r: 2.4 }));
}
