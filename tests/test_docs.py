"""The code of README and documentation runs and prints what the pages show."""

import re
from pathlib import Path

import pytest

ROOT = Path(__file__).resolve().parent.parent
PAGES = [ROOT / "README.md", *sorted((ROOT / "docs").glob("*.md"))]
WITH_CODE = [page for page in PAGES if "```python\n" in page.read_text(encoding="utf-8")]
LINK = re.compile(r"\]\(((?!https?:)[^)#\s]+)")


@pytest.mark.parametrize("page", WITH_CODE, ids=lambda page: page.stem)
def test_the_code_of_a_page_prints_the_output_of_the_page(page, tmp_path, monkeypatch, capsys):
    monkeypatch.chdir(tmp_path)
    names = {"__name__": "page"}
    text = page.read_text(encoding="utf-8")
    for language, block in re.findall(r"^```(python|text)\n(.*?)^```$", text, re.M | re.S):
        if language == "text":
            assert capsys.readouterr().out.endswith(block)
        else:
            exec(compile(block, str(page), "exec"), names)
    for name in ("view", "page"):
        if name in names:
            names[name].close()
    if "viz" in names:  # meshcat ends its server when Python ends
        names["viz"].viewer.window.server_proc.kill()
        names["viz"].viewer.window.server_proc.wait()


@pytest.mark.parametrize("page", PAGES, ids=lambda page: page.stem)
def test_links_of_a_page_lead_to_files(page):
    made_by_the_site = ("lessons/", "api/")
    links = LINK.findall(page.read_text(encoding="utf-8"))
    ours = [link for link in links if not link.startswith(made_by_the_site)]
    assert [link for link in ours if not (page.parent / link).exists()] == []
