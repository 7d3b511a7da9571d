// The picture in a notebook, as anywidget loads it: a frame that holds floatbase's page, and the
// messages between it and the kernel. The page's code is sent once for all pictures of this page of
// the notebook, although each widget loads this module separately.

import {make} from "./dom.js";
import {canUnpack, unpackText} from "./loader.js";
import {CLOSED, RETIRED, TOO_OLD, WAITING} from "./messages.js";
import {createSequence} from "./sequence.js";

const PATIENCE = 20000; // ms to wait for another picture's request for the code, which may be lost
const FILLING = "position: absolute; width: 100%; height: 100%";

// Notebook 7 uses the arrow keys to go from heading to heading, even in a slider; JupyterLab leaves
// them to the slider.
function keepSliderKeys() {
  window.addEventListener("keydown", ({target, key, ctrlKey, altKey, metaKey}) => {
    const moves = !ctrlKey && !altKey && !metaKey && /^(Arrow|Page|Home|End)/.test(key);
    if (target.matches?.(".noUi-handle")) {
      target.toggleAttribute("data-lm-suppress-shortcuts", moves);
    }
  }, true);
}

if (!globalThis.floatbaseCodes) keepSliderKeys();
const codes = globalThis.floatbaseCodes ??= new Map(); // version -> promise of {html, viewer}

const bytesOf = (data) => new Uint8Array(data.buffer, data.byteOffset, data.byteLength);

// Ask the kernel for the code.
function requestCode(model, page) {
  return new Promise((done) => {
    const receive = async (message, buffers) => {
      if (!message.code || message.page !== page) return;
      model.off("msg:custom", receive);
      const [html, viewer] = await Promise.all(buffers.map((data) => unpackText(bytesOf(data))));
      done({html, viewer});
    };
    model.on("msg:custom", receive);
    model.send({page, say: "code"});
  });
}

async function loadCode(model, page) {
  const version = model.get("version");
  if (!codes.has(version)) codes.set(version, requestCode(model, page));
  const late = new Promise((done) => setTimeout(done, PATIENCE, null));
  return await Promise.race([codes.get(version), late])
    ?? Promise.race([codes.get(version), requestCode(model, page)]);
}

// Show the saved image, with a line of text over it, until the page has drawn.
function showThumbnail(model, box) {
  const data = model.get("thumbnail"), image = make("img");
  const line = make("div");
  image.alt = `picture of ${model.get("name")}`;
  image.style.cssText = `${FILLING}; object-fit: contain`;
  line.style.cssText = "position: absolute; left: 12px; top: 8px; right: 12px; opacity: 0.75; " +
    "font: 13px system-ui, sans-serif";
  if (data?.byteLength) {
    image.src = URL.createObjectURL(new Blob([bytesOf(data)], {type: "image/png"}));
    box.append(image);
  } else line.textContent = WAITING;
  box.append(line);
  return {
    setText(text) { line.textContent = text; },
    remove() {
      URL.revokeObjectURL(image.src);
      image.remove();
      line.remove();
    },
  };
}

async function render({model, el}) {
  const page = Math.random().toString(36).slice(2), box = make("div");
  box.style.cssText = `position: relative; width: 100%; height: ${model.get("height")}px; ` +
    "border-radius: 6px; overflow: hidden";
  el.append(box);
  const thumbnail = showThumbnail(model, box);
  if (!model.get("is_live")) return thumbnail.setText(RETIRED);
  if (!canUnpack()) return thumbnail.setText(TOO_OLD);
  const frame = make("iframe", {title: model.get("name")});
  frame.style.cssText = `${FILLING}; border: 0`;
  const sequence = createSequence();
  let port = null, isClosed = false, hasEnded = false;
  const tell = (say) => { if (!hasEnded && !isClosed) model.send({page, say}); };

  // The page in the frame has loaded, perhaps again: a frame that is moved in a document reloads.
  async function connect({source, data}) {
    if (source === null || source !== frame.contentWindow || !data?.ready) return;
    const channel = new MessageChannel();
    port?.close();
    port = channel.port1;
    sequence.lose();
    port.onmessage = ({data: said}) => {
      if (said === "hello") {
        sequence.begin();
        thumbnail.remove();
        tell("hello");
      } else if (JSON.parse(said).type === "done") {
        tell(JSON.stringify({type: "done", number: sequence.nextDrawn()}));
      } else tell(said);
    };
    const {viewer} = await loadCode(model, page);
    source.postMessage({code: viewer}, "*", [channel.port2]);
    if (isClosed) port.postMessage({notice: CLOSED});
  }
  // Immediately, if the notebook lets its pages access their frames: a message to a port waits
  // until the notebook has finished other work, such as its busy indicator.
  function give(message) {
    let receive = null;
    try {
      receive = frame.contentWindow.receiveMessage;
    } catch { /* a frame that the notebook may not reach into */ }
    if (receive) receive(message);
    else port.postMessage(message, [message]);
  }
  function reload() {
    if (sequence.isLost()) return;
    sequence.lose();
    // eslint-disable-next-line no-self-assign -- this reloads the page of a frame
    frame.srcdoc = frame.srcdoc;
  }
  function receive(message, buffers) {
    if (message.closed) return close();
    if (message.page !== page || port === null) return;
    if (message.lost) reload();
    else if (message.frame) {
      const action = sequence.receive(message.frame);
      if (action === "reload") reload();
      else if (action === "draw") give(bytesOf(buffers[0]).slice().buffer);
    }
  }
  // The kernel has gone: the picture stays as it is.
  function close() {
    isClosed = true;
    if (port) port.postMessage({notice: CLOSED});
    else thumbnail.setText(CLOSED);
  }
  // The connections of all widgets end together. A model hides its own, but that of its layout is
  // accessible.
  function watchConnection() {
    setTimeout(() => {
      const wasClosed = isClosed;
      isClosed = model.get("layout")?.comm_live === false;
      if (isClosed) close();
      else if (wasClosed) reload();
    });
  }
  function end() {
    if (hasEnded) return;
    tell("bye");
    hasEnded = true;
    window.removeEventListener("message", connect);
    model.off("msg:custom", receive);
    model.off("comm_live_update", watchConnection);
    model.off("change:is_live", retire);
    port?.close();
  }
  // A newer output shows this viewer, so this one shows the image with which it opened.
  function retire() {
    end();
    frame.remove();
    thumbnail.remove();
    showThumbnail(model, box).setText(RETIRED);
  }
  window.addEventListener("message", connect);
  model.on("msg:custom", receive);
  model.on("comm_live_update", watchConnection);
  model.on("change:is_live", retire);
  loadCode(model, page).then(({html}) => {
    if (hasEnded) return;
    frame.srcdoc = html;
    box.append(frame);
  });
  return end;
}

export default {render};
