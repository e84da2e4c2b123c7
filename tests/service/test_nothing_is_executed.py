"""Files and messages from elsewhere are data: nothing in the sources turns them into code."""

from __future__ import annotations

import ast
import subprocess
import sys
from collections.abc import Iterator
from pathlib import Path

import numpy as np
import pytest

from config import InputError
from service.diagnosis.traces_file import load_traces

ROOT = Path(__file__).parents[2]
PACKAGES = ("config", "driver", "estimator", "learner", "service", "virtual_hw")
EXECUTES = {"eval", "exec", "compile", "__import__", "execfile"}
MODULES = {"pickle", "cPickle", "dill", "cloudpickle", "joblib", "marshal", "shelve", "yaml", "code", "runpy", "imp"}
LIBRARIES = {"dill", "cloudpickle", "joblib", "shelve", "yaml"}
SHELLS = {"os.system", "os.popen", "os.execv", "os.execvp", "os.spawnv", "subprocess.getoutput"}
ALLOWED = {
    # A socket pair between the daemon and its own loop, without a name that anybody else could connect to.
    ("driver/cyclic/messages.py", "pickle"),
    # Of the names that `iter_modules` finds in the package itself.
    ("estimator/effects/__init__.py", "importlib"),
}


def sources() -> Iterator[tuple[str, ast.Module]]:
    for package in PACKAGES:
        for path in sorted((ROOT / package).rglob("*.py")):
            yield str(path.relative_to(ROOT)), ast.parse(path.read_text())


def dotted(node: ast.expr) -> str:
    """``np.load`` of the expression, "" of what is no name."""
    if isinstance(node, ast.Attribute):
        return f"{dotted(node.value)}.{node.attr}"
    return node.id if isinstance(node, ast.Name) else ""


def suspects(name: str, tree: ast.Module) -> Iterator[str]:
    for node in ast.walk(tree):
        if isinstance(node, ast.Import | ast.ImportFrom):
            names = [alias.name for alias in node.names] if isinstance(node, ast.Import) else [node.module or ""]
            for module in {full.partition(".")[0] for full in names} & (MODULES | {"importlib"}):
                # `importlib.metadata` and `.resources` only look.
                if (name, module) not in ALLOWED and not {"importlib.metadata", "importlib.resources"} >= set(names):
                    yield f"{name}:{node.lineno} imports {module}"
        elif isinstance(node, ast.Call):
            called = dotted(node.func)
            words = {keyword.arg: keyword.value for keyword in node.keywords}
            if called in EXECUTES | SHELLS:
                yield f"{name}:{node.lineno} calls {called}"
            if "shell" in words:
                yield f"{name}:{node.lineno} gives a shell to {called}"
            if called in ("np.load", "numpy.load") and not (
                isinstance(words.get("allow_pickle"), ast.Constant) and words["allow_pickle"].value is False  # type: ignore[attr-defined]
            ):
                yield f"{name}:{node.lineno} loads an array without allow_pickle=False"


def test_no_source_executes_what_it_reads() -> None:
    found = list(sources())
    assert len(found) > 200
    assert [suspect for name, tree in found for suspect in suspects(name, tree)] == []


@pytest.mark.parametrize(
    "text",
    ["import pickle", "from yaml import load", "eval(x)", "os.system(x)", "subprocess.run(x, shell=True)",
     "np.load(p)", "np.load(p, allow_pickle=True)", "import importlib", "exec(text)"],
)  # fmt: skip
def test_the_search_finds_what_it_is_for(text: str) -> None:
    assert list(suspects("made_up.py", ast.parse(text)))


def test_no_library_for_it_comes_along() -> None:
    """Of the daemon's and the readers' whole import graph: no YAML, no joblib, none of their kin."""
    script = (
        "import sys, service.daemon.process, service.cli.app, driver.recording, service.models.store\n"
        f"print(*set({sorted(LIBRARIES)!r}) & set(sys.modules))"
    )
    done = subprocess.run([sys.executable, "-c", script], capture_output=True, text=True, check=True, cwd=ROOT)
    assert done.stdout.split() == []


class Bomb:
    """Leaves a trace when it is unpickled."""

    def __init__(self, path: Path) -> None:
        self.path = path

    def __reduce__(self) -> tuple[object, tuple[str]]:
        return Path.touch, (str(self.path),)


def test_an_array_file_with_an_object_in_it_is_refused(tmp_path: Path) -> None:
    fuse, kept = tmp_path / "fuse", tmp_path / "traces.npz"
    np.savez(kept, labels=np.array([Bomb(fuse)], dtype=object), allow_pickle=True)
    with pytest.raises(InputError, match="holds no traces"):
        load_traces(kept)
    assert not fuse.exists()
