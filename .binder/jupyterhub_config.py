"""JupyterHub for a class on one machine: each student gets a server of JupyterLab, and in it an own
copy of the lessons.

Once, as root, in a copy of the repository that all accounts may read, such as /opt/floatbase, with
an account of the machine for each student, and a Python that all may run:

    make setup
    .venv/bin/python -m pip install -c environment.txt "jupyterhub>=5.2"
    npm install -g configurable-http-proxy

Then, at every start:

    .venv/bin/jupyterhub --config .binder/jupyterhub_config.py

The hub's own address is the only one that a browser needs: pictures travel with everything else
that Jupyter says. Put https in front before students type passwords: `c.JupyterHub.ssl_key` and
`ssl_cert`, or a web server. Where students may want to harm each other, give each server a host
name of its own, too, by `c.JupyterHub.subdomain_host`: else a page that one of them makes and
another opens may do what that other may.
"""

import sys

c = get_config()  # noqa: F821  JupyterHub defines it

c.JupyterHub.bind_url = "http://:8000"
# whoever has an account of this machine but root; or name them: c.Authenticator.allowed_users =
# {"ada"}
c.Authenticator.allow_all = True
c.Authenticator.blocked_users = {"root"}

# What a student's server does first, as that student: keep from other accounts what it writes, make
# a folder that none of them can read, for the ways between its processes, and bring the lessons in
# ~/floatbase up to date, which overwrites no writing.
START = f"""umask 077
JUPYTER_RUNTIME_DIR=$(mktemp -d -t jupyter-XXXXXXXX) || exit 1
export JUPYTER_RUNTIME_DIR
{sys.executable} -m floatbase.lessons.publish workspace --to "$HOME/floatbase"
exec {sys.executable} -m jupyterhub.singleuser "$@\""""
c.Spawner.cmd = ["sh", "-c", START, "floatbase"]
c.Spawner.default_url = "/lab/tree/floatbase/00_start_here.ipynb"
c.Spawner.start_timeout = 120  # s: many start at the first minute of a class
c.Spawner.http_timeout = 120
c.Spawner.environment = {"OPENBLAS_NUM_THREADS": "1"}  # no student's matrices take all cores
c.Spawner.args = [
    # ports of a kernel could be listened to by every account of the machine; sockets in that folder
    # cannot
    "--KernelManager.transport=ipc",
    # s, after which a kernel that no page looks at ends
    "--MappingKernelManager.cull_idle_timeout=3600",
    "--ServerApp.shutdown_no_activity_timeout=7200",  # s, and the whole server
    "--LabApp.news_url=None",
    "--LabApp.extension_manager=readonly",
    "--LanguageServerManager.autodetect=False",
]
