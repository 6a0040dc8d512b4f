// The page of one run, in the report's view, while it grows.

import { capitalize, el, formatNumber } from "../../report/web/dom.js";
import { RunView } from "../../report/web/run.js";
import { problem } from "../../report/web/text.js";
import { address, ask, follow, send } from "./api.js";
import { levelPicture } from "./boards.js";
import { spell } from "./design.js";
import { clock, pictureOf, shortName } from "./list.js";
import { making } from "./making.js";

const FEW = 5; // simulations after which the pace tells how long the others take
const PERSON = "a person in the studio"; // the author of a run by hand
const PAUSE = 1500; // least milliseconds between two readings of the record

export async function livePage({ run }) {
  const films = new Map();
  const film = (machine) => {
    if (!films.has(machine)) {
      films.set(machine, ask("/api/machine", { run, machine }));
      films.get(machine).then((found) => films.set(machine, found), () => films.delete(machine)); // shown at once the next time
    }
    return films.get(machine);
  };
  let data;
  try {
    data = await ask("/api/run", { run });
  } catch (error) {
    return { elements: [await lost(run, error)] };
  }
  const told = el("span", { class: "quiet", role: "status" });
  const view = new RunView(film, ({ machine }) => (machine ? [
    el("a", { class: "button", href: address("build", { run, machine }) }, "Edit in Build"),
  ] : []), (machine) => pictureOf({ run, machine }, 320, 240, "card"));
  view.player.making = [...making(async () => ({ ...await ask("/api/build/from", { run, machine: view.machine }), digest: view.machine }), (text) => (told.textContent = text)), " ", told];
  view.level = levelPicture(data.run.task);
  const live = new Live(run, view);
  view.main.prepend(el("p", { class: "quiet" }, el("a", { href: "#runs" }, "Runs"), ` / ${shortName(run)}`), live.element);
  live.show(data);
  let reading = null;
  const read = () => (reading ??= new Promise((done) => setTimeout(done, PAUSE)).then(async () => {
    reading = null;
    live.show(data = await ask("/api/run", { run }));
  }).catch((error) => live.fail(error.message)));
  const stop = follow({ run }, async (news) => {
    if (news.ended && news.state === "failed") { // nothing is left to show
      view.growing = false;
      view.player.show(null, "", "No machine was made.");
      view.main.replaceChildren(...(await lost(run, news)).children);
      return;
    }
    live.hear(news);
    if (!news.state) return;
    if (!data.ended) read(); // it may have ended since
  });
  return {
    elements: [el("aside", {}, view.player.element), view.main],
    close: () => { stop(); live.close(); view.player.close(); },
  };
}

/** What is said of a run of which nothing is left, or that cannot be read. */
async function lost(run, { message, problem: why }) {
  const own = await design(run);
  return el("main", { class: "alone" }, el("h1", {}, own?.problem ? "This design failed" : "This run cannot be shown"),
    el("p", { class: "quiet" }, run), problem(own?.problem || why || message), el("p", { class: "actions" }, retry(own), el("a", { class: "button", href: "#runs" }, "All runs")));
}

const design = async (run) => (await ask("/api/designs")).find((item) => item.run === run);
const retry = (own) => (own?.form ? el("a", { class: "button", href: address("runs", { again: own.run }) }, "Edit and retry") : "");

/** How far a run is, and what can be done about it. */
class Live {
  constructor(run, view) {
    this.run = run;
    this.view = view;
    this.state = el("span", { class: "state" });
    this.stage = el("span", {});
    this.spent = el("span", { class: "quiet" });
    this.clock = el("span", { class: "quiet", "aria-live": "off" });
    this.meter = el("progress", { "aria-label": "Simulations of those planned", hidden: "" });
    this.following = el("button", { "aria-pressed": "true", hidden: "", click: () => this.setFollowing(!view.following) }, "Following the best");
    this.setFollowing = (on) => {
      view.following = on;
      this.following.setAttribute("aria-pressed", on);
      this.following.textContent = on ? "Following the best" : "Follow the best";
      if (on) view.update(view.data);
    };
    view.picking = () => this.setFollowing(false);
    view.following = true;
    this.stop = this.action("Stop", "stop", "Stopping …");
    this.resume = this.action("Resume", "resume", "Resuming …");
    this.again = el("span", { class: "actions" });
    this.told = el("p", { class: "problem", role: "alert" });
    this.waiting = el("p", { class: "waiting", role: "status" });
    this.wait = el("span", { "aria-live": "off" }); // seconds until a call is tried again
    this.element = el("div", { class: "live" }, el("p", { role: "status" }, this.state, this.stage), this.stop, this.resume, this.following, this.again,
      el("p", {}, this.spent, this.clock), this.meter, this.waiting, this.told);
    this.timer = setInterval(() => this.tick(), 1000);
  }

