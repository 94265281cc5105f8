// remote.js -- the volume of a page, in a file beside it on a server: the parts that engines lack
// are asked for by HTTP range requests. A part of an ES module (make_page.py).

// Between two parts: they are asked for together, and this is not used.
const LEAST_GAP = 1 << 15;
const MOST_GAP = 1 << 18;
const REQUEST_BYTES = 1 << 22; // of a request, about
const MOST_REQUESTS = 6; // at a time, as many as a browser has connections to a server of HTTP/1.1
const LATELY = 0.95; // weight of all requests before the last
const KEPT_BYTES = 256e6; // of parts, which another worker may need, too

/**
 * Neighbours among parts, together.
 * @param {[number, number][]} parts begin and end, in the file's order
 * @param {number} gap most bytes between two
 * @returns {{begin: number, end: number, parts: [number, number][]}[]}
 */
function joined(parts, gap) {
  const runs = [];
  for (const part of parts) {
    const [begin, end] = part;
    const last = runs.at(-1);
    if (last && begin - last.end <= gap && end - last.begin <= REQUEST_BYTES) {
      last.end = end;
      last.parts.push(part);
    } else {
      runs.push({ begin, end, parts: [part] });
    }
  }
  return runs;
}

/** A volume beside the page, as save_site() describes it. */
class RemoteVolume {
  constructor({ file, bytes, head_bytes: headBytes, id, ...values }) {
    Object.assign(this, { file, bytes, headBytes, values });
    // A cache has nothing of another volume under this address. Servers of files ignore the id.
    this.url = new URL(`${encodeURIComponent(file)}?${id}`, location.href);
    /** @type {Map<number, Promise<Uint8Array>>} by begin; those that were used last are last */
    this.parts = new Map();
    this.sizes = new Map();
    this.keptBytes = 0;
    this.fetchedBytes = 0;
    this.requests = 0;
    // Requests lately: least ms until an answer begins, ms in which it is read, its bytes.
    this.lately = { wait: Infinity, read: 0, bytes: 0 };
    this.waiting = [];
    this.running = 0;
  }

  head() {
    return this.fetchBytes(0, this.headBytes);
  }

  /** @returns {Promise<Uint8Array>} parts of the file one behind the other */
  async get(parts) {
    const isHere = ([begin]) => this.parts.has(begin);
    for (const run of joined(parts.filter((part) => !isHere(part)), this.gap)) this.begin(run);
    const here = parts.map(([begin]) => {
      const part = this.parts.get(begin);
      this.parts.delete(begin); // to be the last
      this.parts.set(begin, part);
      return part;
    });
    const bytes = new Uint8Array(parts.reduce((sum, [begin, end]) => sum + end - begin, 0));
    let at = 0;
    for (const part of await Promise.all(here)) {
      bytes.set(part, at);
      at += part.length;
    }
    this.forget();
    return bytes;
  }

  /** Bytes that take as long to read as a further request takes to be answered. */
  get gap() {
    const { wait, read, bytes } = this.lately;
    return clamp(read > 0 ? wait * bytes / read : 0, LEAST_GAP, MOST_GAP);
  }

  /** Asks for parts that are not here. */
  begin({ begin, end, parts }) {
    const run = this.fetchBytes(begin, end);
    for (const [from, to] of parts) {
      const part = run.then((bytes) => bytes.slice(from - begin, to - begin));
      part.catch(() => this.drop(from)); // to be asked for again
      this.parts.set(from, part);
      this.sizes.set(from, to - from);
      this.keptBytes += to - from;
    }
  }

  drop(begin) {
    this.keptBytes -= this.sizes.get(begin) ?? 0;
    this.sizes.delete(begin);
    this.parts.delete(begin);
  }

  /** Drops what was used least lately. */
  forget() {
    for (const begin of this.parts.keys()) {
      if (this.keptBytes <= KEPT_BYTES) return;
      this.drop(begin);
    }
  }

  /** Waits for its turn. */
  async fetchBytes(begin, end) {
    if (this.running >= MOST_REQUESTS) await new Promise((go) => this.waiting.push(go));
    ++this.running;
    try {
      return await this.fetchNow(begin, end);
    } finally {
      --this.running;
      this.waiting.shift()?.();
    }
  }

  async fetchNow(begin, end) {
    ++this.requests;
    let answer;
    let bytes;
    const begun = performance.now();
    let answered = begun;
    try {
      // If it may keep parts, Chromium asks for one after the other.
      answer = await fetch(this.url,
        { cache: "no-store", headers: { Range: `bytes=${begin}-${end - 1}` } });
      answered = performance.now();
      if (answer.status === 206) bytes = new Uint8Array(await answer.arrayBuffer());
      else await answer.body?.cancel();
    } catch {
      throw new Error(`The server of ${this.file} does not answer, or the connection was cut.`);
    }
    if (answer.status === 200) {
      throw new Error("This server does not answer range requests, which this page needs: "
        + "put its folder on one that does.");
    }
    if (!bytes && answer.status !== 416) {
      throw new Error(`${this.file} cannot be read beside this page: `
        + `the server says ${answer.status}.`);
    }
    const total = answer.headers.get("Content-Range")?.split("/")[1];
    if (!bytes || (total && total !== "*" && Number(total) !== this.bytes)
        || bytes.length !== end - begin) {
      throw new Error(`${this.file} is not the one of this page: load the page again.`);
    }
    this.fetchedBytes += bytes.length;
    const { wait, read, bytes: before } = this.lately;
    this.lately = { wait: Math.min(wait / LATELY, answered - begun),
      read: LATELY * read + performance.now() - answered, bytes: LATELY * before + bytes.length };
    return bytes;
  }
}
