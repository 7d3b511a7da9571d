"""What serves a class without an installation of its own: container, Binder, dev container, hub, and what publishes a release.

No container is built here. Looked at is what would make one fail or differ from the course: names, versions, rights.
"""

from __future__ import annotations

import ast
import json
import os
import re
import subprocess
from pathlib import Path

import pytest

ROOT = Path(__file__).resolve().parent.parent
DOCKERFILE = (ROOT / "Dockerfile").read_text(encoding="utf-8")
POST_BUILD = (ROOT / ".binder" / "postBuild").read_text(encoding="utf-8")
SCRIPTS = sorted(path for name in ("postBuild", "start") for path in (ROOT / ".binder").glob(name))
PYTHONS = re.findall(r"Python :: (3\.\d+)", (ROOT / "pyproject.toml").read_text(encoding="utf-8"))
STEPS = re.findall(r"^([A-Z]+) (.+)$", DOCKERFILE.replace("\\\n", " "), flags=re.MULTILINE)  # instruction and what follows


def step(name: str) -> str:
    """What the last instruction of this name says."""
    return [text for instruction, text in STEPS if instruction == name][-1]


@pytest.mark.parametrize("text", [DOCKERFILE, POST_BUILD], ids=["Dockerfile", "postBuild"])
def test_all_is_installed_from_the_lock_and_compiled_for_any_processor(text: str) -> None:
    for line in re.findall(r"pip install[^&\n]*", text.replace("\\\n", " ")):
        assert "-c environment.txt" in line, line
    assert "NUMBA_CPU_NAME=generic" in text
    assert text.index("pip install") < text.index("python -m floatbase compile")


def test_the_container_serves_as_no_root_and_no_root_can_be_reached_from_it() -> None:
    users = [text for instruction, text in STEPS if instruction == "USER"]
    assert users == ["learner"] and "useradd" in DOCKERFILE
    names = [instruction for instruction, _ in STEPS]
    assert names.index("USER") < names.index("CMD") and "RUN" not in names[names.index("USER") :]
    assert "--allow-root" not in DOCKERFILE and "sudo" not in DOCKERFILE


def test_the_containers_command_is_one_that_sh_understands_and_opens_the_first_lesson() -> None:
    sh, option, command = json.loads(step("CMD"))
    assert (sh, option) == ("sh", "-c")
    subprocess.run(["sh", "-n", "-c", command], check=True)
    folder, lesson = re.search(r"/lab/tree/(\w+)/(\w+\.ipynb)", command).groups()  # type: ignore[union-attr]
    assert f"workspace --to {folder};" in command and (ROOT / "notebooks" / lesson).exists()


def test_the_pythons_are_such_as_the_course_knows() -> None:
    assert step("FROM").removeprefix("python:").removesuffix("-slim") in PYTHONS
    assert (ROOT / ".binder" / "runtime.txt").read_text().strip().removeprefix("python-") in PYTHONS
    assert json.loads((ROOT / ".devcontainer" / "devcontainer.json").read_text())["image"].rpartition(":")[2] in PYTHONS


def test_the_scripts_can_be_run_and_are_bash() -> None:
    assert len(SCRIPTS) == 2
    for script in SCRIPTS:
        assert os.access(script, os.X_OK), script
        subprocess.run(["bash", "-n", script], check=True)


def test_the_dev_container_uses_targets_that_exist() -> None:
    container = json.loads((ROOT / ".devcontainer" / "devcontainer.json").read_text())
    makefile = (ROOT / "Makefile").read_text(encoding="utf-8")
    for command in (container["onCreateCommand"], container["postAttachCommand"]):
        assert re.search(rf"^{command.split()[1]}:", makefile, flags=re.MULTILINE), command
    assert container["remoteUser"] != "root"


def test_the_hubs_configuration_says_what_python_understands() -> None:
    text = (ROOT / ".binder" / "jupyterhub_config.py").read_text(encoding="utf-8")
    set_ = {ast.unparse(node.targets[0]) for node in ast.walk(ast.parse(text)) if isinstance(node, ast.Assign)}
    assert {"c.Spawner.cmd", "c.Spawner.default_url", "c.Spawner.args"} <= set_
    assert "--KernelManager.transport=ipc" in text
    assert re.search(r'^c\.Authenticator\.blocked_users = \{"root"\}$', text, flags=re.MULTILINE)


def test_a_release_is_checked_before_it_is_published() -> None:
    text = (ROOT / ".github" / "workflows" / "publish.yml").read_text(encoding="utf-8")
    for script in re.findall(r"python (\.ci/\S+)", text):
        assert (ROOT / script).exists(), script
    release = text[text.index("  pypi:") : text.index("  site:")]
    assert "needs: [package, tests]" in release and "uses: ./.github/workflows/test.yml" in text
    assert "workflow_call:" in (ROOT / ".github" / "workflows" / "test.yml").read_text(encoding="utf-8")
    assert "github.ref_type == 'tag'" in release and "id-token: write" in release
    assert "password" not in text and "secrets." not in text
