// A list to choose from, with arrow keys, digits that jump, and the pointer.

import { el } from "../../report/web/dom.js";

const PATIENCE = 900; // milliseconds between typed digits

export class Listbox {
  /** @param label for those who do not see it
   *  @param show makes {text, level, disabled, key, group} of an item; those of a group are together
   *  @param on {active, pick}: called with an item */
  constructor(label, show, { active = () => {}, pick = () => {} }, role = "listbox") {
    this.show = show;
    this.active = active;
    this.pick = pick;
    this.items = [];
    this.at = -1;
    this.typed = "";
    this.role = role === "tree" ? "treeitem" : "option";
    this.element = el("div", { class: "list", role, tabindex: "0", "aria-label": label, keydown: (event) => this.press(event) });
  }

  /** Show other items; the one with the same key stays active. */
  set(items, key = null) {
    const before = key ?? this.items[this.at]?.key;
    const id = this.element.getAttribute("aria-label").toLowerCase().replace(/[^a-z]+/g, "-");
    this.items = items.map((item, index) => {
      const { text, level = 1, disabled = false, key: own, group } = this.show(item);
      const element = el("div", { role: this.role, id: `${id}-${index}`, "aria-level": this.role === "treeitem" ? level : null, "aria-disabled": disabled || null,
        click: () => { this.move(index); this.pick(item); }, pointerenter: () => this.role === "option" && this.active(item) }, text);
      element.style.paddingLeft = `${0.4 + 0.75 * (level - 1)}rem`;
      return { item, element, key: own, group };
    });
    const groups = [...new Set(this.items.map(({ group }) => group))];
    this.element.replaceChildren(...groups.flatMap((name) => {
      const held = this.items.filter(({ group }) => group === name).map(({ element }) => element);
      return name ? [el("div", { role: "group", "aria-label": name }, el("div", { class: "group", "aria-hidden": "true" }, name), ...held)] : held;
    }));
    this.mark(this.items.findIndex((entry) => entry.key === before));
  }

  mark(index) {
    this.items[this.at]?.element.removeAttribute("aria-selected");
    this.at = index;
    const entry = this.items[index];
    if (!entry) return this.element.removeAttribute("aria-activedescendant");
    entry.element.setAttribute("aria-selected", "true");
    this.element.setAttribute("aria-activedescendant", entry.element.id);
    const [top, bottom] = [entry.element.offsetTop, entry.element.offsetTop + entry.element.offsetHeight];
    const { scrollTop, clientHeight } = this.element;
    if (top < scrollTop) this.element.scrollTop = top;
    if (bottom > scrollTop + clientHeight) this.element.scrollTop = bottom - clientHeight;
    return null;
  }

  /** Make an item active. */
  move(index) {
    if (!this.items.length) return;
    this.mark(Math.min(Math.max(index, 0), this.items.length - 1));
    this.active(this.items[this.at].item);
  }

  press(event) {
    if (event.ctrlKey || event.metaKey || event.altKey) return;
    const steps = { ArrowDown: this.at + 1, ArrowUp: this.at - 1, Home: 0, End: this.items.length - 1, PageDown: this.at + 10, PageUp: this.at - 10 };
    if (event.key in steps) this.move(steps[event.key]);
    else if ((event.key === "Enter" || event.key === " ") && this.items[this.at]) {
      this.typed = "";
      this.pick(this.items[this.at].item);
    }
    else if (/^[0-9.]$/.test(event.key)) this.jump(event.key);
    else {
      this.typed = "";
      return;
    }
    event.preventDefault();
    event.stopPropagation();
  }

  /** Go to the first item that begins with the typed digits. */
  jump(sign) {
    clearTimeout(this.timer);
    this.timer = setTimeout(() => (this.typed = ""), PATIENCE);
    this.typed += sign;
    const found = this.items.findIndex(({ element }) => element.textContent.startsWith(this.typed));
    if (found >= 0) this.move(found);
  }
}
