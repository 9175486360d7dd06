"""The package is typed: pyright in strict mode has nothing to say, also of code that uses it."""

import ast
import inspect
import pathlib
import shutil
import subprocess
import sys

import matchbench as mb
import pytest

ROOT = pathlib.Path(__file__).resolve().parents[2]


def test_pyright_is_silent_in_strict_mode():
    pyright = pathlib.Path(sys.executable).parent / "pyright"
    program = shutil.which(pyright) or shutil.which("pyright")
    if program is None:
        pytest.skip("pyright is not installed")
    told = subprocess.run([program, "--pythonpath", sys.executable, "-p", ROOT / "pyproject.toml"],
                          capture_output=True, text=True, timeout=600, cwd=ROOT)  # fmt: skip
    assert told.returncode == 0, told.stdout + told.stderr


def test_the_package_says_that_it_is_typed_and_names_all():
    folder = pathlib.Path(mb.__file__).parent
    assert (folder / "py.typed").is_file() and (folder / "_native.pyi").is_file()
    public = {name for name, value in vars(mb).items() if not (name.startswith("_") or inspect.ismodule(value))}
    assert set(mb.__all__) == public


def test_everything_compiled_has_a_docstring_that_the_stub_has_too():
    def words(text):
        return " ".join((text or "").split())

    tree = ast.parse((pathlib.Path(mb.__file__).parent / "_native.pyi").read_text())
    public = {name: value for name, value in vars(mb._native).items() if not name.startswith("_")}
    stubs = {node.name: node for node in tree.body if isinstance(node, (ast.ClassDef, ast.FunctionDef))}
    assert public.keys() == stubs.keys()
    for name, value in public.items():
        assert words(value.__doc__), name
        if isinstance(stubs[name], ast.FunctionDef):
            continue
        assert words(value.__doc__) == words(ast.get_docstring(stubs[name])), name
        inner = {node.name: node for node in stubs[name].body if isinstance(node, ast.FunctionDef)}
        own = {member for member in vars(value) if not member.startswith("_")}
        assert own == {member for member in inner if not member.startswith("_")}, name
        for member in own:
            said = words(getattr(value, member).__doc__)
            assert said and said == words(ast.get_docstring(inner[member])), f"{name}.{member}"


def test_stubs_say_which_classes_cannot_be_subclassed():
    tree = ast.parse((pathlib.Path(mb.__file__).parent / "_native.pyi").read_text())
    for stub in (node for node in tree.body if isinstance(node, ast.ClassDef)):
        try:
            type("Sub", (getattr(mb._native, stub.name),), {})
            final = False
        except TypeError:
            final = True
        assert final == any(ast.unparse(mark) == "final" for mark in stub.decorator_list), stub.name
        assert "__init__" not in {inner.name for inner in stub.body if isinstance(inner, ast.FunctionDef)}, stub.name
