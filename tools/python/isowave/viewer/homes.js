// homes.js -- where a view is. A page of the server loads the module: connect() talks through a
// websocket. A notebook's front end imports it: the default export is a widget of anywidget, which
// talks through the kernel's channel. The last part of an ES module (front_end.py).

/** A message of the websocket: its head, and a picture's bytes. */
function unpack(data) {
  if (typeof data === "string") return [JSON.parse(data)];
  const size = new DataView(data).getUint32(0, true);
  const head = JSON.parse(new TextDecoder().decode(new Uint8Array(data, 4, size)));
  return [head, new Uint8Array(data, 4 + size)];
}

/** Another connection to the server. receive: hears of messages. */
function socketBeside(url, receive) {
  const socket = new WebSocket(url);
  const waiting = [];
  let isOver = false;
  socket.binaryType = "arraybuffer";
  socket.onopen = () => waiting.forEach((message) => socket.send(message));
  socket.onmessage = ({ data }) => !isOver && receive(...unpack(data));
  socket.onclose = ({ reason }) => !isOver && receive({ type: "closed",
    message: reason || "The connection is lost." });
  return {
    send: (message) => {
      const text = JSON.stringify(message);
      if (socket.readyState === WebSocket.OPEN) socket.send(text);
      else waiting.push(text);
    },
    close: () => {
      isOver = true;
      socket.close();
    },
  };
}

/**
 * A view that talks to a server, and again when the connection was lost.
 * @param {HTMLElement} host
 * @param {string} url of the websocket
 */
export function connect(host, url) {
  let socket = null;
  let failures = 0;
  const send = (message) => {
    if (socket?.readyState === WebSocket.OPEN) socket.send(JSON.stringify(message));
  };
  const view = new View(host, {
    send, wheel: () => true, hash: true, isDark: () => matchMedia(DARK).matches,
    beside: (receive) => socketBeside(url, receive),
  });
  const open = () => {
    socket = new WebSocket(url);
    view.connection = socket;
    socket.binaryType = "arraybuffer";
    socket.onopen = () => {
      failures = 0;
      view.connected();
    };
    socket.onmessage = ({ data }) => view.receive(...unpack(data));
    socket.onclose = ({ code, reason }) => {
      view.host.dataset.state = "closed";
      const final = code === 1008 || code === 1003 || code === 1009;
      const wait = Math.min(10000, 250 * 2 ** failures++);
      view.note(final ? `Disconnected: ${reason || "a message was too long"}. Reload the page.`
        : reason || "The connection is lost. Trying again …", "drawing");
      if (!final) setTimeout(open, wait);
    };
  };
  open();
  return view;
}

const SILENT_MS = 3000; // without an answer of the kernel, until a note says that
const SILENT = "The kernel does not answer. If it is busy, pictures follow. If it was restarted, "
  + "run the cell again.";
const RESTARTED = "The kernel was restarted: run the cell again.";

const makeName = () => crypto.getRandomValues(new Uint32Array(4)).join("-"); // of a view

/** Another view of the widget. receive: hears of messages. */
function viewBeside(model, receive) {
  const name = makeName();
  const hear = ({ view, message }, buffers) => view === name && receive(message, buffers?.[0]);
  model.on("msg:custom", hear);
  return {
    send: (message) => model.send({ view: name, message }),
    close: () => {
      model.off("msg:custom", hear);
      model.send({ view: name, message: null });
    },
  };
}

/** A view in a notebook: of anywidget. */
function render({ model, el }) {
  const host = document.createElement("div");
  const name = makeName();
  let timer = 0; // runs until the kernel answers
  const send = (message) => {
    model.send({ view: name, message });
    if (!message || message.type === "ack" || timer) return;
    timer = setTimeout(() => view.note(SILENT, "silent"), SILENT_MS);
    model.send({ view: name, message: "alive" });
  };
  const wheel = (view) => view.root.activeElement === view.picture; // else the notebook scrolls
  const light = document.body.dataset.jpThemeLight; // JupyterLab's theme, whatever the system's
  const isDark = () => (light ? light === "false" : matchMedia(DARK).matches);
  if (light) host.style.colorScheme = isDark() ? "dark" : "light";
  const resize = () => { host.style.height = `${model.get("height")}px`; };
  resize();
  el.append(host);
  const beside = (hear) => viewBeside(model, hear);
  const view = new View(host, { send, wheel, hash: false, isDark, beside });
  const receive = ({ view: to, message }, buffers) => {
    if (to !== name) return;
    clearTimeout(timer);
    timer = 0;
    view.clearNote("silent");
    if (message.type !== "closed") return view.receive(message, buffers?.[0]);
    view.note(`Disconnected: ${message.message}. Run the cell again.`, "drawing");
  };
  const restarted = () => view.note(RESTARTED, "silent");
  model.on("msg:custom", receive);
  model.on("change:height", resize);
  model.on("comm_live_update", restarted);
  if (model.get("still")?.byteLength) view.showStill(model.get("still"));
  view.connected();
  return () => {
    send(null);
    clearTimeout(timer);
    model.off("comm_live_update", restarted);
    model.off("msg:custom", receive);
    model.off("change:height", resize);
    view.close();
  };
}

export default { render };

/** The server's page: nothing but a view. */
function startPage() {
  const sheet = new CSSStyleSheet();
  sheet.replaceSync("body { margin: 0 } #view { height: 100vh; height: 100dvh }");
  document.adoptedStyleSheets = [sheet];
  const host = document.body.appendChild(document.createElement("main"));
  host.id = "view";
  connect(host, new URL("ws", location.href.replace(/^http/, "ws").replace(/#.*/, "")).href);
}

if (globalThis.document?.documentElement.dataset.isowave === "page") startPage();
