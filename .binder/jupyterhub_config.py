"""JupyterHub for a class on one machine: each student gets JupyterLab and a copy of the lessons.

Run once as root, in a copy of the repository that all accounts may read, such as /opt/floatbase.
Each student needs an account of the machine, and all accounts need a Python that they may run:

    make setup
    .venv/bin/python -m pip install -c environment.txt "jupyterhub>=5.2"
    npm install -g configurable-http-proxy@5.3.0

Start the hub with:

    .venv/bin/jupyterhub --config .binder/jupyterhub_config.py

Browsers need only the hub's own address, because pictures use Jupyter's connection. Use https
before students type passwords: set `c.JupyterHub.ssl_key` and `ssl_cert`, or use a web server. If
students might attack each other, also give each server its own host name with
`c.JupyterHub.subdomain_host`. Otherwise a page that one student makes and another opens can act
with the other's rights.
"""

import shlex
import sys

from floatbase.lessons.lab import SETTINGS

c = get_config()  # noqa: F821  JupyterHub defines it

c.JupyterHub.bind_url = "http://:8000"
# every account of this machine except root; or name them: c.Authenticator.allowed_users = {"ada"}
c.Authenticator.allow_all = True
c.Authenticator.blocked_users = {"root"}

# What a student's server does first, as that student: make its files private, create a private
# folder for the sockets between its processes, and update the lessons in ~/floatbase without
# overwriting the student's work. A second process removes the folder when the server has ended.
PYTHON = shlex.quote(sys.executable)
START = f"""umask 077
JUPYTER_RUNTIME_DIR=$(mktemp -d -t jupyter-XXXXXXXX) || exit 1
export JUPYTER_RUNTIME_DIR
(while kill -0 $$; do sleep 2; done; rm -rf "$JUPYTER_RUNTIME_DIR") </dev/null >/dev/null 2>&1 &
{PYTHON} -m floatbase.lessons.publish workspace --to "$HOME/floatbase"
exec {PYTHON} -m jupyterhub.singleuser "$@\""""
c.Spawner.cmd = ["sh", "-c", START, "floatbase"]
c.Spawner.default_url = "/lab/tree/floatbase/00_start_here.ipynb"
c.Spawner.start_timeout = 120  # s: many servers start in the first minute of a class
c.Spawner.http_timeout = 120
c.Spawner.environment = {
    "JUPYTER_CONFIG_PATH": str(SETTINGS),
    "OPENBLAS_NUM_THREADS": "1",  # one student's matrices do not use all cores
}
c.Spawner.args = [
    # other accounts of the machine could connect to a kernel's ports, but not to its sockets
    "--KernelManager.transport=ipc",
    # s after which a kernel without a page ends
    "--MappingKernelManager.cull_idle_timeout=3600",
    "--ServerApp.shutdown_no_activity_timeout=7200",  # s after which an idle server ends
]
