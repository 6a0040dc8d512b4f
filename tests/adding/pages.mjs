// Shows the new page, and the page of a sweep with the new chart, in a document that keeps no layout.
// node pages.mjs <folder with main.js> ; prints {page, discs}

import { register } from "node:module";
import { pathToFileURL } from "node:url";

const folder = `${pathToFileURL(process.argv[2])}/`;
const needed = ["main", "plain", "sweep", "charts", "dom"].map((name) => `${folder}${name}.js`);
// Styles are empty, and the other pages are names: what they import needs a build.
register(`data:text/javascript,${encodeURIComponent(`
  import { readFileSync } from "node:fs";
  const needed = ${JSON.stringify(needed)};
  export async function load(url, context, next) {
    if (needed.includes(url.replace(/[?].*/, ""))) return next(url, context);
    const names = url.startsWith("file:") ? [...readFileSync(new URL(url), "utf8").matchAll(/^export (?:async )?(?:function\\*?|const|class) (\\w+)/gm)].map(([, name]) => name) : [];
    return { format: "module", shortCircuit: true, source: names.map((name) => "export const " + name + " = null;").join("\\n") };
  }`)}`);

class Element {
  constructor(name) { Object.assign(this, { name, attributes: {}, children: [], dataset: {}, classList: { add() {} } }); }
  setAttribute(key, value) { this.attributes[key] = String(value); }
  addEventListener() {}
  getContext() { return { measureText: () => ({ width: 0 }) }; }
  append(...children) { this.children.push(...children); }
  replaceChildren(...children) { this.children = children; }
}

function all(element, name) {
  const inner = (element.children ?? []).flatMap((child) => all(child, name));
  return element.name === name ? [element, ...inner] : inner;
}

globalThis.ResizeObserver = class {
  constructor(draw) { this.draw = draw; }
  observe(picture) { picture.clientWidth = 300; this.draw(); }
};

async function show(data) {
  const body = new Element("body");
  globalThis.document = {
    body,
    createElement: (name) => new Element(name),
    createElementNS: (_, name) => new Element(name),
    getElementById: () => ({ textContent: JSON.stringify(data) }),
  };
  await import(`${folder}main.js?${data.kind}`);
  return body;
}

const page = all(await show({ kind: "plain", score: 7 }), "p").map((item) => item.children.join(""));
const sweep = await show({ kind: "sweep", title: "", about: "", notes: [], many: 9, spreads: [], tables: [], runs: [] });
console.log(JSON.stringify({ page, discs: all(sweep, "circle").map((item) => item.attributes.r) }));
