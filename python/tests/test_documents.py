"""What documents show runs as it stands."""

import re
import subprocess
import sys
from pathlib import Path

import numpy as np
import pytest

import raybalance
from conftest import sphere

ROOT = Path(__file__).resolve().parents[2]


def blocks(page: str) -> list[str]:
    """The page's Python, but for what opens with `# not run`."""
    text = (ROOT / page).read_text(encoding="utf-8")
    return [code for code in re.findall(r"```python\n(.*?)```", text, re.S) if not code.startswith("# not run")]


# README's older block reads files that a command writes.
@pytest.mark.parametrize("page", ["docs/python.md", "README.md", "python/README.md"])
def test_pages_run(page, tmp_path: Path, monkeypatch: pytest.MonkeyPatch, rays) -> None:
    """Mutant: a method renamed in the package alone."""
    monkeypatch.chdir(tmp_path)
    np.save("hits.npy", np.zeros((5, 4), dtype=np.float32))
    vertices, faces = sphere()
    origins, directions = rays
    lines = [f"v {x} {y} {z}" for x, y, z in vertices] + ["f {} {} {}".format(*(face + 1)) for face in faces]
    Path("room.obj").write_text("\n".join(lines))
    names = {"vertices": vertices, "faces": faces, "origins": origins, "directions": directions, "np": np}
    found = blocks(page)
    assert found
    for code in found:
        exec(compile(code, page, "exec"), names)
    assert isinstance(names["run"], raybalance.Run)


def test_the_example_runs(tmp_path: Path) -> None:
    example = ROOT / "python/examples/cost_map.py"
    done = subprocess.run([sys.executable, example], cwd=tmp_path, capture_output=True, text=True, check=False)
    assert done.returncode == 0, done.stderr
    assert "yard" in done.stdout and "hybrid" in done.stdout
    head = (tmp_path / "cost.pgm").read_bytes()
    assert head.startswith(b"P5 320 240 255\n") and len(head) == len(b"P5 320 240 255\n") + 320 * 240
    assert "Cost of each task" in (tmp_path / "run.html").read_text(encoding="utf-8")


def test_the_stub_names_what_the_module_has() -> None:
    """Mutant: a method without its line in the stub, or the other way round."""
    native = raybalance._raybalance
    stub = (ROOT / "python/raybalance/_raybalance.pyi").read_text(encoding="utf-8")
    kinds = re.split(r"^class (\w+)", stub, flags=re.M)
    for name, body in zip(kinds[1::2], kinds[2::2], strict=True):
        kind = getattr(native, name)
        if issubclass(kind, Exception):
            continue
        told = set(re.findall(r"^    def (\w+)", body, re.M)) - {"__new__"}
        has = {name for name in vars(kind) if not name.startswith("_")}
        assert told == has, name


def test_docstrings_run() -> None:
    import doctest

    assert doctest.testmod(raybalance).attempted > 0
    assert doctest.testmod(raybalance).failed == 0


def test_the_package_is_typed() -> None:
    assert (Path(raybalance.__file__).parent / "py.typed").exists()
