// homes.js -- where a view is. A page of the server loads the module: connect() talks through a
// websocket. A notebook's front end imports it: the default export is a widget of anywidget, which
// talks through the kernel's channel. The last part of an ES module (front_end.py).

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
  });
  const open = () => {
    socket = new WebSocket(url);
    view.connection = socket;
    socket.binaryType = "arraybuffer";
    socket.onopen = () => {
      failures = 0;
      view.connected();
    };
    socket.onmessage = ({ data }) => {
      if (typeof data === "string") return view.receive(JSON.parse(data));
      const size = new DataView(data).getUint32(0, true);
      const head = JSON.parse(new TextDecoder().decode(new Uint8Array(data, 4, size)));
      view.receive(head, new Uint8Array(data, 4 + size));
    };
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

/** A view in a notebook: of anywidget. */
function render({ model, el }) {
  const host = document.createElement("div");
  const name = crypto.getRandomValues(new Uint32Array(4)).join("-");
  const send = (message) => model.send({ view: name, message });
  const wheel = (view) => view.root.activeElement === view.picture; // else the notebook scrolls
  const light = document.body.dataset.jpThemeLight; // JupyterLab's theme, whatever the system's
  const isDark = () => (light ? light === "false" : matchMedia(DARK).matches);
  if (light) host.style.colorScheme = isDark() ? "dark" : "light";
  const resize = () => { host.style.height = `${model.get("height")}px`; };
  resize();
  el.append(host);
  const view = new View(host, { send, wheel, hash: false, isDark });
  const receive = ({ view: to, message }, buffers) => {
    if (to !== name) return;
    if (message.type !== "closed") return view.receive(message, buffers?.[0]);
    view.note(`Disconnected: ${message.message}. Run the cell again.`, "drawing");
  };
  model.on("msg:custom", receive);
  model.on("change:height", resize);
  view.connected();
  return () => {
    send(null);
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
