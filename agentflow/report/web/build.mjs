// Bundles the scripts and styles of reports and of the studio: node build.mjs <folder to write into>.
// Run by setup.py in a folder where `npm ci` has been run and report/ and studio/ hold the sources.
// Licences stay in the bundle.

import { copyFileSync, readFileSync } from "node:fs";
import { build } from "esbuild";

const licence = readFileSync("node_modules/three/LICENSE", "utf8").trim();
const version = JSON.parse(readFileSync("node_modules/three/package.json", "utf8")).version;

await build({
  entryPoints: { player: "report/web/main.js", studio: "studio/web/main.js" },
  outdir: process.argv[2],
  bundle: true,
  minify: true,
  format: "iife",
  target: "es2022",
  charset: "utf8",
  legalComments: "none", // three.js includes one line only; the banner has its full licence
  banner: { js: `/*! Contains three.js ${version}\n${licence}\n*/` },
  logLevel: "warning",
});
copyFileSync("node_modules/axe-core/axe.min.js", `${process.argv[2]}/axe.min.js`); // tests read pages with it; no release holds it
