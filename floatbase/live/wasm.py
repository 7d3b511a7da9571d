"""The compiled tick as WebAssembly: one module that serves every robot, built from the same Python.

numba compiles `control.tick`, and the targets of a walk in `behaviours.walk.compiled_targets`, to
LLVM's intermediate code. llvmlite turns that code into object files for WebAssembly, and the linker
wasm-ld makes one module of them. The module is kept beside this file with a digest of its
sources, so that only a change of these sources needs the linker.
"""

from __future__ import annotations

import os
import re
import shutil
import subprocess
import sys
import tempfile
from hashlib import sha256
from pathlib import Path
from typing import Any

from floatbase.behaviours.walk import compiled_targets
from floatbase.control.tick.jit import source_digest
from floatbase.errors import InputError

MODULE = Path(__file__).with_name("tick.wasm")
DIGEST = MODULE.with_suffix(".sha256")
ENTRIES = ("tick", "write_targets")  # names of the exported functions
# exported as well: the page's plans of a walk need them, and must not differ between browsers
FUNCTIONS = ("exp", "sin", "cos", "atan2", "hypot")

# musl's mathematical functions, which make the module give the same answers in every browser:
# those of JavaScript differ in the last digit. Debian and Ubuntu, then Fedora
_LIBRARIES = (
    Path("/usr/lib/wasm32-wasi/libc.a"),
    Path("/usr/wasm32-wasi/lib/wasm32-wasi/libc.a"),
)
_LINKERS = ("wasm-ld", *(f"wasm-ld-{version}" for version in range(25, 13, -1)))


def linker() -> str | None:
    """Return the path of the linker for WebAssembly, or None if there is none."""
    return next((path for name in _LINKERS if (path := shutil.which(name))), None)


def library() -> Path | None:
    """Return the C library for WebAssembly, or None if there is none."""
    return next((path for path in _LIBRARIES if path.is_file()), None)


def current_digest() -> str:
    """Return the digest of all sources of the module: the tick, the targets, and this file."""
    files = [Path(compiled_targets.__file__), Path(__file__)]
    texts = b"".join(file.read_bytes() for file in files)
    return sha256(f"{source_digest()} ".encode() + texts).hexdigest()


def is_current() -> bool:
    """Return whether the module on disk was built from the present sources."""
    return DIGEST.is_file() and DIGEST.read_text().strip() == current_digest()


def build(module: Path = MODULE) -> int:
    """Compile the tick to WebAssembly, and write the module and the digest of its sources."""
    program, libc = linker(), library()
    if program is None or libc is None:
        raise InputError(
            "The WebAssembly module of the controller needs the linker wasm-ld and the C library "
            "of WASI, but at least one is missing. Install them (on Debian and Ubuntu: apt install "
            "lld wasi-libc)."
        )
    with tempfile.TemporaryDirectory(prefix="floatbase-") as place:
        objects = [str(Path(place) / f"{name}.o") for name in ENTRIES]
        # numba reads the target from the environment when it is imported. A generic processor
        # leaves no instructions in the code that WebAssembly does not have
        target = {"NUMBA_CPU_NAME": "generic", "NUMBA_CPU_FEATURES": "", "NUMBA_CACHE_DIR": place}
        subprocess.run(
            [sys.executable, "-m", __name__, *objects], env=os.environ | target, check=True
        )
        module.parent.mkdir(parents=True, exist_ok=True)
        names = (*ENTRIES, *FUNCTIONS, "__heap_base", "__stack_pointer")
        exports = [f"--export={name}" for name in names]
        options = ["--no-entry", "--allow-undefined", "--gc-sections", "--strip-all", *exports]
        subprocess.run([program, *options, "-o", str(module), *objects, str(libc)], check=True)
    module.with_suffix(".sha256").write_text(f"{current_digest()}\n")
    return module.stat().st_size


def _tick_arguments() -> tuple[Any, ...]:
    """Return arguments of the tick; their types are the same for every robot."""
    import numpy as np

    from floatbase.control import WholeBodyController
    from floatbase.control.tick import CompiledTick, tick
    from floatbase.dynamics import Contacts
    from floatbase.objectives import standing_tasks
    from floatbase.robots import load

    robot = load("go2")
    tasks = standing_tasks(robot.standing())
    controller = WholeBodyController(robot, Contacts.feet(robot), tasks, backend="reference")
    compiled = CompiledTick(controller.problem)
    inputs = compiled.default_inputs
    return (
        np.array(robot.standing().q),
        np.zeros(robot.nv),
        inputs.packed,
        *compiled.tables,
        *compiled.workspace(),
        compiled.empty_result(inputs),
        tick.N_STAGES,
    )


def _write_objects(paths: list[Path]) -> None:
    """Write the functions of `ENTRIES` as object files for WebAssembly, in this order."""
    import llvmlite.binding as llvm
    import numpy as np

    from floatbase.control.tick import tick

    vector, matrix = np.zeros(3), np.zeros((1, 1))
    targets = (0.0, vector, vector, vector, matrix, matrix, vector)
    codes = [
        _wasm_code(tick.tick.py_func, _tick_arguments(), ENTRIES[0]),
        _wasm_code(compiled_targets.write_targets.py_func, targets, ENTRIES[1]),
    ]
    llvm.initialize_all_targets()
    llvm.initialize_all_asmprinters()
    machine = llvm.Target.from_triple("wasm32-unknown-unknown").create_target_machine(
        opt=3, features="+simd128,+bulk-memory", reloc="static"
    )
    for path, code in zip(paths, codes, strict=True):
        parsed = llvm.parse_assembly(f'target datalayout = "{machine.target_data}"\n{code}')
        parsed.verify()
        path.write_bytes(machine.emit_object(parsed))


def _wasm_code(function: Any, arguments: tuple[Any, ...], entry: str) -> str:
    """Return LLVM's intermediate code of a function for arguments of these types."""
    import numba

    from floatbase.control.tick import jit

    signature = tuple(numba.typeof(argument) for argument in arguments)
    compiled = jit.jit(function)
    compiled.compile(signature)
    name = compiled.overloads[compiled.signatures[0]].fndesc.llvm_func_name
    code = compiled.inspect_llvm(compiled.signatures[0])
    code = re.sub(r'target triple = ".*"', 'target triple = "wasm32-unknown-unknown"', code)
    code = re.sub(r'target datalayout = ".*"', "", code)
    code = re.sub(r'"target-(cpu|features)"="[^"]*"', "", code)
    # WebAssembly has no common symbols
    code = re.sub(r"= common (local_unnamed_addr )?global", "= internal global", code)
    # reference counts are atomic on x86. Only code that allocates has them: see `engine.js`
    code = code.replace("@llvm.x86.", "@x86_")
    code = re.sub(
        r"^declare.*@x86_.*$", lambda found: found[0].replace("immarg", ""), code, flags=re.M
    )
    return code.replace(f"@{name}(", f"@{entry}(")


if __name__ == "__main__":
    _write_objects([Path(name) for name in sys.argv[1:]])
