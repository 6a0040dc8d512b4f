// Asks the server; what it refuses becomes an Error with its words.

/** The answer to GET with these fields. */
export function ask(path, fields = {}) {
  return answered(fetch(`${path}?${new URLSearchParams(fields)}`));
}

/** The answer to POST with this data. */
export function send(path, data) {
  return answered(post(path, data));
}

const post = (path, data) => fetch(path, { method: "POST", headers: { "content-type": "application/json" }, body: JSON.stringify(data) });

/** The answer to POST as a file; what is refused becomes an Error. */
export async function fetchFile(path, data) {
  const response = await post(path, data);
  if (!response.ok) throw new Error((await response.json()).problem);
  return response.blob();
}

const SILENT = "The studio does not answer; its process may have ended.";

async function answered(coming) {
  let response;
  try {
    response = await coming;
  } catch {
    throw new Error(SILENT);
  }
  const found = await response.json();
  if (!response.ok) throw new Error(found.problem);
  return found;
}

/** Call back with each message of an event stream; returns what ends it. */
export function follow(fields, hear) {
  const stream = new EventSource(`/api/follow?${new URLSearchParams(fields)}`);
  stream.onmessage = ({ data }) => {
    const found = JSON.parse(data);
    if (found.ended) stream.close(); // else the browser would ask again
    hear(found);
  };
  stream.onerror = () => hear({ problem: SILENT }); // the browser asks again until somebody answers
  return () => stream.close();
}

/** What tells of a key; nothing where people touch the screen. */
export const byKey = (key) => (matchMedia("(pointer: coarse)").matches ? "" : ` (${key})`);

/** The address of a page with these fields. */
export const address = (page, fields) => `#${page}?${new URLSearchParams(fields)}`;
