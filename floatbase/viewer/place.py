"""Where the kernel runs: on the reader's machine, or on another whose pages the reader's browser cannot open."""

from __future__ import annotations

import os
import sys
from collections.abc import Callable
from contextlib import suppress

# environment variables that JupyterHub, Binder, Codespaces, VS Code on another machine, Deepnote, Kaggle, SageMaker, Colab
# and ssh set
SIGNS = (
    "JUPYTERHUB_USER", "JUPYTERHUB_SERVICE_PREFIX", "BINDER_LAUNCH_HOST", "CODESPACES", "VSCODE_IPC_HOOK_CLI",
    "REMOTE_CONTAINERS", "DEEPNOTE_PROJECT_ID", "KAGGLE_KERNEL_RUN_TYPE", "SAGEMAKER_INTERNAL_IMAGE_URI", "COLAB_RELEASE_TAG",
    "SSH_CONNECTION",
)  # fmt: skip


def kernel_is_remote() -> bool:
    """Whether the reader's browser cannot reach the live page, judged by the environment variables that hosts set.

    FLOATBASE_VIEWER=live or =static in the environment overrides the judgement.
    """
    requested = os.environ.get("FLOATBASE_VIEWER", "")
    if requested in ("live", "static"):
        return requested == "static"
    return "google.colab" in sys.modules or any(os.environ.get(sign) for sign in SIGNS)


def before_each_cell(call: Callable[[], None]) -> Callable[[], None]:
    """Have `call` called before each cell of the notebook; outside IPython never. Returns a function that ends this."""
    shell = sys.modules["IPython"].get_ipython() if "IPython" in sys.modules else None
    if shell is None:
        return lambda: None

    def run(_: object) -> None:
        call()

    def end() -> None:
        with suppress(ValueError):  # it is registered no more
            shell.events.unregister("pre_run_cell", run)

    shell.events.register("pre_run_cell", run)
    return end
