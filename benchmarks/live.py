"""The live robot in node, Chromium and Firefox beside Python: `python benchmarks/live.py`.

Every browser answers the 600 states of tests/live_reference.py, repeats its runs and walks, and
measures single control steps of 1 ms of the standing go2, warm, with the physics. The same loop in
Python is measured beside them. The last bits of a push, a fall and a trot are compared. Browsers
that are not installed are left out. Other programs on the machine enter all times.
"""

from __future__ import annotations

import argparse
import json
import shutil
import subprocess
import sys
import tempfile
import threading
import time
from functools import partial
from http.server import SimpleHTTPRequestHandler, ThreadingHTTPServer
from pathlib import Path
from typing import Any

import numpy as np

import floatbase as fb
from floatbase.live import folder as live_folder
from floatbase.live import robots

sys.path.insert(0, str(Path(__file__).parents[1] / "tests"))
import live_reference

STEPS = 20000
PAGE = """<!DOCTYPE html><title>benchmark</title><script type="module">
import loadMujoco from "./mujoco.js";
import {FILES, NUMBERS, compare, measure} from "./compare.js";
const read = (name, how) => fetch(name).then((response) => response[how]());
try {
  const named = (names, how) =>
    Promise.all(names.map(async (name) => [name, await how(name)]));
  const files = Object.fromEntries([
    ...await named(FILES, (name) => read(name, "json")),
    ...await named(NUMBERS, async (name) => new Float64Array(await read(name, "arrayBuffer"))),
  ]);
  const mj = await loadMujoco({locateFile: (name) => name});
  const module = await WebAssembly.compile(await read("tick.wasm", "arrayBuffer"));
  const given = {mj, module, files};
  const found = {...await compare(given), speed: measure(given)};
  await fetch("/found", {method: "POST", body: JSON.stringify(found)});
} catch (error) {
  const text = JSON.stringify({error: String(error.stack ?? error)});
  await fetch("/found", {method: "POST", body: text});
}
</script>"""


class Handler(SimpleHTTPRequestHandler):
    """Serves the folder, and receives what a page has found."""

    found: Any = None

    def end_headers(self) -> None:
        # an isolated page has a clock with a resolution of 5 µs instead of 100
        self.send_header("Cross-Origin-Opener-Policy", "same-origin")
        self.send_header("Cross-Origin-Embedder-Policy", "require-corp")
        super().end_headers()

    def do_POST(self) -> None:
        Handler.found = json.loads(self.rfile.read(int(self.headers["Content-Length"])))
        self.send_response(204)
        self.end_headers()

    def log_message(self, *_: Any) -> None:
        pass


def write_folder(place: Path) -> None:
    """Write the live robots, the reference, and the code that compares them."""
    live_folder.write(place)
    live_reference.write(place)
    (place / "benchmark.html").write_text(PAGE)
    command = ["npx", "esbuild", "compare.js", "--bundle", "--format=esm"]
    subprocess.run([*command, f"--outfile={place / 'compare.js'}", "--log-level=warning"],
                   cwd=live_folder.WEB, check=True)  # fmt: skip


def in_browser(command: list[str], wait: float = 600.0) -> Any:
    """Open the page in a browser, and return what it finds."""
    Handler.found = None
    process = subprocess.Popen(command, stdout=subprocess.DEVNULL, stderr=subprocess.DEVNULL)
    try:
        end = time.monotonic() + wait
        while Handler.found is None and time.monotonic() < end:
            time.sleep(0.2)
    finally:
        process.terminate()
        process.wait()
    return Handler.found or {"error": f"no answer in {wait:g} s"}


def in_node(place: Path) -> Any:
    run = partial(subprocess.run, cwd=live_folder.WEB, capture_output=True, text=True, check=True)
    command = ["node", "reference.mjs", str(place)]
    found = json.loads(run(command).stdout)
    return found | {"speed": json.loads(run([*command, "--measure"]).stdout)}


def in_python() -> dict[str, float]:
    """Times of the same steps in Python [µs]."""
    robot = fb.load("go2")
    sim, made = fb.Simulation(robot, robots.MU), robots.controller(robot)
    sim.reset(robot.standing())
    times = np.empty(STEPS)
    for i in range(-3000, STEPS):
        start = time.perf_counter()
        sim.step(made(sim.q, sim.v, sim.time).tau)
        times[max(i, 0)] = 1e6 * (time.perf_counter() - start)
    return {"median": float(np.median(times)), "p99": float(np.quantile(times, 0.99)),
            "mean": float(times.mean())}  # fmt: skip


def row(name: str, found: Any, python: dict[str, float], bits: str) -> str:
    if "error" in found:
        return f"{name:10} {found['error']}"
    states, speed = found["states"], found["speed"]
    far = max(run["firstSecond"] for run in found["runs"])
    targets = max(walk["inputs"] for walk in found["walks"])
    equal = "same" if speed["bits"] == bits else "other"
    same = all(run["outcome"] == run["python"] for run in found["runs"] + found["walks"])
    return (
        f"{name:10} {states['states'] - states['otherActive'] - states['otherCode']:4d} of "
        f"{states['states']} {states['torque']:8.1e} {1e6 * far:6.1f} µm {targets:8.1e} "
        f"{'same' if same else 'OTHER':8} {speed['median']:7.0f} {speed['p99']:7.0f} "
        f"{speed['median'] / python['median']:6.2f}   {equal}"
    )


def main(arguments: list[str] | None = None) -> None:
    """Measure, and print a table."""
    parser = argparse.ArgumentParser(description=__doc__)
    parser.add_argument("--folder", type=Path, help="keep the files there")
    given = parser.parse_args(arguments)
    with tempfile.TemporaryDirectory(prefix="floatbase-") as temporary:
        place = given.folder or Path(temporary) / "live"
        write_folder(place)
        server = ThreadingHTTPServer(("127.0.0.1", 0), partial(Handler, directory=str(place)))
        threading.Thread(target=server.serve_forever, daemon=True).start()
        address = f"http://127.0.0.1:{server.server_port}/benchmark.html"
        profile = str(Path(temporary) / "firefox")
        commands = {
            "Chromium": ["chromium", "--headless", "--no-sandbox", "--disable-gpu",
                         f"--user-data-dir={temporary}/chromium", address],
            "Firefox": ["firefox-esr", "--headless", "--no-remote", "--profile", profile, address],
        }  # fmt: skip
        Path(profile).mkdir()
        python = in_python()
        print(
            "           states      torque  first s    targets  outcomes  median     p99  "
            "/ Python bits"
        )
        print(f"{'Python':10} {'':43} {python['median']:7.0f} {python['p99']:7.0f}")
        node = in_node(place)
        print(row("node", node, python, node["speed"]["bits"]), flush=True)
        for name, command in commands.items():
            if shutil.which(command[0]):
                print(row(name, in_browser(command), python, node["speed"]["bits"]), flush=True)
        server.shutdown()


if __name__ == "__main__":
    main()
