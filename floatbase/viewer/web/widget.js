// The picture in a notebook, as anywidget loads it: a frame that holds floatbase's page, and the messages between it and the
// kernel. The page's code comes once for all pictures of this page of the notebook.

// Notebook 7 takes the arrow keys of a slider, to go from heading to heading; JupyterLab leaves them to the slider.
if (!globalThis.floatbaseCodes) {
  const suppress = "data-lm-suppress-shortcuts";
  window.addEventListener("keydown", ({target, key, ctrlKey, altKey, metaKey}) => {
    const moves = !ctrlKey && !altKey && !metaKey && /^(Arrow|Page|Home|End)/.test(key);
    if (target.matches?.(".noUi-handle")) target.toggleAttribute(suppress, moves);
  }, true);
}

const codes = (globalThis.floatbaseCodes ??= new Map());  // version -> promise of {html, viewer}
const PATIENCE = 20000;  // ms; then each picture asks for the code itself: the one that had asked may be gone
const DONE = '{"type": "done"}';
const GONE = "The viewer is closed, or its kernel was restarted: run its cell again.";
const RETIRED = "This viewer is live in a newer output. Run this cell again to have it here.";
const WAITING = "The 3-D picture comes here. Where it does not, run its cell.";
const TOO_OLD = "This browser is too old to open the picture. Open it in a current one: Chrome or Edge from 80, Firefox from " +
  "113, Safari from 16.4.";

const bytes = (data) => new Uint8Array(data.buffer, data.byteOffset, data.byteLength);
const unpacked = (data) =>
  new Response(new Blob([bytes(data)]).stream().pipeThrough(new DecompressionStream("gzip"))).text();

// Ask the kernel for the code.
function asked(model, page) {
  return new Promise((done) => {
    const hear = async (message, buffers) => {
      if (!message.code || message.page !== page) return;
      model.off("msg:custom", hear);
      done({html: await unpacked(buffers[0]), viewer: await unpacked(buffers[1])});
    };
    model.on("msg:custom", hear);
    model.send({page, say: "code"});
  });
}

async function code(model, page) {
  const version = model.get("version");
  if (!codes.has(version)) codes.set(version, asked(model, page));
  const late = new Promise((done) => setTimeout(done, PATIENCE, null));
  return await Promise.race([codes.get(version), late]) ?? Promise.race([codes.get(version), asked(model, page)]);
}

// The still picture, and a line of text over it.
function thumbnail(model, box, words = "") {
  const picture = document.createElement("img"), line = document.createElement("div");
  const data = model.get("thumbnail");
  picture.alt = `picture of ${model.get("name")}`;
  picture.style.cssText = "position: absolute; width: 100%; height: 100%; object-fit: contain";
  if (data?.byteLength) picture.src = URL.createObjectURL(new Blob([bytes(data)], {type: "image/png"}));
  line.style.cssText = "position: absolute; left: 12px; top: 8px; right: 12px; font: 13px system-ui, sans-serif; opacity: 0.75";
  box.append(picture.src ? picture : "", line);
  line.textContent = words || (picture.src ? "" : WAITING);
  return {
    say(words) { line.textContent = words; },
    remove() {
      URL.revokeObjectURL(picture.src);
      picture.remove();
      line.remove();
    },
  };
}

async function render({model, el}) {
  const page = Math.random().toString(36).slice(2), box = document.createElement("div");
  box.style.cssText = `position: relative; width: 100%; height: ${model.get("height")}px; border-radius: 6px; overflow: hidden`;
  el.append(box);
  if (!model.get("is_live")) return void thumbnail(model, box, RETIRED);
  const before = thumbnail(model, box);
  if (!window.DecompressionStream) return before.say(TOO_OLD);
  const frame = document.createElement("iframe");
  frame.title = model.get("name");
  frame.style.cssText = "position: absolute; width: 100%; height: 100%; border: 0";
  let port = null, drawn = 0, received = 0, gone = false, lost = false, ended = false;
  const tell = (say) => { if (!ended && !gone) model.send({page, say}); };

  // The page in the frame has loaded, perhaps anew: a frame that is moved in a document does.
  async function start({source, data}) {
    if (source === null || source !== frame.contentWindow || !data?.ready) return;
    const channel = new MessageChannel();
    port?.close();
    port = channel.port1;
    lost = true;  // what still comes before the new page's hello is an earlier page's
    port.onmessage = ({data: said}) => {
      if (said === DONE) tell(`{"type": "done", "number": ${++drawn}}`);
      else if (said === "hello") {
        drawn = received = 0;
        lost = false;
        before.remove();
        tell("hello");
      } else tell(said);
    };
    const {viewer} = await code(model, page);
    source.postMessage({code: viewer}, "*", [channel.port2]);
    if (gone) port.postMessage({notice: GONE});
  }
  // At once, where the notebook lets its pages reach into their frames: a port's message waits behind all that the notebook has
  // to do, such as its busy sign.
  function give(said) {
    let hear = null;
    try { hear = frame.contentWindow.hear; } catch (error) { /* a frame that nobody may reach into */ }
    if (hear) hear(said);
    else port.postMessage(said, [said]);
  }
  function again() {
    if (lost) return;
    lost = true;
    frame.srcdoc = frame.srcdoc;
  }
  function hear(message, buffers) {
    if (message.closed) return leave();
    if (message.page !== page || port === null) return;
    if (message.lost) again();
    else if (message.frame && !lost) {
      // one got lost, so what it said must come again; before the first, those of an earlier connection may still come
      if (message.frame !== received + 1) return received ? again() : undefined;
      received = message.frame;
      give(bytes(buffers[0]).slice().buffer);
    }
  }
  // The kernel has gone: the picture stays as it is.
  function leave() {
    gone = true;
    if (port) port.postMessage({notice: GONE});
    else before.say(GONE);
  }
  // The connections of all widgets end together. A model hides its own, but that of its layout is there to see.
  function live() {
    setTimeout(() => {
      const was = gone;
      gone = model.get("layout")?.comm_live === false;
      if (gone) leave();
      else if (was) again();
    });
  }
  function stop() {
    if (ended) return;
    tell("bye");
    ended = true;
    window.removeEventListener("message", start);
    model.off("msg:custom", hear);
    model.off("comm_live_update", live);
    model.off("change:is_live", retire);
    port?.close();
  }
  // A newer output shows this viewer: the picture with which this one opened stays.
  function retire() {
    stop();
    frame.remove();
    before.remove();
    thumbnail(model, box, RETIRED);
  }
  window.addEventListener("message", start);
  model.on("msg:custom", hear);
  model.on("comm_live_update", live);
  model.on("change:is_live", retire);
  code(model, page).then(({html}) => {
    if (ended) return;
    frame.srcdoc = html;
    box.append(frame);
  });
  return stop;
}

export default {render};
