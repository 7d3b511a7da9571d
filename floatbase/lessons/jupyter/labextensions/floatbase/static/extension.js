// An extension of JupyterLab and Jupyter Notebook. A widget in a reopened notebook has lost its
// kernel, and they show "Error displaying widget: model not found", or "Loading widget..." without
// end. This extension shows the next form of the output instead, such as its stored image.
//
// It also gives each picture of a cell the alternative text in the cell's metadata "alt".

(() => {
  const WIDGET = "application/vnd.jupyter.widget-view+json";
  const NOTE = "This was stored when the cell ran. Run the cell again to use it.";
  const PAUSE = 300; // ms between searches for new pictures
  const PATIENCE = 1500; // ms; a widget whose kernel runs appears sooner
  let shared = null; // modules that JupyterLab shares: name -> version -> {get}

  const load = async (name) => (await Object.values(shared[name])[0].get())();

  async function showStored(renderer, rendermime, model) {
    const {[WIDGET]: _, ...others} = model.data;
    const type = rendermime.preferredMimeType(others, model.trusted ? "any" : "ensure");
    if (!type || type === "text/plain") return; // the message says more than that
    const stored = rendermime.createRenderer(type), note = document.createElement("p");
    await stored.renderModel(model);
    note.textContent = NOTE;
    const hasWidget = renderer.widgets.length > 0;
    if (!hasWidget && !renderer.isHidden) renderer.node.replaceChildren(stored.node, note);
  }

  function activate(_, rendermime) {
    const {prototype} = rendermime.createRenderer(WIDGET).constructor;
    const renderWidget = prototype.renderModel;
    prototype.renderModel = async function (model) {
      const show = () => showStored(this, rendermime, model);
      const waiting = setTimeout(show, PATIENCE); // without a kernel, no answer comes
      await renderWidget.call(this, model);
      clearTimeout(waiting);
      await show();
    };
  }

  function describe(notebooks) {
    notebooks.forEach(({content}) => content.widgets.forEach(({model, outputArea}) => {
      const alt = model.getMetadata("alt");
      if (!alt || !outputArea) return;
      outputArea.node.querySelectorAll("img").forEach((image) => { image.alt = alt; });
      outputArea.node.querySelectorAll("iframe").forEach((frame) => { frame.title = alt; });
    }));
  }

  async function plugins() {
    const {IRenderMimeRegistry} = await load("@jupyterlab/rendermime");
    const {IJupyterWidgetRegistry} = await load("@jupyter-widgets/base"); // has its renderer then
    const {INotebookTracker} = await load("@jupyterlab/notebook");
    return [{
      id: "floatbase:stored-images", autoStart: true, activate,
      requires: [IRenderMimeRegistry, IJupyterWidgetRegistry],
    }, {
      id: "floatbase:alternative-texts", autoStart: true, requires: [INotebookTracker],
      activate: (_, notebooks) => {
        let isWaiting = false;
        new MutationObserver(() => {
          if (!isWaiting) setTimeout(() => { isWaiting = false; describe(notebooks); }, PAUSE);
          isWaiting = true;
        }).observe(document.body, {childList: true, subtree: true});
      },
    }];
  }

  (window._JUPYTERLAB ??= {}).floatbase = {
    init(modules) { shared = modules; },
    async get() {
      const made = await plugins();
      return () => ({__esModule: true, default: made});
    },
  };
})();
