"""Answers on the site: judged in the browser, kept there, and read by review and grade."""

import html
import json
import re
from pathlib import Path

import pytest
from browsers import browser_of_a_file, served

import floatbase.lessons.publish.site as site
from floatbase.errors import InputError
from floatbase.lessons import all_exercises, import_answers, progress, review
from floatbase.lessons.publish import NOTEBOOKS, grades, lesson_notebooks, read_notebook
from floatbase.lessons.questions import Question, all_questions
from floatbase.lessons.recalling import due_questions
from floatbase.lessons.submission import FILE_FORMAT

browser = browser_of_a_file
OLD_TIME = "2026-01-01T00:00:00Z"
STATIC = Path(site.__file__).parent / "static"
SCRIPTS = "".join(
    f"<script>{(STATIC / name).read_text()}</script>" for name in ("due.js", "answers.js")
)


class NoPictures:
    def place(self, data):
        """No picture is shown."""


def elements(lesson):
    """The forms of a lesson, as HTML."""
    notebook = read_notebook(lesson_notebooks()[lesson])
    prepared = site.prepare_lesson(notebook, NoPictures(), {})
    cells = [cell.source for cell in prepared.cells if "data-answers" in cell.source]
    cells = [cell for cell in cells if "answers-recall" not in cell]
    return [cell.removeprefix("```{raw} html\n").removesuffix("\n```") for cell in cells]


def data_of(element):
    return json.loads(html.unescape(re.findall('data-answers="([^"]*)"', element)[0]))


LESSONS = sorted({question.lesson for question in all_questions().values()})


@pytest.mark.parametrize("lesson", LESSONS)
def test_every_prediction_of_a_lesson_has_a_form_that_accepts_its_result(lesson):
    results = site.results(read_notebook(lesson_notebooks()[lesson]).cells)
    asked = [question for question in all_questions().values() if question.lesson == lesson]
    forms = [site.prediction_form(question, results[question.name]) for question in asked]
    found = [data_of(form.source) for form in forms if form]
    assert [data["name"] for data in found] == [question.name for question in asked]
    for data in found:
        if data["choices"]:
            assert data["right"] == data["result"] in data["choices"]
        else:
            numbers = data["result"] if isinstance(data["result"], list) else [data["result"]]
            assert len(numbers) == data["count"] == len(data["right"])
            assert all(a <= x <= b for x, (a, b) in zip(numbers, data["right"], strict=True))


FOLD = re.compile(
    r'```{raw} html\n<(/?)details(?: class="(\w+)"(?: data-names="(.*?)")?><summary>(\d*))?'
)


@pytest.mark.parametrize("lesson", LESSONS)
def test_results_and_claims_of_a_lesson_are_folded_and_its_questions_are_not(lesson):
    notebook = read_notebook(lesson_notebooks()[lesson])
    names = list(site.results(notebook.cells))
    claims = [c.source for c in notebook.cells if "claims" in c.metadata.get("tags", [])]
    open_folds, found, counts, boxes = [], [], [], 0
    for cell in site.prepare_lesson(notebook, NoPictures(), {}).cells:
        if fold := FOLD.match(cell.source):
            end, kind, named, count = fold.groups()
            open_folds.pop() if end else open_folds.append(kind)
            found += (named or "").split()
            counts += [int(count)] if count else []
            boxes += kind == "claims"
            continue
        has_heading = cell.cell_type == "markdown" and re.search(r"^#+ ", cell.source, re.M)
        is_question = "answers-prediction" in cell.source or "**Predict " in cell.source
        assert open_folds == [] or not (has_heading or is_question)
        boxes = 0 if has_heading else boxes
        texts = " ".join(output.get("text", "") for output in cell.get("outputs", []))
        shows = any(f"{name}: " in texts for name in names) or "**Why?**" in cell.source
        assert open_folds[:1] == ["result"] or not shows
        assert boxes <= 1  # of a section
    assert (open_folds, found) == ([], names)
    assert sum(counts) == len(re.findall(r"^ *assert ", "\n".join(claims), re.M))


