// The machine that is being built: its states, undo and redo without limit, and what a click would do.
// Python decides what is legal; this only keeps what it said.

import { ask, send } from "./api.js";

const DONE = { add: "Added", move: "Moved", turn: "Turned", copy: "Copied as", mirror: "Mirrored as", fix: "Moved to a face where it fits:" };

export class Editor extends EventTarget {
  /** Begin with the machine that a task gives. */
  static async of(task) {
    return new Editor(task, await ask("/api/build/new", { task }));
  }

  constructor(task, start) {
    super();
    this.task = task;
    this.start = start;
    this.past = [];
    this.future = [];
    this.state = start;
    this.chosen = 0;
    this.aim = null; // {add: type, first} or {move: block} or {copy_of: block}
    this.spots = [];
    this.wrong = new Set(); // blocks that a problem is about, while it is shown
    this.working = Promise.resolve();
    this.left = 0;
    this.settle = async () => true; // applies what is written beside the machine; false if it does not fit
  }

  /** Whether something is still being done. */
  get busy() {
    return this.left > 0;
  }

  get given() {
    return { task: this.task, machine: this.state.machine };
  }

  block(id = this.chosen) {
    return this.state.blocks[id];
  }

  /** Everything about a state of which a draft has kept the machine only. */
  async whole(state) {
    return state.picture ? state : send("/api/build/state", { task: this.task, machine: state.machine });
  }

  /** What a draft keeps. */
  get kept() {
    const bare = (steps) => steps.map(([{ machine }, chosen]) => [machine, chosen]);
    return { machine: this.state.machine, count: this.state.count, chosen: this.chosen, past: bare(this.past), future: bare(this.future) };
  }

  /** Take over what a draft has kept. */
  resume(draft) {
    return this.queue(async () => {
      const state = await this.whole(draft);
      this.recall(draft);
      return this.put(state, draft.chosen);
    });
  }

  /** Take over what can be undone and redone. */
  recall({ past, future }) {
    [this.past, this.future] = [past, future].map((steps) => steps.map(([machine, chosen]) => [{ machine }, chosen]));
  }

  /** Show another state, which a deed has made; the one before can be undone to. */
  take(state, deed, chosen = state.chosen ?? 0) {
    const gone = deed === "remove" ? this.block() : null;
    this.past.push([this.state, this.chosen]);
    this.future = [];
    const shown = this.put(state, chosen);
    this.record(deed, gone ?? this.block());
    return shown;
  }

  /** Tell who records a session what was done; `block` is what it is about. */
  record(deed, block = null) {
    const about = block ? { block: block.id, type: block.type } : {};
    this.event = { kind: "action", do: deed, machine: this.state.machine, ...about };
    this.tell("event");
  }

  put(state, chosen) {
    this.state = state;
    this.wrong = new Set();
    this.pointed = null;
    this.chosen = Math.min(chosen, state.blocks.length - 1);
    this.tell("state");
    const ended = this.aim && ("move" in this.aim || "copy_of" in this.aim || this.aim.first);
    if (ended) this.aim = null;
    return this.look();
  }

  /** Tell who records a session that a machine was simulated. */
  tellTrial(trial) {
    this.event = { kind: "trial", ...trial };
    this.tell("event");
  }

  undo() {
    this.step("undo", this.past, this.future);
  }

  redo() {
    this.step("redo", this.future, this.past);
  }

  step(deed, from, to) {
    this.queue(async () => {
      if (!from.length) return this.say(`There is nothing to ${deed}.`);
      const [state, chosen] = from.at(-1);
      const whole = await this.whole(state);
      from.pop();
      to.push([this.state, this.chosen]);
      const shown = this.put(whole, chosen);
      this.record(deed);
      return shown;
    });
  }

  choose(id, wrong = []) {
    this.chosen = id;
    this.wrong = new Set(wrong);
    this.tell("choice");
    if (this.aim && !("add" in this.aim)) this.aimAt(null);
  }

  /** Change the machine, or say why that is not possible. */
  edit(action, fields = {}) {
    return this.queue(async () => {
      await this.take(await send("/api/build/edit", { ...this.given, do: action, ...fields }), action);
      const { name } = this.block();
      const done = action === "remove" ? "Removed." : `${DONE[action]} block ${this.chosen}, ${name}.`;
      this.say(this.aim ? `${done} ${this.said.text}` : done);
    });
  }

  /** Look for faces: for a new block of a type, or to move or copy one; null ends it. */
  aimAt(aim) {
    this.aim = aim;
    return this.queue(() => this.look());
  }

  async look() {
    this.spots = this.aim ? await send("/api/build/spots", { ...this.given, ...this.aim }) : [];
    this.tell("spots");
    if (!this.aim) return;
    const legal = this.spots.filter((spot) => !spot.why_not).length;
    this.say(`${this.spots.length ? `${legal} of ${this.spots.length} free faces fit` : "No face is free"}${this.aim.first ? " the second end" : ""}: click one or pick it from the list.`);
  }

  /** Do what was aimed at on a face, or say why it is not possible. */
  pick({ block, face, why_not: whyNot }) {
    if (whyNot) return this.say(whyNot, true);
    const { add, first, move, copy_of: copied } = this.aim ?? {};
    const here = [block, face];
    if (move !== undefined) return this.edit("move", { block: move, ends: [here] });
    if (copied !== undefined) return this.edit("copy", { block: copied, ends: [here] });
    if (this.twoEnded(add) && !first) return this.aimAt({ add, first: here });
    return this.edit("add", { type: add, ends: first ? [first, here] : [here] }).then(() => first && this.aimAt({ add }));
  }

  twoEnded(type) {
    return this.library.find((kind) => kind.type === type)?.two_ended;
  }

  /** Point at a face without choosing it; null points at none. */
  point(spot) {
    if (spot === this.pointed) return;
    this.pointed = spot;
    this.tell("point");
    if (spot) this.say(spot.why_not || `Face ${spot.face} of block ${spot.block}, ${spot.name}, facing ${spot.facing}.`, Boolean(spot.why_not));
  }

  say(text, bad = false) {
    this.said = { text, bad };
    this.tell("said");
  }

  /** Do one thing after the other; what fails is said. */
  queue(work) {
    this.left += 1;
    this.tell("busy");
    this.working = this.working.then(work).catch((error) => this.say(error.message, true)).finally(() => {
      this.left -= 1;
      this.tell("busy");
    });
    return this.working;
  }

  tell(kind) {
    this.dispatchEvent(new Event(kind));
  }

  /** Call back on these events. */
  on(kinds, hear) {
    for (const kind of kinds) this.addEventListener(kind, hear);
    hear();
  }
}
