// What was built for each task, kept in this browser: machine, undo and redo, trials. Every tab writes a
// draft of its own, so that none overwrites another's.

const PREFIX = "agentflow draft ";
const LAST = "agentflow task";
const MOST = 6; // drafts kept of one task

/** The drafts of a task, the latest first. */
export function draftsOf(task) {
  const keys = Object.keys(localStorage).filter((key) => key.startsWith(`${PREFIX}${task} `));
  return keys.map(read).filter(Boolean).sort((a, b) => b.saved - a.saved);
}

/** The task that was built for last, if it is one of these. */
export const lastTask = (names) => names.find((name) => name === localStorage.getItem(LAST));

export class Draft {
  constructor(task) {
    this.key = `${PREFIX}${task} ${crypto.randomUUID()}`;
    localStorage.setItem(LAST, task);
    draftsOf(task).slice(MOST - 1).forEach(({ key }) => localStorage.removeItem(key));
    this.hold(this.key);
  }

  /** Continue another draft; false if another tab does so already, and this one writes a copy. */
  async adopt({ key }) {
    const before = this.free;
    if (!(await this.hold(key))) return false;
    before?.();
    this.key = key;
    return true;
  }

  /** Keep a draft; where the browser has no more room, with fewer steps to undo. Returns how many. */
  keep(draft) {
    const kept = { ...draft, saved: Date.now() };
    for (;;) {
      try {
        localStorage.setItem(this.key, JSON.stringify(kept));
        return kept.past.length;
      } catch (error) {
        if (!kept.past.length && !kept.future.length) throw error;
        [kept.past, kept.future] = [kept.past.slice(Math.ceil(kept.past.length / 2)), []];
      }
    }
  }

  /** Whether no other tab has it; nor will any, until this one frees it or closes. */
  hold(key) {
    return new Promise((known) => {
      navigator.locks.request(key, { ifAvailable: true }, (lock) => {
        known(Boolean(lock));
        return lock && new Promise((free) => (this.free = free));
      });
    });
  }
}

function read(key) {
  try {
    return { ...JSON.parse(localStorage.getItem(key)), key };
  } catch {
    return null; // not ours, or cut off
  }
}
