// A live robot in any page:
//   <script src="…/floatbase-live.js"></script>
//   <floatbase-robot name="go2" mu="0.6" push="40"></floatbase-robot>
// The element has the size that the page gives it. What is inside it, such as an image or a
// recording, is shown until the robot is live, and stays where it cannot be. Paragraphs go at once.
// With the attribute `waits`, the recording is loaded only if the element sends `unavailable`.

const HERE = document.currentScript.src;
const PATIENCE = 20000; // ms until a robot that is not live counts as unavailable
const KEPT = ["name", "mu", "push", "gait", "panel"];

class FloatbaseRobot extends HTMLElement {
  connectedCallback() {
    if (this.frame) return;
    if (typeof WebAssembly === "undefined" || HERE.startsWith("file:")) return this.giveUp();
    const near = new IntersectionObserver((entries) => {
      if (!entries.some(({isIntersecting}) => isIntersecting)) return;
      near.disconnect();
      this.open();
    }, {rootMargin: "300px 0px"});
    near.observe(this);
  }

  open() {
    const address = new URL("robot.html", HERE);
    for (const key of KEPT) {
      if (this.hasAttribute(key)) address.searchParams.set(key, this.getAttribute(key));
    }
    if (!this.hasAttribute("panel")) address.searchParams.set("panel", "0");
    const hasFallback = this.querySelector(":scope > :not(p)") !== null;
    const style = getComputedStyle(this);
    if (style.display === "inline") this.style.display = "block";
    if (style.position === "static") this.style.position = "relative";
    if (this.offsetHeight < 40) this.style.height = "420px";
    this.frame = document.createElement("iframe");
    this.frame.allow = "clipboard-write"; // for its button "copy address"
    this.frame.title = `live robot ${this.getAttribute("name") ?? "go2"}: drag it to push it`;
    this.frame.style.cssText = "position:absolute;inset:0;width:100%;height:100%;border:0;" +
      `border-radius:6px;${hasFallback ? "opacity:0;pointer-events:none" : ""}`;
    addEventListener("message", ({source, data}) => {
      if (source !== this.frame.contentWindow || !data?.floatbase) return;
      if (data.floatbase === "live") this.takeOver();
      if (data.floatbase === "unavailable") return this.giveUp();
      this.dispatchEvent(new CustomEvent(data.floatbase, {detail: data}));
    });
    this.frame.src = address.href;
    this.append(this.frame);
    this.patience = setTimeout(() => this.giveUp(), PATIENCE);
  }

  giveUp() {
    if (!this.hasAttribute("waits")) return;
    this.removeAttribute("waits");
    this.dispatchEvent(new Event("unavailable"));
  }

  // The robot is live: what was shown instead of it goes.
  takeOver() {
    clearTimeout(this.patience);
    const height = this.offsetHeight;
    for (const child of [...this.childNodes]) if (child !== this.frame) child.remove();
    this.style.height = `${height}px`;
    this.frame.style.opacity = 1;
    this.frame.style.pointerEvents = "";
  }
}

if (!customElements.get("floatbase-robot")) {
  customElements.define("floatbase-robot", FloatbaseRobot);
}
