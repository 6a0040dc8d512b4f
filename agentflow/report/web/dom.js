// Creates elements. Strings become text nodes or attributes, never markup; styles go through the CSSOM,
// because the page's Content-Security-Policy forbids inline styles.

const SVG = "http://www.w3.org/2000/svg";

/** Create an HTML element; attributes that are functions become listeners. */
export function el(name, attributes = {}, ...children) {
  return fillElement(document.createElement(name), attributes, children);
}

/** Create an SVG element. */
export function svg(name, attributes = {}, ...children) {
  return fillElement(document.createElementNS(SVG, name), attributes, children);
}

const HIDDEN = /[\u0000-\u0008\u000b\u000c\u000e-\u001f\u007f\u200b\u200e\u200f\u202a-\u202e\u2066-\u2069\ufeff]/g;

/** A text with invisible and direction-changing characters replaced by their code points. */
export function revealHidden(text) {
  return text.replace(HIDDEN, (sign) => `[U+${sign.codePointAt(0).toString(16).toUpperCase().padStart(4, "0")}]`);
}

/** A number with two decimals unless it is whole; an en dash if there is none. */
export function formatNumber(value, digits = 2) {
  if (value === null || value === undefined || !Number.isFinite(value)) return "–";
  if (Number.isInteger(value)) return value.toLocaleString("en");
  return value.toLocaleString("en", { minimumFractionDigits: digits, maximumFractionDigits: digits });
}

/** A verified score, marked if its machine is fragile. */
export const verifiedText = (score, fragile, unit = "") => withUnit(score, unit) + (fragile ? " (fragile)" : "");

/** A number with its unit, if both are there. */
export const withUnit = (value, unit) => formatNumber(value) + (unit && value !== null && value !== undefined ? ` ${unit}` : "");

export const capitalize = (text) => text.charAt(0).toUpperCase() + text.slice(1);

/** Whether the window is as narrow as that of a phone. */
export const isNarrow = () => innerWidth < 600;

const [SHORT, LONG] = [12, 40]; // characters from which the first cell of a row, and any cell, may wrap

/** A table; cells are strings, numbers or elements. Heads are strings, or [group, string] for columns
 *  under a common heading. Columns of numbers are right-aligned: all from column `labels` on, if it is
 *  given; then labels that repeat the row above are hidden. A row of one cell spans all columns. */
export function table(caption, head, rows, labels = Infinity) {
  const heads = head.map((text) => (typeof text === "string" ? ["", text] : text));
  const numeric = heads.map((_, column) => column >= labels || rows.some((row) => typeof row[column] === "number" || row[column] === null));
  const kind = (column) => (numeric[column] ? "number" : "");
  const again = (index, column) =>
    labels !== Infinity && column < labels && rows[index - 1] && rows[index] && rows[index].slice(0, column + 1).every((text, i) => text === rows[index - 1][i]);
  const cell = (value, column, index) =>
    el("td", { colspan: rows[index].length === 1 ? heads.length : null, class: [kind(column), again(index, column) && "again", again(index + 1, column) && "ongoing", value?.length > LONG ? "long" : !column && value?.length > SHORT && "name"].filter(Boolean).join(" ") }, typeof value === "number" || value === null ? formatNumber(value) : value);
  return el(
    "div",
    { class: "table", role: "region", tabindex: "0", "aria-label": caption || "Table" },
    el(
      "table",
      {},
      caption ? el("caption", {}, caption) : null,
      el("thead", {}, groupHeader(heads), el("tr", {}, ...heads.map(([, text], i) => (text ? el("th", { scope: "col", class: kind(i) }, text) : el("td", {}))))),
      el("tbody", {}, ...rows.map((row, index) => el("tr", {}, ...row.map((value, column) => cell(value, column, index))))),
    ),
  );
}

/** The row of group headings, if there are any. */
function groupHeader(heads) {
  if (heads.every(([group]) => !group)) return null;
  const cells = [];
  for (const [group] of heads) {
    if (cells.length && cells.at(-1).group === group) cells.at(-1).count += 1;
    else cells.push({ group, count: 1 });
  }
  return el("tr", { class: "groups" }, ...cells.map(({ group, count }) =>
    group ? el("th", { scope: "colgroup", colspan: count }, group) : el("td", { colspan: count })));
}

/** A section with a heading. */
export function section(title, ...children) {
  const id = `part-${title.toLowerCase().replace(/[^a-z0-9]+/g, "-")}`;
  return el("section", { "aria-labelledby": id }, el("h2", { id }, title), ...children);
}

function fillElement(element, attributes, children) {
  for (const [key, value] of Object.entries(attributes)) {
    if (typeof value === "function") element.addEventListener(key, value);
    else if (value !== undefined && value !== null && value !== false) element.setAttribute(key, value);
  }
  const kept = children.filter((child) => child !== null && child !== undefined);
  element.append(...kept.map((child) => (typeof child === "string" ? revealHidden(child) : child)));
  return element;
}
