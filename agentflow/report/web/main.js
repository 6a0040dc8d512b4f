// Entry point: reads the page's data and builds the matching page.

import "./player.css";
import { cellPage } from "./cell.js";
import { comparePage } from "./compare.js";
import { galleryPage } from "./gallery.js";
import { leaderboardPage } from "./leaderboard.js";
import { robustnessPage } from "./robustness.js";
import { runPage } from "./run.js";
import { sweepPage } from "./sweep.js";
import { tasksPage } from "./tasks.js";
import { trainingPage } from "./training.js";

const PAGES = { cell: cellPage, run: runPage, sweep: sweepPage, gallery: galleryPage, leaderboard: leaderboardPage, compare: comparePage, robustness: robustnessPage, tasks: tasksPage, training: trainingPage };
const data = JSON.parse(document.getElementById("data").textContent);

document.body.append(...PAGES[data.kind](data));
document.body.dataset.ready = data.kind;
