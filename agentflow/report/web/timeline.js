// What happens when in a film: events along the slider and as a list, and the control program.

import { el } from "./dom.js";

export class Timeline {
  /** @param seek called with the time of an event that users select, seconds */
  constructor(seek) {
    this.seek = seek;
    this.ticks = el("div", { class: "ticks", "aria-hidden": "true" });
    this.lanes = el("ol", { class: "lanes", "aria-label": "Control program" });
    this.list = el("ol", { class: "events", "aria-label": "Events" });
    this.counted = el("summary", {});
    this.folded = el("div", {});
    const roomy = matchMedia("(min-width: 960px)").matches; // else the list takes the place of the view
    this.element = el("details", { class: "happened", open: roomy ? "" : null }, this.counted, this.folded, this.list);
  }

  /** Whether more than events is behind the line that opens. */
  fold(narrow) {
    this.narrow = narrow;
    if (narrow) this.element.open = false;
    this.count();
  }

  count() {
    const { length } = this.list.children;
    const broke = this.list.querySelectorAll(".broke").length;
    const told = `${length} event${length === 1 ? "" : "s"}${broke ? `, ${broke} broke` : ""}`;
    this.counted.textContent = this.narrow ? `${length ? told : "No events"} · legend, files` : told;
    this.element.hidden = !length && !this.narrow;
  }

  /** Show the events and the control program of a machine; its film lasts `duration` seconds. */
  show({ events, lanes }, duration) {
    const share = (time) => `${(100 * time) / (duration || 1)}%`;
    this.ticks.replaceChildren(...events.map((event) => tick(event, share)));
    this.list.replaceChildren(...events.map((event) => entry(event, this.seek)));
    this.count();
    this.lanes.replaceChildren(...(lanes ?? []).map((item) => lane(item, (time) => share(Math.min(time, duration)))));
  }
}

/** A mark of an event along the slider. */
function tick(event, share) {
  const mark = el("i", { class: event.kind, title: event.text });
  mark.style.left = share(Math.max(event.time, 0));
  return mark;
}

/** An event in the list; its button seeks its time. */
function entry(event, seek) {
  return el("li", {}, el("button", { class: event.kind, click: () => seek(event.time) },
    el("span", {}, event.time < 0 ? "settling" : `${event.time.toFixed(2)} s`), ` ${event.text}`));
}

/** What the control program drives when: one row for each group of blocks, one bar for each span of time. */
function lane({ name, spans }, share) {
  return el("li", {}, el("span", {}, name),
    el("div", { class: "lane" }, ...spans.map(([begin, end, level]) => {
      const bar = el("i", { class: level < 0 ? "back" : null, title: `${name}: level ${level} from ${begin} to ${end} s` });
      Object.assign(bar.style, { left: share(begin), right: `calc(100% - ${share(end)})`, height: `${Math.max(15, 100 * Math.abs(level))}%` });
      return bar;
    })));
}