@pytest.fixture
def folded(tmp_path, browser):
    """A page with the folded result of two predictions of lesson 03, which share it."""
    shared = '<details class="result" data-names="03.a 03.b"><summary>Result</summary><p>13</p>'
    write_page(tmp_path, "".join(elements("03")[:2]) + f"{shared}</details>")
    with served(tmp_path) as address:
        context = browser.new_context()
        opened = context.new_page()
        opened.goto(f"{address}/page.html")
        yield opened
        context.close()


@pytest.mark.front_end
@pytest.mark.parametrize("can_store", [True, False])
def test_a_result_opens_when_all_its_predictions_are_made(folded, can_store):
    if not can_store:
        folded.evaluate("() => { Storage.prototype.setItem = () => { throw new Error(); }; }")
    for form in folded.locator(".answers-prediction form").all():
        assert not folded.locator("p", has_text="13").is_visible()
        fill(form, "nonsense")
        assert not folded.locator("p", has_text="13").is_visible()
        fill(form, "wrong")
    assert folded.locator("p", has_text="13").is_visible()
    folded.reload()
    assert folded.locator("p", has_text="13").is_visible() == can_store


@pytest.mark.parametrize(
    ("question", "result"),
    [
        (Question("11.a", "", "", "", choices=("more", "less")), "more or less"),
        (Question("11.a", "", "", "", count=2), [1.0, 2.0, 3.0]),
        (Question("11.a", "", "", ""), None),  # not a number
    ],
)
def test_a_result_that_answers_another_question_makes_no_form(question, result):
    assert site.prediction_form(question, None) is None
    assert site.prediction_form(question, {"result": result, "shown": ""}) is None


def test_exercises_of_a_few_numbers_have_a_form_and_the_judges_own_hints():
    exercises = {}
    for name, exercise in all_exercises().items():
        if name in ("00.1", "01.1", "03.2", "09.2", "C.1"):
            made = site.exercise_form(exercise)
            exercises[name] = made and data_of(made.source)
    assert exercises["01.1"] is None and exercises["03.2"] is None  # a matrix, and free forces
    for name in ("00.1", "09.2", "C.1"):
        judge = all_exercises()[name].judge
        for answer, _ in judge.examples():
            cases = exercises[name]["cases"]
            fits = [c for c in cases if c["right"][0][0] <= float(answer) <= c["right"][0][1]]
            assert fits[0]["text"] == judge(answer).text


def write_page(folder, forms):
    (folder / "page.html").write_text(f"<!doctype html><meta charset=utf-8>{forms}{SCRIPTS}")


@pytest.fixture(scope="module")
def page(tmp_path_factory, browser):
    """A page with the forms of lessons 00 and 03."""
    folder = tmp_path_factory.mktemp("answers")
    forms = "\n".join(elements("03") + [e for e in elements("00") if "-exercise" in e])
    write_page(folder, forms)
    with served(folder) as address:
        opened = browser.new_context(accept_downloads=True).new_page()
        faults = []
        opened.on("pageerror", lambda error: faults.append(str(error)))
        opened.goto(f"{address}/page.html")
        yield opened
        assert faults == []


def fill(form, kind):
    """Answer a question "right", "wrong" or with "nonsense", and return what the page says."""
    data = json.loads(form.locator("xpath=..").get_attribute("data-answers"))
    if data["choices"]:
        wrong = next(choice for choice in data["choices"] if choice != data["result"])
        answer = {"right": data["result"], "wrong": wrong, "nonsense": ""}[kind]
        form.locator("select").select_option(answer)
    else:
        numbers = data["result"] if isinstance(data["result"], list) else [data["result"]]
        texts = {
            "right": ", ".join(map(str, numbers)),
            "wrong": ", ".join(str(2 * x + 7) for x in numbers),
            "nonsense": "heavy 40 mm",
        }
        form.locator("input[name=answer]").fill(texts[kind])
    form.locator("button").click()
    return str(form.locator("output").inner_text())


