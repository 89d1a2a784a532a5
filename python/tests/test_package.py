"""What the package index shows: metadata, licences, links."""

import importlib.metadata
import re
from pathlib import Path

import pytest

PROJECT = Path(__file__).parent.parent


def metadata():
    try:
        return importlib.metadata.metadata("energy-dsl")
    except importlib.metadata.PackageNotFoundError:
        pytest.skip("not installed")


def test_the_licences_are_those_of_the_project():
    for name in ("LICENSE-MIT", "LICENSE-APACHE"):
        original = PROJECT.parent / name
        if not original.exists():
            pytest.skip("not in the repository")
        assert (PROJECT / name).read_bytes() == original.read_bytes(), name


def test_metadata_name_licences_links_and_versions():
    found = metadata()
    assert set(found.get_all("License-File")) == {"LICENSE-MIT", "LICENSE-APACHE"}
    assert found["License-Expression"] == "MIT OR Apache-2.0" and found["Requires-Python"] == ">=3.10"
    links = dict(link.split(", ") for link in found.get_all("Project-URL"))
    assert {"Homepage", "Documentation", "Changelog", "Issues"} <= set(links)
    assert "Programming Language :: Python :: 3.10" in found.get_all("Classifier")
    files = [str(file) for file in importlib.metadata.files("energy-dsl")]
    assert {"LICENSE-MIT", "LICENSE-APACHE"} <= {Path(file).name for file in files}


def test_links_of_the_readme_work_elsewhere():
    readme = PROJECT / "README.md"
    if not readme.exists():
        pytest.skip("not in the repository")
    text = readme.read_text(encoding="utf-8")
    targets = re.findall(r"\]\(([^)]+)\)", text) + re.findall(r"^\[[^]]+\]: (\S+)", text, re.M)
    assert targets and all(target.startswith("https://") for target in targets), targets
    for target in targets:
        path = target.partition("/main/")[2]
        if (PROJECT.parent / "Cargo.toml").exists():
            assert (PROJECT.parent / path).exists(), target
