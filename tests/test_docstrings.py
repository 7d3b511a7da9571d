"""Docstrings of public names follow NumPy's form: parameters, types, shapes and units."""

import doctest
import inspect
import re
from importlib import import_module

import pytest
from numpydoc.docscrape import NumpyDocString
from numpydoc.validate import validate

from floatbase.lessons.publish.site import PACKAGES, exported

LISTED = [name for name in PACKAGES if name != "floatbase"]
# missing, unknown, reordered and untyped parameters; descriptions; the summary's full stop
CODES = {"GL08", "PR01", "PR02", "PR03", "PR04", "PR07", "RT01", "RT03", "SS03"}
UNIT = re.compile(r"\[[^\]]+\]|dimensionless")
ARRAY = re.compile(r"\b(Array|ArrayLike)\b")


def public(package):
    """Full name and value of every public function, class and member of a package."""
    for name, value in exported(package):
        if not (inspect.isclass(value) or inspect.isroutine(value)):
            continue
        if getattr(value, "_is_protocol", False):
            continue
        yield f"{package}.{name}", value
        if not inspect.isclass(value):
            continue
        for member, thing in vars(value).items():
            if not member.startswith("_") and (
                inspect.isroutine(thing) or isinstance(thing, property | staticmethod | classmethod)
            ):
                yield f"{package}.{name}.{member}", getattr(value, member)


def annotations(value):
    """Annotation of each parameter of a function or constructor, as the source has it."""
    try:
        parameters = inspect.signature(value).parameters.values()
    except (TypeError, ValueError):
        return {}
    return {one.name: str(one.annotation) for one in parameters}


@pytest.mark.parametrize("package", LISTED)
def test_every_parameter_has_a_type_a_shape_and_a_unit(package):
    wrong = []
    for name, value in public(package):
        found = validate(name)
        one_line = "\n" not in (inspect.getdoc(value) or "")
        skipped = {"RT01", "PR01"} if one_line and not inspect.isclass(value) else set()
        wrong += [f"{name}: {text}" for code, text in found["errors"] if code in CODES - skipped]
        given = annotations(value)
        for entry in NumpyDocString(inspect.getdoc(value) or "")["Parameters"]:
            described = " ".join(entry.desc)
            for parameter in entry.name.split(", "):
                annotation = given.get(parameter.lstrip("*"), "")
                if ARRAY.search(annotation) and "shape" not in f"{entry.type} {described}":
                    wrong.append(f"{name}: {parameter} has no shape")
                if annotation.split(" |")[0] == "float" and not UNIT.search(described):
                    wrong.append(f"{name}: {parameter} has no unit")
    assert not wrong, "\n".join(wrong)


@pytest.mark.parametrize("package", LISTED)
def test_examples_in_docstrings_run(package):
    module = import_module(package)
    names = {"fb": import_module("floatbase"), "np": import_module("numpy"), **vars(module)}
    runner, finder = doctest.DocTestRunner(optionflags=doctest.ELLIPSIS), doctest.DocTestFinder()
    for name, value in public(package):
        for test in finder.find(value, name, module=module, globs=dict(names)):
            runner.run(test)
    assert runner.failures == 0
