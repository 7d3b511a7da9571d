// What a reader takes along: a picture, a film of five seconds, and an address that opens the same.

import {element, make} from "./dom.js";

const FILM = 5000; // ms
const RATE = 30; // pictures per second
const TYPES = ["video/mp4", "video/webm"]; // the first one that the browser has
const SHOWN = 2000; // ms for which a button says that it has worked

function download(name, address) {
  make("a", {download: name, href: address}).click();
}

// A film of the canvas, as a blob. viewer: meshcat's; it draws all the time, also what rests.
async function record(viewer) {
  const mimeType = TYPES.find((type) => MediaRecorder.isTypeSupported(type));
  const recorder = new MediaRecorder(viewer.renderer.domElement.captureStream(RATE), {mimeType});
  const parts = [];
  recorder.ondataavailable = ({data}) => parts.push(data);
  const ended = new Promise((done) => { recorder.onstop = done; });
  recorder.start();
  const drawing = setInterval(() => viewer.set_dirty(), 1000 / RATE);
  await new Promise((done) => setTimeout(done, FILM));
  clearInterval(drawing);
  recorder.stop();
  await ended;
  return new Blob(parts, {type: mimeType});
}

// Add the buttons to the menu of views. address(): what to copy; null where a page has none.
export function createShare(viewer, address) {
  const menu = element("tools").querySelector("details > div");
  function add(text, act) {
    const button = make("button", {type: "button", textContent: text});
    button.onclick = async () => {
      button.disabled = true;
      try {
        button.textContent = await act((doing) => { button.textContent = doing; });
      } catch (error) {
        console.error("floatbase: nothing was saved", error);
        button.textContent = "not possible in this browser";
      }
      setTimeout(() => { Object.assign(button, {textContent: text, disabled: false}); }, SHOWN);
    };
    menu.append(button);
  }
  add("save picture", () => {
    download("robot.png", viewer.capture_image());
    return "saved";
  });
  if (window.MediaRecorder) {
    add("save 5 s as film", async (say) => {
      say("recording …");
      const film = await record(viewer), url = URL.createObjectURL(film);
      download(`robot.${film.type.includes("mp4") ? "mp4" : "webm"}`, url);
      setTimeout(() => URL.revokeObjectURL(url), SHOWN);
      return "saved";
    });
  }
  if (address === null) return;
  const field = make("input", {readOnly: true, hidden: true});
  field.setAttribute("aria-label", "address");
  add("copy address", async () => {
    try {
      await navigator.clipboard.writeText(address());
      return "copied";
    } catch { // a page in a frame, or without https, may not write to the clipboard
      Object.assign(field, {hidden: false, value: address()}).select();
      return "press Ctrl+C";
    }
  });
  menu.append(field);
}
