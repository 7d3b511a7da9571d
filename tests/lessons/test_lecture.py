"""Questions for the lecture: four per lesson, with results and reasons from the lessons."""

import re

import pytest
from browsers import browser_of_a_file

from floatbase.errors import InputError
from floatbase.lessons.publish import lesson_notebooks, read_notebook
from floatbase.lessons.publish.__main__ import main
from floatbase.lessons.publish.site import lecture
from floatbase.lessons.questions import all_questions

browser = browser_of_a_file
QUESTIONS = lecture.lecture_questions()


def test_each_lesson_has_four_questions_with_a_result_and_a_reason():
    assert set(QUESTIONS) == {question.lesson for question in all_questions().values()}
    for asked in QUESTIONS.values():
        assert len({one.question.name for one in asked}) == 4
        for question, result, reason in asked:
            assert "?" in question.text
            assert len(reason.split()) > 3, question.name
            if question.choices:
                assert result in question.choices
            else:
                assert len(re.findall(r"\d+(?:\.\d+)?", result)) == question.count


def test_reasons_come_from_the_lesson_or_from_the_metadata_of_the_question():
    reasons = {one.question.name: one.reason for some in QUESTIONS.values() for one in some}
    assert [name for name, reason in reasons.items() if reason[-1] in ":?"] == []
    assert reasons["P.f"].startswith("At rest every foot pushes")
    assert reasons["02.c"][1:] in " ".join(text_of("02").split())
    known = all_questions().values()
    assert {one.name for one in known if one.reason} <= set(reasons)


def text_of(lesson):
    cells = read_notebook(lesson_notebooks()[lesson]).cells
    return "\n".join(cell.source for cell in cells if cell.cell_type == "markdown")


def test_a_result_that_is_not_stored_is_named(monkeypatch):
    monkeypatch.setattr(lecture, "results", lambda cells: {})
    with pytest.raises(InputError, match=r"00\.a"):
        lecture.lecture_questions.__wrapped__()


def test_page_and_slides_hold_all_questions(tmp_path):
    page = lecture.page()
    main(["lecture", "--to", str(tmp_path / "slides.html")])
    slides = (tmp_path / "slides.html").read_text(encoding="utf-8")
    for asked in QUESTIONS.values():
        for one in asked:
            assert f"Answer ({one.question.name})" in page
            assert f"<footer>{one.question.name}</footer>" in slides
    assert slides.count("<section>") == 5 * len(QUESTIONS)
    texts = re.sub(r"<script>.*</script>|<style>.*</style>|<math.*?</math>", "", slides, flags=re.S)
    assert not re.search(r"[*$`]|\\\w", texts)  # no Markdown and no LaTeX is left
    assert "http" not in re.sub(r'xmlns="[^"]*"', "", slides)


@pytest.mark.front_end
def test_keys_turn_the_pages_and_show_the_answer(tmp_path, browser):
    lecture.write_slides(tmp_path / "slides.html")
    page = browser.new_page()
    page.goto((tmp_path / "slides.html").as_uri())
    assert page.locator("section:visible h1").count() == 1
    page.keyboard.press("ArrowRight")
    answer = page.locator("section.now .answer")
    assert not answer.is_visible()
    page.keyboard.press(" ")
    assert answer.is_visible() and "more" in answer.inner_text()
    page.keyboard.press("ArrowLeft")
    page.keyboard.press("ArrowLeft")
    assert page.locator("section:visible").count() == 1
