"""Habits of CONTRIBUTING.md that can be counted: a function fits a screen, a file has one subject, a
public symbol says what it is."""

import ast
import re
import shutil
import subprocess

import pytest

from programs import TOP

MOST_OF_A_FUNCTION = 60
MOST_OF_A_FILE = 400
# a longer file says why, in its first lines
REASON = "Longer than most:"

def sources(*suffixes):
    listed = subprocess.run(["git", "ls-files", "--cached", "--others", "--exclude-standard"],
                            cwd=TOP, check=True, capture_output=True, text=True).stdout.split("\n")
    paths = [TOP / name for name in listed if name.endswith(suffixes)]
    return [path for path in paths if path.is_file()]


# what is no code: comments, texts and characters; each is replaced by its newlines
NO_CODE = re.compile(r'//[^\n]*|/\*.*?\*/|R"(\w*)\(.*?\)\1"|"(\\.|[^"\\\n])*"|\'(\\.|[^\'\\\n])+\'|#[^\n]*',
                     re.DOTALL)
SCOPE = re.compile(r"\s*(template <.*>\s*)?(inline )?(namespace|class|struct|union|extern)\b")


def functions_of_cpp(lines):
    """(first line of the body, lines) of the functions in namespaces and classes, by their braces."""
    code = NO_CODE.sub(lambda match: "\n" * match.group(0).count("\n"), "\n".join(lines))
    kinds, begins, head, line = [], [], "", 0
    for c in code:
        if c == "{":
            kind = "inside"
            if all(outer == "scope" for outer in kinds):
                if SCOPE.match(head) and "(" not in head.split("{")[0]:
                    kind = "scope"
                elif re.search(r"\)\s*:.*[\w>]$", head.rstrip(), re.DOTALL):
                    kind = "member"  # a_{0} between a constructor and its body
                elif ")" in head and "=" not in head.split("(")[0]:
                    kind = "function"
            kinds.append(kind)
            begins.append(line)
        elif c == "}" and kinds:
            kind, begin = kinds.pop(), begins.pop()
            if kind == "function":
                yield begin, line - begin
            if kind == "member":
                head += "()"
                continue
        if c in "{};":
            head = head if kinds and kinds[-1] == "member" else ""
        else:
            head += c
        line += c == "\n"


def functions_of_bash(lines):
    for first, line in enumerate(lines):
        if re.match(r"\w+\(\) [{(]$", line):
            end = next(n for n in range(first + 1, len(lines)) if lines[n] in ("}", ")"))
            yield first, end - first


def functions_of_python(lines):
    for node in ast.walk(ast.parse("\n".join(lines))):
        if isinstance(node, (ast.FunctionDef, ast.AsyncFunctionDef)):
            yield node.lineno - 1, node.end_lineno - node.lineno


FUNCTIONS = {".cpp": functions_of_cpp, ".h": functions_of_cpp, ".py": functions_of_python,
             ".sh": functions_of_bash}


def long_functions(name, text):
    lines = text.split("\n")
    return ["%s:%d has %d lines: %s" % (name, first + 1, count, lines[first].strip())
            for first, count in FUNCTIONS[name[name.rindex("."):]](lines)
            if count > MOST_OF_A_FUNCTION]


def test_a_function_fits_a_screen():
    found = []
    for path in sources(*FUNCTIONS):
        found += long_functions(str(path.relative_to(TOP)), path.read_text())
    assert not found, "\n".join(found)


@pytest.mark.parametrize("name,text", [
    ("a.cpp", "int f(int a,\n      int b) {\n%s}\n"),
    ("a.cpp", "class A {\n  A()\n      : a_(0) {\n%s      }\n};\n"),
    ("a.py", "def f():\n%s"),
    ("a.sh", "f() {\n%s}\n"),
])
def test_longer_functions_are_found(name, text):
    assert not long_functions(name, text % (59 * "        x\n"))
    assert len(long_functions(name, text % (61 * "        x\n"))) == 1


def test_a_long_file_says_why():
    found = []
    for path in sources(".cpp", ".h", ".py", ".sh", ".inc"):
        lines = path.read_text().split("\n")
        if len(lines) - 1 > MOST_OF_A_FILE and REASON not in "\n".join(lines[:6]):
            found.append("%s has %d lines" % (path.relative_to(TOP), len(lines) - 1))
    assert not found, "\n".join(found)


@pytest.mark.skipif(shutil.which("doxygen") is None, reason="no Doxygen")
def test_a_public_symbol_without_a_comment_is_an_error(tmp_path):
    def doxygen(code):
        (tmp_path / "a.h").write_text(code)
        settings = (TOP / "docs/Doxyfile").read_text() + "INPUT = %s/a.h\nOUTPUT_DIRECTORY = %s\n" % (
            tmp_path, tmp_path)
        return subprocess.run(["doxygen", "-"], input=settings, capture_output=True, text=True,
                              cwd=tmp_path)

    told = "/// A place.\nstruct Place {\n  int x;%s\n};\n"
    assert doxygen(told % "  ///< m").returncode == 0
    silent = doxygen(told % "")
    assert silent.returncode != 0
    assert "x" in silent.stderr and "is not documented" in silent.stderr
