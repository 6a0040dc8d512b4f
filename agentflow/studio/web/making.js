// Buttons that write files for those who make a machine: instructions, and files for CAD programs and printers.

import { el } from "../../report/web/dom.js";
import { fileName, save } from "../../report/web/downloads.js";
import { fetchFile } from "./api.js";

/** @param given gives {task, machine, digest}, or a promise of it
 *  @param say takes how it goes, and whether that is bad */
export const making = (given, say) => [".html", ".step", ".3mf"].map((suffix) => {
  const button = el("button", { click: async () => {
    button.disabled = true;
    say("Writing the file …", false);
    try {
      const { task, machine, digest } = await given();
      const name = `machine-${digest}${suffix}`;
      save(name, await fetchFile("/api/build/made", { task, machine, suffix }));
      say(`Saved as ${name}.`, false);
    } catch (error) {
      say(error.message, true);
    }
    button.disabled = false;
  } }, fileName(suffix));
  return button;
});
