"""Settings of the course's JupyterLab."""

from pathlib import Path

c = get_config()  # type: ignore[name-defined]  # noqa: F821 -- Jupyter provides it
c.LabApp.extension_manager = "readonly"
c.LabApp.news_url = None
# for a checkout; an installed wheel has this extension where every JupyterLab finds it
c.LabApp.extra_labextensions_path = [str(Path(__file__).parent / "labextensions")]
c.LanguageServerManager.autodetect = False
