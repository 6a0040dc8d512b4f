// The search tree: one dot per machine, to the right of its parent; refused edits
// are crosses; machines that nobody edited stand side by side if there are many. Works with the pointer and, as an ARIA tree, with arrow keys.

import { formatNumber, svg } from "./dom.js";

const ROW = 22;
const TOP = 34; // above the first row: what columns are
const EDGE = 14;
const APART = 54; // of first machines side by side
const CLOSE = 40; // of machines side by side in a column
const FEW = 3; // machines from one that have a row each although nobody edited them
const BELOW = 9; // the line to machines side by side, below them

export class Tree {
  /** @param nodes in order of creation; `parent` is an id or null
   *  @param choose called with the selected node */
  constructor(nodes, choose) {
    this.nodes = new Map(nodes.map((node) => [node.id, { ...node, children: [] }]));
    this.choose = choose;
    this.roots = [];
    for (const node of this.nodes.values()) {
      (this.nodes.get(node.parent)?.children ?? this.roots).push(node);
    }
    const scores = nodes.map((node) => node.score).filter((score) => score !== null);
    this.low = Math.min(...scores);
    this.high = Math.max(...scores);
    this.element = svg("svg", { class: "tree", role: "tree", "aria-label": "Search tree", keydown: (e) => this.press(e) });
    new ResizeObserver(() => this.draw()).observe(this.element);
  }

  /** Mark a node as selected without calling `choose`. */
  select(id) {
    this.selected = id;
    for (const [key, mark] of this.marks ?? []) {
      mark.setAttribute("aria-selected", key === id);
      mark.setAttribute("tabindex", key === id ? 0 : -1);
    }
  }

  /** Give every node its depth, and columns their width: together they take all of it. */
  measure(width) {
    const measure = (node, depth) => {
      node.depth = depth;
      return Math.max(depth, ...node.children.map((child) => measure(child, depth + 1)));
    };
    this.deepest = Math.max(0, ...this.roots.map((root) => measure(root, 0)));
    this.column = (width - 2 * EDGE) / (this.deepest + 1);
  }

  /** Give every node its row; `across` machines fit side by side, fewer in a column. */
  arrange(across) {
    let row = 0;
    const inside = Math.floor(this.column / CLOSE);
    const visit = (node) => {
      node.row = row;
      const made = node.children.filter((child) => child.kind !== "refused");
      const refused = node.children.filter((child) => child.kind === "refused");
      const ends = made.filter(({ children }) => !children.length);
      const packed = inside > 1 && ends.length > FEW ? ends : [];
      const others = made.filter((child) => !packed.includes(child));
      others.forEach((child, index) => {
        if (index) row += 1;
        visit(child);
      });
      packed.forEach((child, index) => {
        if (index ? index % inside === 0 : others.length) row += 1;
        Object.assign(child, { row, beside: index % inside, packed: true });
      });
      if (refused.length && made.length) row += 1;
      refused.forEach((child, place) => Object.assign(child, { row, place }));
    };
    for (const root of this.roots.filter(({ children }) => children.length)) {
      visit(root);
      row += 1;
    }
    const single = this.roots.filter(({ children }) => !children.length);
    if (row && single.length) this.singles = row++; // a row for their heading
    single.forEach((root, index) => Object.assign(root, { row: row + Math.floor(index / across), beside: index % across }));
    this.rows = row + Math.ceil(single.length / across);
  }