  /** Show the data of the run; one that is being stopped goes on for a while. */
  show(data = this.data) {
    const { run } = (this.data = data);
    this.view.update(this.stop.disabled ? { ...data, run: { ...run, sentence: run.sentence.replace("in progress", "stopping") } } : data);
  }

  /** A button that asks the server to do something with the run. */
  action(text, what, doing) {
    const button = el("button", { hidden: "", click: async () => {
      button.disabled = true;
      button.textContent = this.state.textContent = doing; // the news may come before the answer
      this.show();
      this.tick();
      try {
        await send(`/api/designs/${what}`, { run: this.run });
        button.hidden = true;
      } catch (error) {
        this.state.textContent = this.was;
        button.disabled = false;
        this.show();
        this.fail(error.message);
      }
      button.disabled = false;
      button.textContent = text;
    } }, text);
    return button;
  }

  hear(news) {
    const { state, problem: why } = news;
    if (why && !state) return this.fail(why);
    if (state !== this.was) this.change(state);
    this.view.growing = state === "running" || state === "open";
    this.was = state;
    if (!this.view.picked) this.view.update(this.view.data);
    if (state !== "running" || !this.stop.disabled) this.state.textContent = state === "open" ? "open: tests in Build join it" : state;
    this.state.className = `state ${state}`;
    this.fail(why ? (state === "failed" ? `Failed: ${why}` : why) : "");
    if (news.calls === undefined) return null;
    const { planned, calls, refused, retries, simulations, stage } = news;
    if (retries.count > (this.tried?.count ?? 0)) this.tried = { count: retries.count, calls };
    this.until = retries.until;
    this.waiting.replaceChildren(...(this.tried?.calls === calls && state === "running" ? [`Waiting for the endpoint. ${capitalize(retries.last)}.`, " ", this.wait] : []));
    const of = (count, about, name) => `${formatNumber(count)}${state !== "done" && about > count ? ` of about ${formatNumber(about)}` : ""} ${name}`;
    const stopped = state === "stopped";
    if (stopped) this.state.textContent = `Stopped after ${of(simulations, planned.simulations, "simulations")}; ${news.machine ? "the best machine is not verified" : "there is no machine yet"}`;
    this.stage.textContent = stage && !stopped && planned.simulations && state !== "done" && state !== "gone" ? `stage: ${stage}` : "";
    if (state === "gone") this.view.main.querySelectorAll(".score, .actions").forEach((item) => item.remove());
    this.spent.textContent = [state === "open" ? "" : of(calls, planned.calls, "calls"), refused ? `${formatNumber(refused)} rejected and asked again` : "", retries.count ? `${formatNumber(retries.count)} tried again` : "", stopped ? "" : of(simulations, planned.simulations, simulations === 1 ? "simulation" : "simulations")].filter(Boolean).join(" · ");
    this.meter.hidden = state === "done" || !planned.simulations;
    Object.assign(this.meter, { max: planned.simulations || 1, value: Math.min(simulations, planned.simulations || 1) });
    const left = state === "running" && simulations >= FEW ? news.seconds * (planned.simulations / simulations - 1) : 0;
    this.heard = { at: performance.now(), seconds: news.seconds, running: state === "running", left: left > 0 ? ` · ${spell(left)} more` : "" };
    this.tick();
    return null;
  }

  /** Offer what fits the state. */
  async change(state) {
    const own = await design(this.run).catch(() => null);
    this.stop.hidden = !(state === "running" && own?.running);
    this.resume.hidden = state !== "stopped" && state !== "failed";
    this.following.hidden = state !== "running";
    this.again.replaceChildren(state === "failed" ? retry(own) : "", ...(state === "done" ? await this.next() : []));
  }

  /** What can follow on a finished run. */
  async next() {
    const { run, view: { data: { run: { task, author } } } } = this;
    const lead = (page, fields, words) => el("a", { class: "button", href: address(page, fields) }, words);
    const others = (await ask("/api/runs").catch(() => [])).filter((row) => row.task === task && row.run !== run && row.state === "done" && row.machine);
    const worth = ({ verified, score }) => verified ?? score;
    const [best] = others.sort((a, b) => worth(b) - worth(a));
    return [author === PERSON ? "" : lead("runs", { again: run }, "Run again"), best ? lead("pair", { a: run, b: best.run }, `Compare with ${shortName(best.run)}`) : "", el("button", { click: () => print() }, "Print or save as PDF")];
  }

  /** Show the time that the run has worked. */
  tick() {
    if (!this.heard) return;
    const { at, seconds, running, left } = this.heard;
    this.clock.textContent = clock(seconds + (running ? (performance.now() - at) / 1000 : 0)) + (this.stop.disabled ? "" : left);
    const wait = Math.ceil(this.until - Date.now() / 1000);
    this.wait.textContent = wait > 0 ? `Next attempt in ${wait} s.` : "Trying again …";
  }

  fail(words) {
    this.told.textContent = words;
  }

  close() {
    clearInterval(this.timer);
  }
}