@pytest.mark.front_end
def test_a_reader_answers_lesson_03_reloads_and_hands_in(page, tmp_path, monkeypatch, capsys):
    forms = page.locator(".answers-prediction form")
    names = [name for name, question in all_questions().items() if question.lesson == "03"]
    assert forms.count() == len(names)
    for i, form in enumerate(forms.all()):
        said = fill(form, "nonsense")
        assert "Write" in said or "Choose" in said
        assert page.evaluate("localStorage.length") == int(i > 0)
        if i % 3 == 0:
            form.locator("input[name=sure]").check()
        assert "not right" in fill(form, "wrong")
        if i % 2:
            assert ": right" in fill(form, "right")
    exercise = page.locator(".answers-exercise form")
    for answer, shown in (("1,2", "Write"), ("157.8", "weight alone"), ("189.97", "Right")):
        exercise.locator("input").fill(answer)
        exercise.locator("button").click()
        assert shown in exercise.locator("output").inner_text()

    before = [form.locator("output").inner_text() for form in forms.all()]
    page.reload()
    assert [form.locator("output").inner_text() for form in forms.all()] == before
    rows = [row.inner_text().split("\t") for row in page.locator("tr").all()][1:]
    sure = [name for i, name in enumerate(names) if i % 3 == 0 and not i % 2]
    assert [row[0] for row in rows if row[3] == "sure"] == sure == [row[0] for row in rows[:3]]
    calibration = f"when you were sure {len(names[::3]) - len(sure)} of {len(names[::3])} times"
    assert calibration in page.locator(".answers-review p").inner_text()

    page.evaluate("() => { Storage.prototype.setItem = () => { throw new Error('full'); }; }")
    for form in (forms.first, exercise):
        form.locator("button").click()
        assert "cannot store" in form.locator("output").inner_text()
    page.reload()

    page.locator(".answers-review input").fill("Ada Lovelace")
    with page.expect_download() as download:
        page.locator(".answers-review button").click()
    assert download.value.suggested_filename == "answers-Ada_Lovelace.json"
    path = tmp_path / "answers.json"
    download.value.save_as(path)

    graded = grades.grade_file(path)
    assert (graded.name, graded.predicted) == ("Ada Lovelace", len(names))
    tried = [(r.exercise, r.result, r.tries) for r in graded.results if r.tries]
    assert tried == [("00.1", "right", 2)]
    monkeypatch.setenv("FLOATBASE_HOME", str(tmp_path / "home"))
    import_answers(path)
    import_answers(path)  # adds nothing
    assert progress.load() == {"00.1": {"tries": 2, "right": 1}}
    capsys.readouterr()
    review("03")
    _, *table, calibration = capsys.readouterr().out.splitlines()
    assert [line.split()[0] for line in table][: len(sure)] == sure
    assert f"of {len(names[::3])}" in calibration


@pytest.mark.front_end
@pytest.mark.parametrize(
    "kept",
    [
        "5",
        '{"predictions": "x", "exercises": [null], "recalled": 5}',
        '{"predictions": {"03.a": null, "03.b": {"said": {}}}, "exercises": {"00.1": {}}}',
    ],
)
def test_damaged_answers_in_the_browser_do_no_harm(page, kept):
    page.evaluate("(kept) => localStorage.setItem('floatbase-answers', kept)", kept)
    page.reload()
    form = page.locator(".answers-exercise form")
    form.locator("input").fill("189.97 N")
    form.locator("button").click()
    assert "Write" in form.locator("output").inner_text()
    form.locator("input").fill("189.97")
    form.locator("button").click()
    assert "Right" in form.locator("output").inner_text()


@pytest.fixture(scope="module")
def recalling(tmp_path_factory, browser):
    """A page that asks what is due."""
    folder = tmp_path_factory.mktemp("recall")
    site.recall.write_script([NOTEBOOKS / "02_equations_of_motion.ipynb"], folder)
    write_page(folder, site.recall.recall_box("", offers_first=True))
    with served(folder) as address:
        opened = browser.new_page()
        opened.goto(f"{address}/page.html")
        yield opened


@pytest.mark.front_end
def test_a_new_reader_is_asked_a_first_question_that_comes_back(recalling):
    page, form = recalling, recalling.locator(".answers-recall form")
    name = form.locator("strong").first.inner_text()
    right = page.evaluate("name => floatbaseRecall.questions[name].result", name)
    field = form.locator("[name=answer]")
    is_choice = field.evaluate("field => field.tagName") == "SELECT"
    field.select_option(right) if is_choice else field.fill(str(right))
    form.locator("button").click()
    assert "Right: " in form.locator("output").inner_text()
    page.reload()
    assert form.count() == 0
    age = "kept => localStorage.setItem('floatbase-answers', kept.replace(/20\\d\\d-/, '2020-'))"
    page.evaluate(age, page.evaluate("localStorage.getItem('floatbase-answers')"))
    page.reload()
    assert form.locator("strong").first.inner_text() == name
    page.evaluate("localStorage.clear()")


