// The page where people build machines, with mouse, touch or keyboard.

import { el, verifiedText, withUnit } from "../../report/web/dom.js";
import { downloads } from "../../report/web/downloads.js";
import { taskDetails } from "../../report/web/text.js";
import { address, ask, byKey, follow, send } from "./api.js";
import { taskOptions } from "./boards.js";
import { controlEditor } from "./control.js";
import { designForm } from "./design.js";
import { Draft, draftsOf, lastTask } from "./drafts.js";
import { Editor } from "./editor.js";
import { EXAMPLE } from "./example.js";
import { links } from "./first.js";
import { carGuide } from "./guide.js";
import { moment } from "./list.js";
import { making } from "./making.js";
import { blockPalette, blockTree, faceList, facts } from "./panel.js";
import { Recorder } from "./recorder.js";
import { Stage } from "./stage.js";
import { Trials } from "./trials.js";

const FIRST = "movement"; // the task of those who name none

export async function buildPage({ task, run, machine, record, example, guide }) {
  const [session, start] = await Promise.all([ask("/api/session"), ask("/api/start")]);
  const given = session ?? (run ? await ask("/api/build/from", machine ? { run, machine } : { run }) : record ? await ask("/api/build/record", { task }) : example ? EXAMPLE : null);
  const wanted = given?.task ?? task ?? lastTask(start.tasks.map(({ name }) => name)) ?? FIRST;
  const [editor, library] = await Promise.all([Editor.of(wanted), ask("/api/build/blocks", { task: wanted })]);
  editor.library = library;
  if (given) {
    const state = await send("/api/build/state", { task: editor.task, machine: given.machine });
    if (session) editor.put(state, 0); // its participant has done nothing yet that undo could take back
    else editor.take(state, "open");
  }
  const page = new BuildPage(editor, start, session);
  if (record && !session) editor.say("This is the machine of the record: Test plays its film.");
  if (guide) page.view.append(carGuide(editor, (sides) => page.stage.lookFor(sides)));
  return page;
}

class BuildPage {
  constructor(editor, start, session) {
    this.editor = editor;
    this.recorder = session ? new Recorder(editor, session, () => this.trials.name && this.trials.finish()) : null;
    this.stage = new Stage(editor);
    this.trials = new Trials(editor, () => this.turnTo(true));
    this.palette = blockPalette(editor);
    this.view = el("div", { class: "centre" }, this.stage.element, this.trials.player.element);
    this.keys = (event) => this.press(event);
    document.addEventListener("keydown", this.keys);
    this.stop = () => {};
    this.elements = [el("main", { class: session?.paused ? "build paused" : "build" }, this.recorder?.element ?? "", this.top(start), this.taskCard(), this.earlier(session), this.palette.element, this.view,
      el("div", { class: "side" }, editor.start.designed ? controlEditor(editor) : "", faceList(editor), blockTree(editor), facts(editor), this.more(start, session?.refine ?? true)), this.trials.element), this.recorder?.over];
    editor.on(["busy"], () => this.elements[0].setAttribute("aria-busy", editor.busy));
    editor.on(["state", "spots", "choice"], () => this.turnTo(false)); // whoever edits sees what
    ["state", "trials"].forEach((kind) => editor.addEventListener(kind, () => this.keep()));
  }

  /** Show the film, or the machine that is being built. */
  turnTo(film) {
    this.view.classList.toggle("filming", film);
    this.tabs.forEach((tab, index) => tab.setAttribute("aria-selected", film === Boolean(index)));
    if (!film) this.trials.player.pause();
  }

  /** Switch between film and machine, as a person does. */
  switch(film = !this.view.classList.contains("filming")) {
    if (film && !this.trials.shown) return this.editor.say(`There is no film yet: test the machine${byKey("P")}.`);
    this.turnTo(film);
    return film && this.editor.record("watch");
  }

  /** Offer to go on with earlier work on this task; a session goes on with its own. */
  earlier(session) {
    const owner = session ? `session ${session.session}` : this.editor.task;
    const found = draftsOf(owner);
    this.draft = new Draft(owner);
    if (session && found.length) {
      this.draft.adopt(found[0]);
      this.trials.resume(found[0]);
      if (JSON.stringify(found[0].machine) === JSON.stringify(session.machine)) this.editor.recall(found[0]);
    }
    if (session || !found.length) return "";
    const told = ({ count, best }) => `${count} block${count === 1 ? "" : "s"}${best === null ? "" : `, best ${withUnit(best, this.editor.start.unit)}`}`;
    const bar = el("p", { class: "earlier" }, "Earlier work on this task: ",
      ...found.map((draft) => el("button", { class: "play", title: moment(draft.saved / 1000), click: () => this.resume(draft, bar) }, `Continue (${told(draft)})`)), " or ",
      el("button", { click: () => bar.remove() }, "Start new"));
    this.offer = bar;
    return bar;
  }

