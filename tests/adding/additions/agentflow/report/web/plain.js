// The page of one score.

import { el } from "./dom.js";

export function plainPage(data) {
  return [el("p", {}, `Score ${data.score}`)];
}