@pytest.mark.front_end
def test_a_reader_recalls_with_the_keyboard(recalling, tmp_path, monkeypatch):
    page, box = recalling, recalling.locator(".answers-recall")
    said = {"01.d": [1, 2], "01.e": "true", "02.c": "they stay", "02.d": 43.1}
    shown = {"01.d": [18, 12], "01.e": "true", "02.c": "they fly up", "02.d": 43.1}
    entry = {"unit": "", "sure": False, "time": OLD_TIME}
    predictions = {name: entry | {"said": said[name], "is": shown[name]} for name in said}
    keep = "kept => localStorage.setItem('floatbase-answers', JSON.stringify(kept))"
    page.evaluate(keep, {"predictions": predictions})
    page.reload()
    names = [text.split(",")[0] for text in box.locator("form p").all_inner_texts()]
    assert names == ["01.d", "02.c", "01.e"]  # missed ones first, of different lessons
    page.keyboard.press("Tab")
    page.keyboard.type("18 12")
    page.keyboard.press("Enter")
    first, second, _ = box.locator("form").all()
    assert "Right: " in first.locator("output").inner_text()
    page.keyboard.press("Enter")  # counts once
    page.keyboard.press("Tab")
    assert page.evaluate("document.activeElement.textContent") == "Answer"  # focus is kept
    page.keyboard.press("Tab")
    page.keyboard.type("they s")
    page.keyboard.press("Tab")
    page.keyboard.press("Enter")
    said_of_it = second.locator("output")
    assert "they fly up" in said_of_it.inner_text() and "Not yet" in said_of_it.inner_text()
    assert second.get_by_role("link", name="lesson 02").get_attribute("href").startswith("http")
    kept = json.loads(page.evaluate("localStorage.getItem('floatbase-answers')"))
    knew = {name: [one["knew"] for one in said] for name, said in kept["recalled"].items()}
    assert knew == {"01.d": [True], "02.c": [False]}
    page.reload()
    names = [text.split(",")[0] for text in box.locator("form p").all_inner_texts()]
    assert names == ["01.e", "02.d"]
    monkeypatch.setenv("FLOATBASE_HOME", str(tmp_path / "home"))
    written = {"form": FILE_FORMAT, "exercises": {}} | kept
    (tmp_path / "a.json").write_text(json.dumps(written))
    for _ in range(2):
        import_answers(tmp_path / "a.json")
        history = progress.history()
        assert [event.get("knew") for event in history["02.c"]] == [None, False]
    assert [question.name for question in due_questions()] == ["01.e", "02.d"]


def test_only_answers_of_the_course_are_imported(tmp_path, monkeypatch):
    """A file may set neither an id nor a solved exercise; a result completes a prediction."""
    monkeypatch.setenv("FLOATBASE_HOME", str(tmp_path / "home"))
    progress.append("02.d", {"said": 43.1})  # without its result
    asked = {"recalled": 43.1, "knew": True, "time": OLD_TIME}
    written = {
        "form": FILE_FORMAT,
        "predictions": {"02.d": {"said": 1.0, "is": 43.1}, "student": {"id": "forged"}},
        "exercises": {"student": {"id": "forged"}, "other": {"tries": 1, "right": 1}},
        "recalled": {
            "02.d": [asked | {"is": 7.0}, {"knew": True}],
            "student": [{"id": "forged"}],
            "06.1": [{"tries": 5, "right": 5}],
        },
    }
    (tmp_path / "a.json").write_text(json.dumps(written))
    for _ in range(2):
        import_answers(tmp_path / "a.json")
        assert progress.student() == "" and progress.load() == {}
        assert progress.history() == {"02.d": [{"said": 43.1}, {"is": 43.1}, asked]}


@pytest.mark.parametrize("text", ["", "[]", "{}", '{"form": "answers to the floatbase course"}'])
def test_another_file_is_not_imported(tmp_path, text):
    (tmp_path / "a.json").write_text(text)
    for path in (tmp_path / "a.json", tmp_path / "none.json", 5):
        with pytest.raises(InputError, match="answers|read"):
            import_answers(path)