  async resume(draft, bar) {
    const { editor } = this;
    await editor.working;
    const alone = await this.draft.adopt(draft);
    this.trials.resume(draft);
    await editor.resume(draft);
    bar.remove();
    editor.say(alone ? "This is your machine as you left it, with undo and tests." : "Another tab works on this machine too; here, you go on with a copy of it.");
    this.stage.canvas.focus();
  }

  /** Keep what is there now; what a page begins with is not kept. */
  keep() {
    const { editor, trials } = this;
    const kept = { ...editor.kept, ...trials.kept };
    if (!kept.past.length && !kept.future.length && !kept.trials.length) return;
    this.offer?.remove(); // one click there would put away work done since
    try {
      const steps = this.draft.keep(kept);
      if (steps < kept.past.length) editor.say(`The browser's storage is nearly full: after a reload, undo will reach ${steps} steps back.`, true);
    } catch {
      editor.say("The browser's storage is full: this machine would be lost with the page. Save it as a file.", true);
    }
  }

  top(start) {
    const { editor } = this;
    const button = (text, key, act) => el("button", { title: `${text} (${key})`, click: act }, text);
    const tasks = el("select", { "aria-label": "Task", disabled: this.recorder ? "" : null, change: () => { location.hash = address("build", { task: tasks.value }); } },
      ...taskOptions(start.tasks, editor.task));
    this.tabs = ["Machine", "Film"].map((name, index) => el("button", { class: "tab", role: "tab", title: `${name} (E)`, click: () => this.switch(Boolean(index)) }, name));
    this.actions = {
      "Undo|Ctrl+Z": () => editor.undo(), "Redo|Ctrl+Y": () => editor.redo(),
      "Move|M": () => editor.aimAt({ move: editor.chosen }).then(focusFaces), "Turn|R": () => editor.edit("turn", { block: editor.chosen }),
      "Copy|C": () => editor.aimAt({ copy_of: editor.chosen }).then(focusFaces), "Mirror|X": () => editor.edit("mirror", { block: editor.chosen }),
      "Remove|Delete": () => editor.edit("remove", { block: editor.chosen }),
    };
    const said = el("p", { class: "said", role: "status" });
    editor.on(["said"], () => { said.textContent = editor.said?.text ?? ""; said.classList.toggle("bad", Boolean(editor.said?.bad)); });
    const buttons = Object.entries(this.actions).map(([name, act]) => button(...name.split("|"), () => { this.turnTo(false); act(); }));
    const [undo, redo, ...others] = buttons;
    editor.on(["state", "choice"], () => {
      undo.disabled = !editor.past.length;
      redo.disabled = !editor.future.length;
      for (const other of others) other.disabled = Boolean(editor.block().given);
    });
    return el("div", { class: "top" }, tasks, ...buttons,
      el("div", { class: "tabs", role: "tablist", "aria-label": "View" }, ...this.tabs), el("button", { class: "play test", title: "Simulate it (P)", click: () => this.trials.test() }, "Test"), said);
  }

  /** What the task asks for, how it is scored, and what is good. */
  taskCard() {
    const { start, task } = this.editor;
    const details = taskDetails(start);
    const must = start.score.slice(1).filter((line) => line.startsWith("The score is 0 unless")); // such as limits of a landing
    details.firstChild.append(...must.flatMap((line) => [" ", el("small", {}, `${line.split(". ")[0].replace(/\.$/, "")}.`)]));
    const there = start.scene.find((line) => /\d m\b/.test(line) && !/^The (ground|machine) /.test(line)); // the first thing of the level with its measures
    if (there) details.firstChild.append(" ", el("small", {}, there.split(";")[0]));
    details.addEventListener("toggle", () => details.open && this.editor.record("ask"));
    const { good, record, unit } = start;
    const best = record ? ` · record ${verifiedText(record.verified ?? record.score, record.fragile, unit)}` : "";
    return el("section", { class: "task-card", "aria-label": `Task ${task}` }, el("h1", { class: "unseen" }, `Build for ${task}`), details, el("p", {}, `good from ${withUnit(good, unit)}${best}`));
  }

