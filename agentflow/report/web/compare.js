// The page of a comparison: two films side by side, and the blocks that differ.

import { FADED, MARKED } from "./colors.js";
import { el, section, formatNumber, isNarrow, table, verifiedText, withUnit } from "./dom.js";
import { Player } from "./player.js";
import { problem, taskDetails } from "./text.js";
import { entry } from "./view.js";

const NAMES = ["A", "B"];

/** @param made receives the players */
export function comparePage(data, made = []) {
  const players = data.machines.map((machine, side) => {
    const player = new Player(data.shapes, data.files);
    player.span = Math.max(...data.films.map((film) => film.film.times.at(-1))); // both sliders at one scale
    const score = machine.score === null ? "no score" : withUnit(machine.score, data.asked.unit);
    player.shown = player.show(data.films[side], `${NAMES[side]} · ${score}`, machine.source);
    return player;
  });
  made.push(...players);
  keepInStep(players);
  players.forEach(({ view }, side) => { if (view.eye) view.eye.beside = players[1 - side].view.eye; });
  Promise.all(players.map(({ shown }) => shown)).then(() => players[0].ask()); // from as far as both need
  const both = () => { players[0].lead(); players[0].seek(0); players[0].play(); };
  const differ = el("button", { "aria-pressed": "false", click: () => mark(differ.getAttribute("aria-pressed") === "false") }, "Mark differences");
  const key = el("span", { class: "key" }, entry("block", MARKED, "only in this machine"), entry("block", FADED, "in both, faded"));
  const mark = (on) => {
    key.hidden = !on;
    differ.setAttribute("aria-pressed", on);
    players.forEach((player, side) => player.setMarked(on ? data.only[side].map(({ id }) => id) : null));
  };
  if (data.only.some((blocks) => blocks.length)) mark(data.only.every((blocks) => blocks.length <= data.same)); // else nearly all would be marked
  else key.hidden = differ.disabled = true;
  return [
    el("main", { class: "alone compare" },
      el("header", {}, el("p", { class: "kind" }, `agentflow comparison · both simulated with seed ${data.seed} on ${data.engine}`), el("h1", {}, data.task)),
      el("p", { class: "ahead" }, ahead(data.machines, data.asked.unit)),
      ...data.notes.map((note) => el("p", { class: "quiet" }, `${note}.`)),
      data.runs.some(Boolean) ? runs(data) : "",
      el("p", { class: "actions" }, el("button", { class: "play both", click: both }, "Play both"), differ, key),
      el("div", { class: "pair" }, ...players.map((player) => player.element)),
      taskDetails(data.asked),
      ...data.machines.flatMap(({ problems }, side) => problems.map((text) => problem(`${NAMES[side]} is not valid for ${data.task}: ${text}`))),
      section("Machines", table("Both machines", ["", ...NAMES], rows(data))),
      section("Blocks",
        el("p", { class: "quiet" }, `${data.same === 1 ? "1 block is" : `${formatNumber(data.same)} blocks are`} in both machines: same type, position and direction relative to the root block. Their numbers may differ.`),
        el("div", { class: "pair" }, ...data.only.map((blocks, side) => blocks.length ? el("details", {}, el("summary", {}, `${formatNumber(blocks.length)} only in ${NAMES[side]}`), table(`Only in ${NAMES[side]}`, ["Block", "Type", "Position, m", "Direction"], blocks.map(place))) : null)))),
  ];
}

/** Let the other player show what the one shows that was touched last: moment, speed and view. */
function keepInStep(players) {
  let leader = players[0];
  for (const player of players) {
    player.lead = () => { if (leader !== player) leader.pause(); leader = player; };
    for (const kind of ["pointerdown", "keydown", "wheel", "focusin"]) player.element.addEventListener(kind, player.lead, { capture: true, passive: true });
    player.element.addEventListener("frame", () => {
      if (leader !== player) return;
      for (const other of players) if (other !== player) other.follow(player);
    });
  }
}

/** What each run asked for, spent and reached. */
const runs = ({ runs: found, machines, asked: { unit } }) => {
  const measure = unit && `, ${unit}`;
  const heads = ["Workflow", "Model", "Seed", "Calls", "Simulations", `Score${measure}`, `Verified${measure}`];
  const names = machines.map(({ source }, side) => `${NAMES[side]} · ${source}`);
  const values = found.map((run) => (run ? [run.workflow, run.model ?? "–", run.seed, run.calls, run.simulations, run.score, run.fragile ? verifiedText(run.verified, true) : run.verified] : ["–", "–", ...Array(5).fill(null)]));
  return isNarrow() ? table("Runs", ["", ...names], heads.map((head, i) => [head, ...values.map((each) => each[i])])) : table("Runs", ["", ...heads], values.map((each, side) => [names[side], ...each]));
};

/** Which machine scores more, and by how much, from the numbers as they are shown. */
function ahead([{ score: a }, { score: b }], unit) {
  if (a === null || b === null) return a === b ? "Neither machine has a score." : `Only ${a === null ? "B" : "A"} has a score.`;
  if (a === b) return `Both score ${withUnit(a, unit)}.`;
  const [worst, best] = [a, b].map((score) => Math.round(100 * score) / 100).sort((one, other) => one - other);
  return `${a > b ? "A" : "B"} scores ${withUnit(best - worst, unit)} more: ${withUnit(best, unit)} against ${withUnit(worst, unit)}${worst > 0 ? ` (+${formatNumber(Math.round((100 * (best - worst)) / worst))} %)` : ""}.`;
}

function rows({ machines, types, asked }) {
  return [
    [asked.unit ? `Score, ${asked.unit}` : "Score", ...machines.map((machine) => machine.score)],
    ["Blocks", ...machines.map((machine) => machine.blocks)],
    ["Mass, kg", ...machines.map((machine) => machine.mass)],
    ["Size, m", ...machines.map((machine) => machine.size.join(" × "))],
    ...types.map(({ name, counts }) => [name, ...counts]),
  ];
}

const place = ({ id, name, positions, direction }) => [String(id), name, positions.map((end) => end.join(", ")).join(" to "), direction ?? ""];
