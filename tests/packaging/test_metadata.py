"""setup.py, package.xml and what is in the tree say the same."""

import ast
import re
import runpy
import subprocess
import sys
from pathlib import Path
from xml.etree import ElementTree

import pytest
import setuptools

from shimmy_ros.resources import resource_directory

ROOT = Path(__file__).resolve().parents[2]


@pytest.fixture
def setup_arguments(monkeypatch):
    """What setup.py hands to setuptools."""
    recorded = {}
    monkeypatch.setattr(setuptools, "setup", lambda **arguments: recorded.update(arguments))
    monkeypatch.chdir(ROOT)
    runpy.run_path("setup.py")
    return recorded


@pytest.fixture(scope="module")
def manifest():
    return ElementTree.parse(ROOT / "package.xml").getroot()


def ros_packages(manifest):
    """The dependencies that are ROS packages: all but the keys of the system's Python packages."""
    keys = [depend.text for depend in manifest.findall("exec_depend")]
    return {key for key in keys if not key.startswith("python3-") and "-" not in key}


def imported_names(source):
    """Top-level names of all absolute imports, also of those inside functions."""
    for node in ast.walk(ast.parse(source)):
        if isinstance(node, ast.Import):
            yield from (alias.name.partition(".")[0] for alias in node.names)
        elif isinstance(node, ast.ImportFrom) and node.level == 0:
            yield node.module.partition(".")[0]


@pytest.mark.parametrize("field", ["name", "version", "description", "license"])
def test_setup_and_manifest_agree(setup_arguments, manifest, field):
    assert setup_arguments[field] == manifest.findtext(field)


def test_manifest_is_format_3_of_an_ament_python_package(manifest):
    assert manifest.get("format") == "3"
    assert manifest.findtext("export/build_type") == "ament_python"
    assert (ROOT / manifest.find("license").get("file")).is_file()


def test_every_package_is_installed(setup_arguments):
    folders = {path.parent for path in (ROOT / "shimmy_ros").rglob("*.py")}
    expected = {".".join(folder.relative_to(ROOT).parts) for folder in folders}
    assert set(setup_arguments["packages"]) == expected


def test_everything_beside_the_modules_is_installed_where_it_is_looked_for(setup_arguments):
    installed = {
        f"{target}/{Path(file).name}"
        for target, files in setup_arguments["data_files"]
        for file in files
    }
    expected = {
        "share/ament_index/resource_index/packages/shimmy_ros",
        "share/shimmy_ros/package.xml",
    }
    for folder in ("config", "launch", "msgs_spec"):
        assert resource_directory(folder) == ROOT / folder
        files = [path for path in (ROOT / folder).rglob("*") if path.is_file()]
        expected |= {
            f"share/shimmy_ros/{path.relative_to(ROOT).as_posix()}"
            for path in files
            if path.suffix != ".pyc"
        }
    assert installed == expected


def test_programs_exist(setup_arguments):
    for script in setup_arguments["entry_points"]["console_scripts"]:
        module, _, function = script.partition("=")[2].strip().partition(":")
        path = ROOT / Path(*module.split(".")).with_suffix(".py")
        tree = ast.parse(path.read_text(encoding="utf-8"))
        assert function in {node.name for node in tree.body if isinstance(node, ast.FunctionDef)}


def test_every_import_is_declared(setup_arguments, manifest):
    requirements = [re.split(r"[<>=\[]", text)[0] for text in setup_arguments["install_requires"]]
    declared = {"yaml" if name == "PyYAML" else name for name in requirements}
    allowed = sys.stdlib_module_names | {"shimmy_ros"} | declared | ros_packages(manifest)
    for path in (ROOT / "shimmy_ros").rglob("*.py"):
        undeclared = set(imported_names(path.read_text(encoding="utf-8"))) - allowed
        assert not undeclared, f"{path.relative_to(ROOT)} imports {undeclared}"


def test_every_requirement_is_imported(setup_arguments):
    names = {
        name
        for path in (ROOT / "shimmy_ros").rglob("*.py")
        for name in imported_names(path.read_text(encoding="utf-8"))
    }
    for text in setup_arguments["install_requires"]:
        requirement = re.split(r"[<>=\[]", text)[0]
        assert ("yaml" if requirement == "PyYAML" else requirement) in names


def test_the_core_imports_without_ros(manifest):
    modules = [
        ".".join(path.relative_to(ROOT).with_suffix("").parts).removesuffix(".__init__")
        for path in (ROOT / "shimmy_ros").rglob("*.py")
        if path.parent.name != "nodes"
    ]
    program = (
        "import importlib, sys\n"
        f"sys.modules.update(dict.fromkeys({sorted(ros_packages(manifest))!r}))\n"
        f"for module in {modules!r}: importlib.import_module(module)\n"
    )
    subprocess.run([sys.executable, "-c", program], cwd=ROOT, check=True, timeout=60)
