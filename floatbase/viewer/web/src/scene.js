// The scene of a page: meshcat's viewer with our commands. It draws frames from any source.

import {createAddress} from "./address.js";
import {createCamera} from "./camera.js";
import {element} from "./dom.js";
import {createDrag, sliderDrag} from "./drag.js";
import {createInteraction} from "./interaction.js";
import {createLegend} from "./legend.js";
import {splitFrame} from "./loader.js";
import {createViewer, interceptCommands} from "./meshcat.js";
import {createPanel} from "./panel.js";
import {createPlayer} from "./player.js";
import {adaptPixels, createRenderer} from "./renderer.js";
import {createShare} from "./share.js";
import {createTheme} from "./theme.js";

const PUSHED_AFTER = 1000; // ms until the push of an address

// config: {mode, backgrounds, shades}, see page.js and theme.js. Throws an error if the browser has
// no WebGL.
export function createScene(config) {
  const pane = element("meshcat-pane"), {renderer, isCheap} = createRenderer(pane);
  const viewer = createViewer(pane, renderer);
  adaptPixels(viewer, isCheap);
  let send = () => {};
  const player = createPlayer(viewer);
  let moreOfAddress = () => ({}); // {key: numbers} of what a page knows beside its controls
  const panel = createPanel((message) => {
    if (config.mode === "live" && sliders.isWanted()) {
      const pushed = sliders.isPush(message.name) ? sliders.now() : undefined;
      if (pushed || message.name === "reset everything") moreOfAddress = () => ({pushed});
    }
    send(message);
    address?.changed();
  });
  const sliders = sliderDrag(panel.controls);
  const hasAddress = config.mode === "live" || config.mode === "robot";
  const address = hasAddress ? createAddress(panel.controls, (text) => {
    panel.setText({name: "address", text});
  }) : null;
  const camera = createCamera(viewer);
  const theme = createTheme(viewer, config);
  const legend = createLegend(theme.colour);
  theme.onChange(legend.redraw);
  const interaction = createInteraction(viewer, camera);
  if (config.mode !== "robot") createDrag(viewer, sliders);
  createShare(viewer, hasAddress
    ? () => address.link({view: camera.view(), ...moreOfAddress()}) : null);
  new ResizeObserver(([{target}]) => {
    element("board").style.top = `${target.offsetTop + target.offsetHeight + 6}px`;
  }).observe(element("title"));
  new ResizeObserver(() => viewer.set_3d_pane_size()).observe(pane); // the panel takes its room
  const handlers = {
    set_camera: camera.look,
    set_follow: camera.setFollow,
    set_ground: camera.setGround,
    set_views: interaction.setViews,
    set_title({text}) {
      element("title").textContent = text;
      interaction.describe(text);
    },
    set_legend: ({items}) => legend.show(items),
    set_theme: theme.set,
    set_disconnect_message({text}) { element("notice").textContent = text; },
    set_animation(command, meshcat) {
      meshcat(command);
      player.load(command);
    },
    set_control(command) {
      panel.addControl(command);
      address?.added(command);
    },
    set_control_value(command) {
      panel.setValue(command);
      address?.changed();
    },
    set_text: panel.setText,
    add_plot_point: panel.addPoint,
  };
  interceptCommands(viewer, handlers, (command, made) => {
    if (made) camera.scaleLabels(made);
    theme.afterCommand(command, made);
  });
  viewer.gui_controllers = panel.controls; // for programs that control the page from outside
  return {
    viewer,
    controls: panel.controls,
    foldPanel: panel.fold,
    // Draw a frame. A command that fails is reported; the others are still executed.
    apply(frame) {
      for (const command of splitFrame(frame)) {
        try {
          viewer.handle_command_bytearray(command);
        } catch (error) {
          console.error("floatbase: a drawing command failed", error);
        }
      }
      address?.apply();
      viewer.num_messages_received++;
    },
    address,
    // Set the function that returns what an address has beside the controls and the view.
    onLink(call) { moreOfAddress = call; },
    // Look as the address says, if it does.
    lookAsAddressed() {
      const [x, y, z, ...target] = address.numbers("view", 6) ?? [];
      if (x !== undefined) camera.look({fov: viewer.camera.fov, position: [x, y, z], target});
    },
    // Push by the sliders as the address says, if it does.
    pushAsAddressed() {
      if (!sliders.isWanted()) return;
      const values = address.numbers("pushed", sliders.now().length);
      if (values) setTimeout(() => sliders.push(values), PUSHED_AFTER);
    },
    handle(command) {
      viewer.handle_command(command);
      address?.apply();
    },
    fit: () => viewer.set_3d_pane_size(),
    // a PNG as a data URL
    capture: () => viewer.capture_image(),
    // Set the function that receives the reader's actions: call(message), an object.
    onMessage(call) { send = call; },
  };
}