  more(start, refine) {
    const { editor } = this;
    const file = el("input", { type: "file", accept: ".json,.bsg", "aria-label": "Open a machine file", change: () => this.open(file.files[0]).then(() => (file.value = "")) });
    const saved = el("p", { class: "files" });
    const made = making(() => ({ ...editor.given, digest: editor.state.digest }), (text, bad) => editor.say(text, bad));
    editor.on(["state"], () => saved.replaceChildren("Download: ", ...downloads(editor.state.picture.files, () => editor.state.files), ...made));
    const told = el("p", { role: "status" });
    const form = designForm(start, () => editor.given, (run) => { editor.record("refine"); this.refined(run, told); });
    return el("div", { class: "more" },
      editor.start.designed ? "" : controlEditor(editor),
      el("details", {}, el("summary", {}, "Open and save"), file, saved, el("p", { class: "quiet" }, "Or start from a machine of any run: open the ", el("a", { href: "#runs" }, "run"), " and choose Edit in Build. ", ...links())),
      refine ? el("details", {}, el("summary", {}, "Refine this"), el("p", { class: "quiet" }, "Let a model improve this machine, and use the result."), form, told) : "",
      !byKey("?") ? "" : el("details", {}, el("summary", {}, "Keys"), el("p", { class: "quiet" }, "B blocks · F faces · T tree · V view · arrows and digits move in lists · Enter chooses · Esc ends · P tests · E film or machine · ",
        Object.keys(this.actions).map((name) => name.split("|").reverse().join(" ").toLowerCase()).join(" · "))));
  }

  /** Follow a refinement, and offer its answer. */
  refined(run, told) {
    const link = el("a", { href: address("run", { run }) }, run);
    this.stop();
    this.stop = follow({ run }, async ({ state, best, problem }) => {
      const score = best === null || best === undefined ? "" : `, best ${withUnit(best, this.editor.start.unit)}`;
      const stop = el("button", { click: () => send("/api/designs/stop", { run }).catch((error) => this.editor.say(error.message, true)) }, "Stop");
      const take = el("button", { class: "play", click: () => this.takeAnswer(run) }, "Use this machine");
      told.replaceChildren(link, problem ? ` ${problem}` : ` ${state}${score} `, state === "running" ? stop : state === "done" ? take : "");
    });
  }

  takeAnswer(run) {
    const { editor } = this;
    return editor.queue(async () => {
      const { machine } = await ask("/api/build/from", { run });
      await editor.take(await send("/api/build/state", { task: editor.task, machine }), "refine");
      editor.say("This is the model's machine; undo brings yours back.");
    });
  }

  async open(file) {
    const { editor } = this;
    const text = await file.text();
    return editor.queue(async () => {
      await editor.take(await send("/api/build/open", { task: editor.task, text, name: file.name }), "open");
      editor.say(`Opened ${file.name}.`);
    });
  }

  press(event) {
    const { editor } = this;
    const typing = event.target.matches("input:not([type=file]), select, textarea") && event.key !== "Escape";
    const elsewhere = event.target.closest(".player") && !"pe".includes(event.key); // the film has keys of its own
    const control = event.ctrlKey || event.metaKey;
    if (event.altKey || typing || elsewhere || this.recorder?.stopped || this.recorder?.over.open) return;
    const named = { z: event.shiftKey ? "Redo|Ctrl+Y" : "Undo|Ctrl+Z", y: "Redo|Ctrl+Y" }[control && event.key.toLowerCase()]
      ?? (control ? null : { m: "Move|M", r: "Turn|R", c: "Copy|C", x: "Mirror|X", Delete: "Remove|Delete", Backspace: "Remove|Delete" }[event.key]);
    const act = (named && this.actions[named]) ?? (control ? null : {
      b: () => this.palette.focus(), f: focusFaces, t: () => this.view.parentElement.querySelector("[role=tree]").focus(), v: () => this.stage.canvas.focus(),
      p: () => this.trials.test(), e: () => this.switch(), Escape: () => { editor.aimAt(null); this.stage.canvas.focus(); },
    }[event.key]);
    if (!act) return;
    event.preventDefault();
    act();
  }

  close() {
    this.recorder?.leave();
    document.removeEventListener("keydown", this.keys);
    this.stop();
    this.stage.close();
    this.trials.player.close();
    this.draft.free?.();
  }
}

const focusFaces = () => document.querySelector("#faces .list").focus();
