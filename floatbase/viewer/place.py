"""Where this kernel runs: on the reader's machine, or on another one whose pages the reader's browser cannot open."""

from __future__ import annotations

import os
import sys
from collections.abc import Callable
from contextlib import suppress

# set by JupyterHub and Binder, Codespaces, VS Code on another machine, Deepnote, Kaggle, SageMaker, and by ssh
SIGNS = (
    "JUPYTERHUB_USER", "JUPYTERHUB_SERVICE_PREFIX", "BINDER_LAUNCH_HOST", "CODESPACES", "VSCODE_IPC_HOOK_CLI",
    "REMOTE_CONTAINERS", "DEEPNOTE_PROJECT_ID", "KAGGLE_KERNEL_RUN_TYPE", "SAGEMAKER_INTERNAL_IMAGE_URI", "COLAB_RELEASE_TAG",
    "SSH_CONNECTION",
)  # fmt: skip


def kernel_is_remote() -> bool:
    """Whether the live page is out of the reader's reach, judged by the signs that hosts leave in the environment.

    FLOATBASE_VIEWER=live or =static in the environment overrides what was found.
    """
    asked = os.environ.get("FLOATBASE_VIEWER", "")
    if asked in ("live", "static"):
        return asked == "static"
    return "google.colab" in sys.modules or any(os.environ.get(sign) for sign in SIGNS)


def before_each_cell(call: Callable[[], None]) -> Callable[[], None]:
    """Call this before each cell of the notebook runs; outside of IPython never. Returns what ends it."""
    shell = sys.modules["IPython"].get_ipython() if "IPython" in sys.modules else None
    if shell is None:
        return lambda: None

    def run(_: object) -> None:
        call()

    def end() -> None:
        with suppress(ValueError):  # the shell has forgotten it already
            shell.events.unregister("pre_run_cell", run)

    shell.events.register("pre_run_cell", run)
    return end