  draw(width = this.element.clientWidth) {
    if (!width || width === this.width) return;
    this.width = width;
    this.nodes.forEach((node) => Object.assign(node, { beside: 0, packed: false }));
    this.measure(width);
    this.arrange(Math.max(1, Math.floor((width - 2 * EDGE) / APART)));
    const height = TOP + this.rows * ROW;
    this.element.setAttribute("height", height);
    this.element.setAttribute("viewBox", `0 0 ${width} ${height}`);
    const focused = this.element.contains(document.activeElement);
    this.marks = new Map([...this.nodes.values()].map((node) => [node.id, this.mark(node)]));
    const links = [...this.nodes.values()].map((node) => this.link(node)).filter(Boolean);
    const every = Math.ceil(26 / this.column);
    const heads = Array.from({ length: this.deepest && Math.floor(this.deepest / every) + 1 }, (_, index) => index * every).map((depth) => svg("text", { x: this.x({ depth }) - 6, y: 11 }, depth === 0 ? "first" : this.column < 60 ? `${depth}` : depth === 1 ? "1 edit" : `${depth} edits`));
    if (this.singles) heads.push(svg("text", { x: EDGE - 6, y: this.y({ row: this.singles }) + 4 }, "first machines that nobody edited"));
    this.element.replaceChildren(svg("g", { "aria-hidden": "true" }, ...heads), svg("g", { class: "links", "aria-hidden": "true" }, ...links), ...this.marks.values());
    this.select(this.selected ?? this.nodes.keys().next().value);
    this.element.parentElement.scrollTop = this.y(this.nodes.get(this.selected) ?? { row: 0 }) - this.element.parentElement.clientHeight / 2;
    if (focused) this.marks.get(this.selected).focus();
  }

  x(node) {
    return EDGE + node.depth * this.column + (node.beside ?? 0) * (node.packed ? CLOSE : APART) + (node.place ?? 0) * Math.min(11, this.column / 4);
  }

  y(node) {
    return TOP + node.row * ROW;
  }

  link(node) {
    const parent = this.nodes.get(node.parent);
    if (!parent || node.place) return null;
    const [x0, y0, x1, y1] = [this.x(parent), this.y(parent), this.x(node), this.y(node)];
    const bend = Math.min(10, (x1 - x0) / 2);
    const way = node.packed ? `M${x0} ${y0}V${y1 + BELOW}H${x1}V${y1}` : y0 === y1
      ? `M${x0} ${y0}H${x1}`
      : `M${x0} ${y0}V${y1 - bend}Q${x0} ${y1} ${x0 + bend} ${y1}H${x1}`;
    return svg("path", { d: way, class: node.lead ? "lead" : "" });
  }

  mark(node) {
    const [x, y] = [this.x(node), this.y(node)];
    const shape = node.kind === "refused"
      ? svg("path", { class: "cross", d: `M${x - 3} ${y - 3}l6 6m0 -6l-6 6` })
      : svg("circle", { cx: x, cy: y, r: node.best ? 7 : 5 });
    if (node.score !== null) {
      shape.style.setProperty("--share", `${Math.round(this.high === this.low ? 100 * (this.high > 0) : 100 * (node.score - this.low) / (this.high - this.low))}%`);
    }
    const label = node.score === null ? "invalid" : formatNumber(node.score, 1);
    const text = node.kind === "refused" ? null : svg("text", { x: x + 7, y: y - 6 }, label);
    const kinds = [node.kind, node.valid ? "valid" : "invalid", node.broken ? "broken" : "", node.best ? "best" : ""];
    return svg("g", {
      class: `node ${kinds.join(" ")}`,
      role: "treeitem",
      "aria-level": node.depth + 1,
      "aria-label": `${node.title}, ${node.score === null ? (text ? label : "no score") : `score ${label}`}${node.broken ? ", broke" : ""}`,
      "data-node": node.id,
      click: () => this.pick(node),
    }, svg("rect", { x: x - 8, y: y - 11, width: node.kind === "refused" ? 16 : 44, height: 21, rx: 4 }), shape, text);
  }

  pick(node) {
    this.select(node.id);
    this.marks.get(node.id).focus();
    this.choose(node);
  }

  press(event) {
    const here = this.nodes.get(this.selected);
    const all = [...this.nodes.values()].sort((a, b) => a.row - b.row || this.x(a) - this.x(b));
    const index = all.indexOf(here);
    const next = {
      ArrowDown: all[index + 1],
      ArrowUp: all[index - 1],
      ArrowRight: here.children[0],
      ArrowLeft: this.nodes.get(here.parent),
      Home: all[0],
      End: all[all.length - 1],
      Enter: here,
      " ": here,
    };
    if (!(event.key in next)) return;
    event.preventDefault();
    if (next[event.key]) this.pick(next[event.key]);
  }
}
