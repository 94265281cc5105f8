// worker.js -- a worker of a page: an engine (engine.cpp), which answers requests one by one. In:
// {id, what, ...}; "start" has the compiled module, "open" a file's name and bytes, "supply"
// bytes of parts. Out: {id, data: bytes that belong to the answer, ...answer}.

let engine = null;
let folders = 0; // each file has a folder of its own

async function start({ module }) {
  engine = await createEngine({
    instantiateWasm(imports, done) {
      WebAssembly.instantiate(module, imports).then((instance) => done(instance));
      return {};
    },
    print: () => {},
    printErr: () => {},
  });
  return {};
}

/** Removes a file that is not needed any more. */
function remove(path) {
  if (!path) return;
  engine.FS.unlink(path);
  engine.FS.rmdir(path.replace(/\/[^/]*$/, ""));
}

let shown = null; // path of the volume, whose blocks are read from it

function open({ name, bytes, keep, chunks, field }) {
  const folder = `/${++folders}`;
  engine.FS.mkdir(folder);
  const path = `${folder}/${name.replaceAll("/", "_")}`;
  engine.FS.writeFile(path, new Uint8Array(bytes));
  const second = field ? "/field.zfp" : ""; // which is read at once
  if (field) engine.FS.writeFile(second, field);
  const answer = ask({ what: "open", path, keep, chunks, field: second });
  if (field) engine.FS.unlink(second);
  remove(answer.error ? path : shown);
  if (!answer.error) shown = path;
  if (answer.error) answer.error = answer.error.replaceAll(path, name);
  return answer;
}

function supply({ parts, bytes }) {
  const path = "/parts";
  engine.FS.writeFile(path, bytes);
  const answer = ask({ what: "supply", path, parts });
  engine.FS.unlink(path);
  return answer;
}

/** What the engine answers, with its bytes. */
function ask(request) {
  const answer = JSON.parse(
    engine.ccall("engine_call", "string", ["string"], [JSON.stringify(request)]));
  const count = engine._engine_num_bytes();
  if (count) {
    const begin = engine._engine_bytes();
    answer.data = engine.HEAPU8.slice(begin, begin + count);
  }
  return answer;
}

globalThis.onmessage = async ({ data: { id, ...request } }) => {
  let answer;
  const begin = performance.now();
  try {
    const act = { start, open, supply }[request.what] ?? ask;
    answer = await act(request);
  } catch (failure) { // such as memory that is used up
    answer = { error: `the engine failed: ${failure?.message ?? failure}`.split("\n")[0] };
  }
  answer.took = performance.now() - begin;
  postMessage({ id, ...answer }, answer.data ? [answer.data.buffer] : []);
};
