// A session on the Build page: the task, the time left, pauses, notes, the microphone. What is done
// goes to the server, which keeps the time and writes the file.

import { el } from "../../report/web/dom.js";
import { ask, send } from "./api.js";
import { Microphone } from "./microphone.js";

const TICK = 500; // milliseconds between two looks at the clock
const LAST = 60; // seconds from which the time left is red

export class Recorder {
  /** @param editor what the person builds with
   *  @param session as the server describes it
   *  @param finish completes the run of its tests */
  constructor(editor, session, finish) {
    this.editor = editor;
    this.finish = finish;
    this.name = session.session;
    this.sending = Promise.resolve();
    this.stopped = session.paused;
    this.begin(session);
    editor.addEventListener("event", () => this.tell(editor.event));
    this.set(session.left_s);
    this.timer = setInterval(() => this.look(), TICK);
    if (this.stopped) this.hold(true);
  }

  begin({ mode, rationale, task }) {
    const button = (text, act, more = {}) => el("button", { type: "button", click: act, ...more }, text);
    this.clock = el("output", { class: "clock", "aria-label": "Time left" });
    this.pause = button("Pause", () => this.hold(!this.stopped), { "aria-pressed": "false" });
    this.said = el("p", { class: "quiet", role: "status" });
    this.microphone = new Microphone((piece) => send("/api/session/sound", { session: this.name, ...piece }), (text) => (this.said.textContent = text));
    const note = el("input", { placeholder: "Note: what do you think?", "aria-label": "Note", maxlength: 10000 });
    const notes = el("form", { class: "notes", autocomplete: "off", submit: (event) => {
      event.preventDefault();
      if (note.value.trim()) this.tell({ kind: "note", text: note.value.trim() }).then(() => (this.said.textContent = "Noted."));
      note.value = "";
    } }, note, el("button", {}, "Note"));
    this.ending = button("End session", () => (this.ending.dataset.sure ? this.end() : this.sure()));
    const why = mode === "guided" ? el("details", { class: "rationale", open: "", toggle: (event) => event.target.open && this.asked() }, el("summary", {}, "Rationale"), ...rationale.split("\n").map((line) => el("p", {}, line))) : "";
    this.element = el("section", { class: "session", "aria-label": "Session" },
      el("p", { class: "about" }, el("b", {}, `Session · ${task}`), " ", this.clock), this.pause, this.microphone.element, notes, this.ending, this.said, why);
    this.over = el("dialog", { class: "ended", cancel: (event) => event.preventDefault() });
  }

  /** A text of the page was opened; those that are open from the start do not count. */
  asked() {
    if (this.opened) this.editor.record("ask");
    this.opened = true;
  }

  /** Tell the server what has happened, in order. */
  tell(event) {
    this.sending = this.sending.then(async () => {
      try {
        this.set((await send("/api/session/event", { session: this.name, event })).left_s);
      } catch (error) {
        this.said.textContent = error.message;
        this.check();
      }
    });
    return this.sending;
  }

  /** Take the time that is left, seconds; null without a limit. */
  set(left) {
    this.ends = left === null ? null : performance.now() + 1000 * left;
    this.look();
  }

  look() {
    if (this.stopped || this.over.open) return;
    const left = this.ends === null ? null : Math.max(0, this.ends - performance.now()) / 1000;
    this.clock.textContent = left === null ? "no time limit" : `${Math.floor(left / 60)}:${String(Math.floor(left % 60)).padStart(2, "0")} left`;
    this.clock.classList.toggle("late", left !== null && left < LAST);
    if (left === 0) this.check();
  }

  /** Ask whether the session is still open. */
  async check() {
    const open = await ask("/api/session").catch(() => null);
    if (open?.session !== this.name) this.close("The session is over. Everything that you did is recorded.");
  }

  /** Stop the clock and hide the machine, or go on. */
  async hold(stop) {
    this.stopped = stop;
    this.pause.textContent = stop ? "Resume" : "Pause";
    this.pause.setAttribute("aria-pressed", stop);
    this.element.parentElement?.classList.toggle("paused", stop);
    await this.sending;
    try {
      const { left_s: left } = await send("/api/session/pause", { session: this.name, paused: stop });
      if (!stop) this.set(left);
      else this.clock.textContent = "paused";
      this.said.textContent = stop ? "Clock paused. Your machine reappears when you resume." : "";
    } catch (error) {
      this.said.textContent = error.message;
      this.check();
    }
  }

  /** Ask once more before the session ends. */
  sure(seconds = 5) {
    this.ending.dataset.sure = "yes";
    this.ending.textContent = "End it for good?";
    setTimeout(() => {
      delete this.ending.dataset.sure;
      this.ending.textContent = "End session";
    }, 1000 * seconds);
  }

  async end() {
    await this.sending;
    await this.microphone.stop();
    await send("/api/session/end", { session: this.name }).catch(() => null);
    this.close("Thank you. Everything that you did is recorded.");
  }

  /** Nothing more is recorded, so nothing more can be done. */
  close(words) {
    if (this.over.open) return;
    this.leave();
    this.finish();
    this.over.replaceChildren(el("h2", {}, words), el("p", {}, "Please tell the person who leads the study that you are done."), el("p", { class: "quiet" }, `Recorded in sessions/${this.name}. A reload of this page leads on.`));
    this.over.showModal();
  }

  leave() {
    clearInterval(this.timer);
    this.microphone.stop();
  }
}
